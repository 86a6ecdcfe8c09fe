"""Collision checks for planning: convex hulls of the robot's meshes, boxes and tables, in coal.

The hulls are those that PyBullet makes of the same files, so that its verdict at the end agrees.
A check takes about 10 us: forward kinematics, bounding boxes of all bodies, then exact tests. What
is certified as free needs none.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, lru_cache
from itertools import product
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from guided_lgp.bounds.collision.certificate import Certificate
from guided_lgp.bounds.collision.shapes import convex_shape, robot_shapes
from guided_lgp.bounds.results import Array
from guided_lgp.poses import IDENTITY
from guided_lgp.robots import Arm
from guided_lgp.scene import Box, Scene

PADDING = 0.003
"""Distance (m) that everything keeps from everything, declared contacts apart."""
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


class CollisionChecker:
    """Checks configurations of the robot in one scene; a planning scene says which move."""

    def __init__(self, scene: Scene) -> None:
        robot = self._robot = scene.robot.description
        self._model = pin.buildModelFromUrdf(str(robot.urdf))
        base = pin.XYZQUATToSE3(scene.robot.base_pose)
        self._geometry = pin.GeometryModel()
        self._names: list[str] = []
        for body, shape in robot_shapes(robot.urdf):
            placement = base * body.placement if body.parentJoint == 0 else body.placement
            self._add(body.name[: body.name.rindex("_")], body.parentJoint, placement, shape)
        for joint in range(1, self._model.njoints):
            if self._model.parents[joint] == 0:
                self._model.jointPlacements[joint] = base * self._model.jointPlacements[joint]
        for body in (*scene.in_the_way, *scene.supports):
            self._add(body.name, 0, pin.XYZQUATToSE3(body.placement), convex_shape(body.convex))
        for box in scene.movable:
            self._add(box.name, 0, pin.XYZQUATToSE3(IDENTITY), convex_shape(box.convex))
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
        shapes = [body.geometry for body in self._geometry.geometryObjects]
        for shape in shapes:
            shape.computeLocalAABB()
        self._centres = [np.array(shape.aabb_center) for shape in shapes]
        self._radii = np.array([shape.aabb_radius for shape in shapes])
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
        self._pattern: _Pattern | None = None
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
        at = np.array([self._coordinate(joint) for joint in robot.joint_names])
        self._turning = np.array(robot.continuous, dtype=int)
        self._plain = np.setdiff1d(np.arange(len(at)), self._turning)
        self._plain_at, self._cosine_at = at[self._plain], at[self._turning]
        self._velocity_at = [
            int(self._model.joints[self._model.getJointId(joint)].idx_v)
            for joint in robot.joint_names
        ]
        self._certificate = Certificate(
            self._model, self._template, self._geometry, robot.moving_joints
        )
        self._yield_where_near(scene)
        self._moving = len(robot.moving_joints)
        self._fingers = {gripper: arm.fingers for gripper, arm in robot.arms.items()}
        self._finger_at = {
            gripper: np.array([self._coordinate(joint) for joint in fingers.joints], dtype=int)
            for gripper, fingers in self._fingers.items()
        }

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
            active, self._active, self._apart = self._patterns[pattern]
            self._geometry_data.setActiveCollisionPairs(self._geometry, active, True)

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

    def coordinates(self, q: Array, fingers: Mapping[str, float]) -> Array:
        """Coordinates of the pinocchio model (m, nq) for configurations (m, n)."""
        full = np.empty((len(q), len(self._template)))
        full[:] = self._template
        full[:, self._plain_at] = q[:, self._plain]
        angles = q[:, self._turning]
        full[:, self._cosine_at] = np.cos(angles)
        full[:, self._cosine_at + 1] = np.sin(angles)
        for gripper, value in fingers.items():
            full[:, self._finger_at[gripper]] = value * self._fingers[gripper].ratios
        return full

    def first_collision(self, q: Array, fingers: Mapping[str, float]) -> tuple[str, str] | None:
        """The first pair of bodies found in collision along configurations (m, n), if any.

        The configurations are visited from coarse to fine: ends, middle, quarters, …
        """
        self.queries += 1
        rows = np.array(_coarse_to_fine(len(q)))
        if len(rows) > _FEW:
            rows = rows[~self.certified(self.moving_joints(q[rows], fingers))]
        coordinates = self.coordinates(q, fingers)
        found = (self._collision(coordinates[row]) for row in rows)
        return next(filter(None, found), None)

    def _collision(self, coordinates: Array) -> tuple[str, str] | None:
        if not pin.computeCollisions(
            self._model, self._data, self._broad, self._callback, coordinates
        ):
            return None
        pair = self._geometry.collisionPairs[self._callback.collisionPairIndex]
        return self._names[pair.first], self._names[pair.second]

    def certified(self, moving: Array) -> NDArray[np.bool_]:
        """Which rows (m, joints) of all moving joints are surely free; see :class:`Certificate`."""
        return self._certificate.free(moving, self._apart, PADDING)

    def free(self, moving: Array) -> NDArray[np.bool_]:
        """Which rows (m, joints) of all moving joints are free; coal decides what is not sure."""
        free = self.certified(moving)
        unsure = np.flatnonzero(~free)
        coordinates = self.coordinates(moving[unsure, : len(self._robot.joint_names)], {})
        for gripper, hand in self._fingers.items():
            values = moving[unsure, hand.slice][:, :1] / hand.ratios[:1]  # none of fixed jaws
            coordinates[:, self._finger_at[gripper]] = values * hand.ratios
        free[unsure] = [self._collision(row) is None for row in coordinates]
        return free

    def moving_joints(self, q: Array, fingers: Mapping[str, float]) -> Array:
        """Rows (m, joints) of all moving joints for configurations (m, n)."""
        moving = np.empty((len(q), self._moving))
        moving[:, : q.shape[1]] = q
        for gripper, hand in self._fingers.items():
            moving[:, hand.slice] = fingers.get(gripper, 0.0) * hand.ratios
        return moving

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
        values, gradients = np.empty((len(q), count)), np.empty((len(q), count, q.shape[1]))
        for row, coordinates in enumerate(self.coordinates(q, fingers)):
            pin.computeJointJacobians(self._model, self._data, coordinates)
            pin.updateGeometryPlacements(
                self._model, self._data, self._geometry, self._geometry_data
            )
            for column, (distance, pair) in enumerate(self._nearest(count)):
                values[row, column] = distance
                gradients[row, column] = self._gradient(pair)
        return values, gradients

    def _nearest(self, count: int) -> list[tuple[float, int]]:
        """Distance and number of the nearest pairs, of those whose spheres are near enough."""
        spheres = zip(self._geometry_data.oMg, self._centres, strict=True)
        centres = np.array([placement.act(centre) for placement, centre in spheres])
        first, second = self._apart.T
        between = np.linalg.norm(centres[first] - centres[second], axis=1)
        least = (between - self._radii[first] - self._radii[second]).tolist()
        found: list[tuple[float, int]] = []
        for place in np.argsort(least, kind="stable"):
            if len(found) >= count and least[place] > found[count - 1][0]:
                break
            pair = self._active[place]
            result = pin.computeDistance(self._geometry, self._geometry_data, pair)
            found = sorted([*found, (result.min_distance, pair)])
        return found[:count]

    def _gradient(self, pair: int) -> Array:
        """Derivative (n,) of the distance of a pair of bodies, at their nearest points."""
        result = self._geometry_data.distanceResults[pair]
        bodies = self._geometry.collisionPairs[pair]
        rates = []
        for body, point in (
            (bodies.first, result.getNearestPoint1()),
            (bodies.second, result.getNearestPoint2()),
        ):
            joint = self._geometry.geometryObjects[body].parentJoint
            jacobian = pin.getJointJacobian(
                self._model, self._data, joint, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            )[:, self._velocity_at]
            arm = pin.skew(point - self._data.oMi[joint].translation) @ result.normal
            rates.append(result.normal @ jacobian[:3] + arm @ jacobian[3:])
        return np.asarray(rates[1] - rates[0])

    def _add(self, name: str, joint: int, placement: Any, shape: Any) -> None:
        self._geometry.addGeometryObject(pin.GeometryObject(name, joint, placement, shape))
        self._names.append(name)

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
def _coarse_to_fine(count: int) -> tuple[int, ...]:
    """The numbers below ``count``: last, first, then halving the gaps (bit reversal)."""
    bits = max(count - 1, 1).bit_length()
    reversed_ = (int(f"{i:0{bits}b}"[::-1], 2) for i in range(1 << bits))
    return tuple(dict.fromkeys([count - 1, *(i for i in reversed_ if i < count)]))
