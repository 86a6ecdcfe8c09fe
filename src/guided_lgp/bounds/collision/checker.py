"""Collision checks for planning: convex hulls of the robot's meshes, boxes and tables, in coal.

The hulls are those that PyBullet makes of the same files, so that its verdict at the end agrees.
A check takes about 10 us: forward kinematics, bounding boxes of all bodies, then exact tests. What
is certified as free needs none.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache
from itertools import pairwise, product
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from guided_lgp.bounds.collision.certificate import Certificate
from guided_lgp.bounds.collision.nearest import Nearest
from guided_lgp.bounds.collision.shapes import bodies_of
from guided_lgp.bounds.results import Array
from guided_lgp.robots import Arm
from guided_lgp.scene import Box, Scene

PADDING = 0.003
"""Distance (m) that everything keeps from everything, declared contacts apart."""
LEAST = 0.001
"""Distance (m) below which a plan for users is refused, where things do not stand so near."""
_ROUNDING = 0.0005
"""How much nearer (m) bodies may come that stand nearer than that at the start."""
_FEW = 3
"""Configurations that are checked one by one: a certificate for them costs as much."""


@dataclass(frozen=True)
class PlanningScene:
    """What is where, and what may touch, while one arm moves."""

    gripper: str
    """Whose arm moves; the others stand still."""
    standing: Mapping[str, Array]
    """World pose (7,) of every box that no gripper carries."""
    carried: Mapping[str, tuple[str, Array]] = field(default_factory=dict)
    """Gripper, and pose (7,) in its tool frame, of every box held or standing on a held one."""
    touching: frozenset[frozenset[str]] = frozenset()
    """Declared contacts: pairs of boxes, tables and grippers (meaning the hand)."""
    also: frozenset[str] = frozenset()
    """Other grippers whose arms move as well."""

    @property
    def moving(self) -> frozenset[str]:
        """All grippers whose arms move."""
        return self.also | {self.gripper}


_Pattern = tuple[
    frozenset[str], frozenset[str], frozenset[tuple[str, str]], frozenset[frozenset[str]]
]
"""What decides which pairs are checked: moving arms, standing and carried boxes, contacts."""
_NOTHING: _Pattern = (frozenset(), frozenset(), frozenset(), frozenset())


class CollisionChecker:
    """Checks configurations of the robot in one scene; a planning scene says which move."""

    def __init__(self, scene: Scene) -> None:
        robot = self._robot = scene.robot.description
        self._model, self._geometry = bodies_of(scene)
        self._names = [str(body.name) for body in self._geometry.geometryObjects]
        self._bodies: dict[str, list[int]] = {}
        for number, name in enumerate(self._names):
            self._bodies.setdefault(name, []).append(number)
        self._arm = {g: self._shapes(*arm.links, *arm.hand_links) for g, arm in robot.arms.items()}
        self._bodies |= {g: self._shapes(*arm.hand_links) for g, arm in robot.arms.items()}
        self._boxes = {box.name for box in scene.movable}
        self._tool = {gripper: self._tool_frame(arm) for gripper, arm in robot.arms.items()}
        self._candidates = self._candidate_pairs(
            len(scene.supports) + len(scene.movable), robot.disabled_pairs
        )
        self._pairs = np.nonzero(np.triu(self._candidates, 1))
        for first, second in zip(*self._pairs, strict=True):
            self._geometry.addCollisionPair(pin.CollisionPair(int(first), int(second)))
        self._data = self._model.createData()
        self._geometry_data = self._geometry.createData()
        for request in self._geometry_data.collisionRequests:
            request.security_margin = PADDING
        self._broad = pin.BroadPhaseManager_NaiveCollisionManager(
            self._model, self._geometry, self._geometry_data
        )
        self._callback = pin.CollisionCallBackDefault(self._geometry, self._geometry_data, True)
        self.entered: PlanningScene | None = None
        """The scene that is there."""
        self._pattern = self._shown = _NOTHING
        """What was entered last, and for which coal's own search for pairs is prepared."""
        self._patterns: dict[_Pattern, tuple[NDArray[np.bool_], list[int], NDArray[np.intc]]] = {}
        self._active: list[int] = []
        self._apart = np.empty((0, 2), dtype=np.intc)
        self._placed: dict[str, tuple[str | None, bytes]] = {}
        """Gripper, if any, and pose there of every box that was put somewhere."""
        self.queries = 0
        """Calls of :meth:`first_collision` so far."""
        self._template = pin.neutral(self._model)
        for name, value in scene.robot.fixed_values.items():
            self._template[self._coordinate(name)] = value
        moving = robot.moving_joints
        at = np.array([self._coordinate(joint) for joint in moving])
        self._turning = np.array(robot.continuous, dtype=int)
        self._plain = np.delete(np.arange(len(at)), self._turning)
        self._plain_at, self._cosine_at = at[self._plain], at[self._turning]
        self._certificate = Certificate(
            robot.urdf, self._model, self._template, self._geometry, moving
        )
        self._nearest = Nearest(
            self._model,
            self._geometry,
            [self._model.joints[self._model.getJointId(j)].idx_v for j in robot.joint_names],
        )
        self._yield_where_near(scene)
        self._moving = len(moving)
        self._fingers = {gripper: arm.fingers for gripper, arm in robot.arms.items()}

    def _yield_where_near(self, scene: Scene) -> None:
        """What stands side by side at the start may be lifted off as near as it is."""
        standing = {box.name: box for box in scene.movable if box.name not in scene.held}
        for box in standing.values():
            self._put(box.name, None, box.placement)
        pin.updateGeometryPlacements(
            self._model, self._data, self._geometry, self._geometry_data, self._template
        )
        still = {body.name for body in (*scene.supports, *scene.obstacles)}
        for number, pair in enumerate(self._geometry.collisionPairs):
            first, second = self._names[pair.first], self._names[pair.second]
            beside = {first, second} <= {*standing, *still} and not {first, second} <= still
            if beside and not _stands(standing, first, second):
                found = pin.computeDistance(self._geometry, self._geometry_data, number)
                if found.min_distance < PADDING:
                    request = self._geometry_data.collisionRequests[number]
                    request.security_margin = found.min_distance - _ROUNDING

    def enter(self, scene: PlanningScene) -> None:
        """Put the boxes where the scene says, and check what can collide while its arm moves.

        A box that the scene does not mention is nowhere.
        """
        self.entered = scene
        for box, placement in scene.standing.items():
            self._put(box, None, placement)
        for box, (gripper, grasp) in scene.carried.items():
            self._put(box, gripper, grasp)
        pattern = (
            scene.moving,
            frozenset(scene.standing),
            frozenset((box, gripper) for box, (gripper, _) in scene.carried.items()),
            scene.touching,
        )
        if pattern != self._pattern:
            if pattern not in self._patterns:
                active = self._active_pairs(scene)
                numbers = np.flatnonzero(active[self._pairs])
                apart = np.stack(self._pairs, axis=1)[numbers].astype(np.intc)
                self._patterns[pattern] = active, numbers.tolist(), apart
            self._pattern = pattern
            _, self._active, self._apart = self._patterns[pattern]

    def _active_pairs(self, scene: PlanningScene) -> NDArray[np.bool_]:
        """Pairs of shapes of which one moves, but for declared contacts and what moves together."""
        carried = {
            gripper: [
                number
                for box, (carrier, _) in scene.carried.items()
                for number in self._bodies[box]
                if carrier == gripper
            ]
            for gripper in sorted(scene.moving)
        }
        moves = np.zeros(len(self._names), dtype=bool)
        for gripper, load in carried.items():
            moves[[*self._arm[gripper], *load]] = True
        active = self._candidates & (moves[:, None] | moves[None, :])
        for load in carried.values():
            active[np.ix_(load, load)] = False
        absent = self._boxes - {*scene.standing, *scene.carried}
        nowhere = [number for box in absent for number in self._bodies[box]]
        active[nowhere] = active[:, nowhere] = False
        for one, other in scene.touching:
            first, second = self._bodies[one], self._bodies[other]
            active[np.ix_(first, second)] = active[np.ix_(second, first)] = False
        return np.asarray(active)

    def moving_joints(self, q: Array, fingers: Mapping[str, float]) -> Array:
        """Rows (m, joints) of all moving joints for configurations (m, n)."""
        moving = np.empty((len(q), self._moving))
        moving[:, : q.shape[1]] = q
        for gripper, hand in self._fingers.items():
            moving[:, hand.slice] = fingers.get(gripper, 0.0) * hand.ratios
        return moving

    def first_collision(self, q: Array, fingers: Mapping[str, float]) -> tuple[str, str] | None:
        """The first pair of bodies found in collision along configurations (m, n), if any.

        The configurations are visited from coarse to fine: ends, middle, quarters, …
        """
        self.queries += 1
        moving = self.moving_joints(q[_coarse_to_fine(len(q))], fingers)
        return next((pair for _, pair in self.collisions(moving)), None)

    def collisions(self, moving: Array) -> Iterator[tuple[int, tuple[str, str]]]:
        """The rows (m, joints) of all moving joints in collision, and the first pair in each.

        Coal decides of what is not certified as free.
        """
        if len(moving) <= _FEW:
            unsure = np.arange(len(moving))
            pairs = map(self._first_of_all, self._coordinates(moving))
        else:
            near = self._certificate.near(moving, self._apart, PADDING)
            unsure = np.flatnonzero(near.any(axis=1))
            ends = np.cumsum(np.count_nonzero(near[unsure], axis=1)).tolist()
            numbers = [self._active[place] for place in near[unsure].nonzero()[1].tolist()]
            those = (numbers[begin:end] for begin, end in pairwise((0, *ends)))
            pairs = map(self._first_of, self._coordinates(moving[unsure]), those)
        yield from ((row, pair) for row, pair in zip(unsure.tolist(), pairs, strict=True) if pair)

    def _first_of_all(self, coordinates: Array) -> tuple[str, str] | None:
        """The first pair of bodies in collision."""
        if self._shown != self._pattern:
            active, *_ = self._patterns[self._pattern]
            self._geometry_data.setActiveCollisionPairs(self._geometry, active, True)
            self._shown = self._pattern
        if not pin.computeCollisions(
            self._model, self._data, self._broad, self._callback, coordinates
        ):
            return None
        return self._named(self._callback.collisionPairIndex)

    def _first_of(self, coordinates: Array, those: list[int]) -> tuple[str, str] | None:
        """The same, of those pairs alone that may be near each other."""
        pin.updateGeometryPlacements(
            self._model, self._data, self._geometry, self._geometry_data, coordinates
        )
        for pair in those:
            if pin.computeCollision(self._geometry, self._geometry_data, pair):
                return self._named(pair)
        return None

    def _named(self, pair: int) -> tuple[str, str]:
        bodies = self._geometry.collisionPairs[pair]
        return self._names[bodies.first], self._names[bodies.second]

    def certified(self, moving: Array) -> NDArray[np.bool_]:
        """Which rows (m, joints) of all moving joints are surely free; see :class:`Certificate`."""
        return np.asarray(~self._certificate.near(moving, self._apart, PADDING).any(axis=1))

    def free(self, moving: Array) -> NDArray[np.bool_]:
        """Which rows (m, joints) of all moving joints are free."""
        free = np.ones(len(moving), dtype=np.bool_)
        free[[row for row, _ in self.collisions(moving)]] = False
        return free

    def gaps(self, moving: Array) -> tuple[list[tuple[str, str]], NDArray[np.float32]]:
        """Pairs (p) of bodies, and their distances (m, p) at least (m), by rows (m, joints)."""
        return list(map(self._named, self._active)), self._certificate.gaps(moving, self._apart)

    def distances(self, q: Array, fingers: Mapping[str, float], count: int) -> tuple[Array, Array]:
        """The smallest distances of pairs of bodies, to first order.

        Args:
            q: (m, n) rad.
            fingers: value (rad) of the finger joints by gripper.
            count: how many pairs per configuration.

        Returns:
            distances (m, count) in m, negative where bodies penetrate, and their gradients
            (m, count, n) in m/rad.
        """
        moving = self.moving_joints(q, fingers)
        least = self._certificate.gaps(moving, self._apart)
        return self._nearest.distances(self._coordinates(moving), self._active, least, count)

    def narrowest(
        self, moving: Array, enough: float, between_arms: bool = False
    ) -> tuple[float, int | None]:
        """The smallest distance (m) of two bodies in rows (m, joints) of all moving joints, and
        the row; ``enough`` and None where it is no less.

        Args:
            moving: the rows.
            enough: distance (m) above which nothing is of interest.
            between_arms: only between two arms that move, with what they carry.
        """
        pairs = self._of_two_arms() if between_arms else np.arange(len(self._apart))
        apart = self._apart[pairs]
        near = self._certificate.near(moving, apart, enough)
        unsure = np.flatnonzero(near.any(axis=1))
        coordinates = self._coordinates(moving[unsure])
        rows, places = near[unsure].nonzero()
        least = self._certificate.gaps(moving[unsure], apart)[rows, places]
        smallest, where = enough, None
        for number in np.argsort(least, kind="stable").tolist():
            if least[number] >= smallest:
                break
            row, pair = rows[number], self._active[pairs[places[number]]]
            if (distance := self._distance(coordinates[row], pair)) < smallest:
                smallest, where = distance, int(unsure[row])
        return smallest, where

    def _of_two_arms(self) -> NDArray[np.intp]:
        """Which of the pairs that are checked are of two arms, with what they carry."""
        assert self.entered is not None
        arm_of = np.zeros(len(self._names), dtype=int)
        for number, (gripper, shapes) in enumerate(self._arm.items(), start=1):
            arm_of[shapes] = number
            for box, (carrier, _) in self.entered.carried.items():
                arm_of[self._bodies[box] if carrier == gripper else []] = number
        one, other = arm_of[self._apart].T
        return np.flatnonzero((one != other) & (one > 0) & (other > 0))

    def _distance(self, coordinates: Array, pair: int) -> float:
        pin.updateGeometryPlacements(
            self._model, self._data, self._geometry, self._geometry_data, coordinates
        )
        found = pin.computeDistance(self._geometry, self._geometry_data, pair)
        return float(found.min_distance)

    def _coordinates(self, moving: Array) -> Array:
        """Coordinates of the pinocchio model (m, nq) for rows (m, joints) of all moving joints."""
        full = np.empty((len(moving), len(self._template)))
        full[:] = self._template
        full[:, self._plain_at] = moving[:, self._plain]
        angles = moving[:, self._turning]
        full[:, self._cosine_at], full[:, self._cosine_at + 1] = np.cos(angles), np.sin(angles)
        return full

    def _put(self, name: str, gripper: str | None, placement: Array) -> None:
        """Put a box at a pose (7,), in the world or in a tool frame, unless it is there."""
        place = gripper, placement.tobytes()
        if self._placed.get(name) == place:
            return
        self._placed[name] = place
        joint, tool = (0, pin.SE3.Identity()) if gripper is None else self._tool[gripper]
        (number,) = self._bodies[name]
        body = self._geometry.geometryObjects[number]
        body.parentJoint = joint
        body.placement = tool * pin.XYZQUATToSE3(placement)
        self._certificate.move(number, joint, body.placement.homogeneous)

    def _shapes(self, *links: str) -> list[int]:
        """The collision shapes of links; a link may have any number of them."""
        return [number for link in links for number in self._bodies.get(link, ())]

    def _tool_frame(self, arm: Arm) -> tuple[int, Any]:
        """The joint that a tool frame moves with, and its placement there."""
        frame = self._model.frames[self._model.getFrameId(arm.tool_link)]
        return frame.parentJoint, frame.placement * pin.XYZQUATToSE3(arm.tool_in_link)

    def _coordinate(self, joint: str) -> int:
        return int(self._model.joints[self._model.getJointId(joint)].idx_q)

    def _candidate_pairs(
        self, objects: int, disabled: frozenset[frozenset[str]]
    ) -> NDArray[np.bool_]:
        """Pairs that can ever be checked: not the SRDF's, nor bodies of one link."""
        joints = np.array([body.parentJoint for body in self._geometry.geometryObjects])
        pairs = joints[:, None] != joints[None, :]
        pairs[-objects:] = pairs[:, -objects:] = True
        named = [
            (first, second)
            for one, other in map(tuple, disabled)
            for first, second in product(self._shapes(one), self._shapes(other))
        ]
        first, second = np.array(named, dtype=int).reshape(-1, 2).T
        pairs[first, second] = pairs[second, first] = False
        return np.asarray(pairs)


def _stands(standing: Mapping[str, Box], first: str, second: str) -> bool:
    """Whether one of two bodies stands on the other."""
    pairs = (first, second), (second, first)
    return any(one in standing and standing[one].on == other for one, other in pairs)


@lru_cache(maxsize=1)
def checker_of(scene: Scene) -> CollisionChecker:
    """The checker of a scene, for planning and for certificates; kept for the last scene.

    Whoever uses it enters a planning scene first, unless the one it wants is ``entered``.
    """
    return CollisionChecker(scene)


@cache
def _coarse_to_fine(count: int) -> NDArray[np.intp]:
    """The numbers below ``count``: last, first, then halving the gaps (bit reversal)."""
    bits = max(count - 1, 1).bit_length()
    numbers = np.arange(1 << bits)
    mirrored = [((numbers >> bit) & 1) << (bits - 1 - bit) for bit in range(bits)]
    order = np.sum(mirrored, axis=0)
    order = order[order < count]
    return np.concatenate([[count - 1], order[order != count - 1]])
