"""Motions of one arm while everything else stands still: transits and straight lines."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np

from guided_lgp.bounds.checks import body_names, overlap_name
from guided_lgp.bounds.collision import PADDING, PlanningScene, checker_of
from guided_lgp.bounds.deadline import NEVER, Deadline
from guided_lgp.bounds.path.connect import connect, shortcut
from guided_lgp.bounds.path.spaces import (
    JointSpace,
    LevelSpace,
    turned,
    wound,
)
from guided_lgp.bounds.path.timing import time_path
from guided_lgp.bounds.results import Array
from guided_lgp.robots import Arm, PlacedArm
from guided_lgp.scene import Scene

LINE_STEP = 0.01
"""Distance (m) of configurations along a straight line."""
_ASTRAY = 0.001
"""How far (m, tenths of rad) the tool may leave a straight line between two configurations."""
_ROUNDINGS = (0.35, 0.1)
"""Shares of a corner's edges that its rounding may take."""
_SHORTCUTS = 12
"""Random shortcuts tried on a path of the sampling planner."""


Pair = tuple[str, str]
"""Two bodies in collision."""


@dataclass(frozen=True)
class Surroundings:
    """What stands still while one arm moves: the bodies, the other arms, the fingers."""

    scene: PlanningScene
    q: Array
    """Configuration (n,); the moving arm's part does not matter."""
    fingers: Mapping[str, float]
    """Value (rad) of the finger joints by gripper."""


@dataclass(frozen=True)
class Transit:
    """What a motion has to do that only leads somewhere: keep clear of its surroundings."""

    surroundings: Surroundings
    keep_level: bool
    """Whether the hand keeps its tilt."""


@dataclass(frozen=True)
class Tool:
    """Where the tool of an arm is, and how the arm gets it there."""

    rotation: Array
    """(3, 3)"""
    position: Array
    """(3,) of the frame's origin (m)."""
    redundancy: float
    """Value of the redundant joint (rad)."""
    branch: int
    """Of the inverse kinematics."""


@dataclass(frozen=True)
class Motion:
    """One arm follows a path from rest to rest."""

    arm: Arm
    path: Array
    """Configurations (m, n) in rad, for a cubic spline through them."""
    transit: Transit | None = None
    """None for a straight line, which is where it has to be."""

    @property
    def gripper(self) -> str:
        """Whose arm it is."""
        return self.arm.gripper

    @cached_property
    def timed(self) -> tuple[Array, Array]:
        """Times (T,) in s and configurations (T, n)."""
        return time_path(self.path, self.arm)


class Mover:
    """Plans motions in one scene. Deterministic: every call brings its source of randomness."""

    def __init__(
        self,
        scene: Scene,
        iterations: int,
        deadline: Deadline = NEVER,
        clearance: float = PADDING,
    ) -> None:
        """Prepare for one scene.

        Args:
            scene: the initial configuration.
            iterations: samples of the sampling planner per motion.
            deadline: after which there are no more motions.
            clearance: distance (m) that optimised motions keep where there is room; all keep
                ``PADDING``.
        """
        self.clearance = clearance
        base, fixed = scene.robot.base_pose, scene.robot.fixed_values
        self.robot = scene.robot.description
        self.arms = {g: PlacedArm(self.robot, g, base, fixed) for g in self.robot.grippers}
        self._bodies = body_names(scene)
        self._gripper_of = {
            link: gripper
            for gripper, arm in self.robot.arms.items()
            for link in (*arm.links, *arm.hand_links)
        }
        self._checker = checker_of(scene)
        self._entered: tuple[Surroundings, JointSpace] | None = None
        self._iterations = iterations
        self._deadline = deadline

    def name_of(self, pair: tuple[str, str]) -> str:
        """The constraint that two bodies in collision violate."""
        return overlap_name(*pair, self._bodies)

    def symbol_of(self, name: str) -> str:
        """The gripper of a link's arm; any other body itself."""
        return self._gripper_of.get(name, name)

    @property
    def queries(self) -> int:
        """Collision queries so far: the measure of effort."""
        return self._checker.queries

    def count(self) -> None:
        """Count a query that :meth:`collisions` has answered before."""
        self._checker.queries += 1

    def collision(self, surroundings: Surroundings, q: Array) -> Pair | None:
        """The first pair of bodies in collision along configurations (m, n) of the moving arm."""
        return self._space(surroundings).collision(q)

    def collisions(self, surroundings: Surroundings, q: Array) -> list[Pair | None]:
        """The first pair in each of some configurations (m, n); these queries are not counted."""
        return self._space(surroundings).collisions(q)

    def room(self, surroundings: Surroundings, q: Array, enough: float) -> float:
        """The smallest distance (m) along free configurations (m, n) of the moving arm, or
        ``enough`` if it is more.
        """
        if enough <= PADDING:
            return enough
        return self._space(surroundings).room(q, enough)

    def distances(self, surroundings: Surroundings, q: Array, count: int) -> tuple[Array, Array]:
        """Smallest distances (m, count) in m along configurations (m, n) of the moving arm, and
        their gradients (m, count, n).
        """
        return self._space(surroundings).distances(q, count)

    def line(self, surroundings: Surroundings, tool: Tool, direction: Array) -> Array | Pair | None:
        """A free straight line on which the redundant joint stays; see :meth:`lines`."""
        return next(self.lines(surroundings, tool, direction, (0.0,)))

    def lines(
        self, surroundings: Surroundings, tool: Tool, direction: Array, shifts: Sequence[float]
    ) -> Iterator[Array | Pair | None]:
        """Free straight lines of the tool, which does not turn.

        As a rule the first one is, and nobody asks for the others: these are solved at once.

        Args:
            surroundings: what stands still.
            tool: at the start.
            direction: displacement (3,) of the tool (m).
            shifts: turns of the redundant joint (rad) on the way, for a line each.

        Yields:
            Configurations (m, n); or two bodies in collision; or None, it is out of reach.
        """
        arm = self.arms[surroundings.scene.gripper]
        count = 2 + int(np.linalg.norm(direction) / LINE_STEP)
        position = tool.position + np.linspace(0.0, 1.0, count)[:, None] * direction
        for together in filter(len, (shifts[:1], shifts[1:])):
            ends = tool.redundancy + np.array(together)
            redundancies = np.linspace(tool.redundancy, ends, count, axis=1)
            solved = arm.inverse(tool.rotation, position, redundancies)
            for q, valid in zip(*solved, strict=True):
                path = arm.follow(q, valid, tool.branch)
                yield None if path is None else self._checked(surroundings, tool, position, path)

    def _checked(
        self, surroundings: Surroundings, tool: Tool, position: Array, path: Array
    ) -> Array | Pair | None:
        """A path (m, n) of an arm if its tool follows positions (m, 3), else as :meth:`lines`."""
        arm = self.arms[surroundings.scene.gripper]
        rotation, middle = arm.forward((path[:-1] + path[1:]) / 2)
        astray = np.abs(middle - (position[:-1] + position[1:]) / 2).max()
        turned_by = np.abs(rotation - tool.rotation).max()
        if astray > _ASTRAY or turned_by > 10 * _ASTRAY:
            return None
        return self.collision(surroundings, path) or path

    def transit(
        self, surroundings: Surroundings, start: Array, goal: Array, rng: np.random.Generator
    ) -> list[Array] | None:
        """A free motion in joint space: the direct line, or else RRT-Connect and shortcuts.

        Returns:
            Paths (m, n) with a rest between two of them, or None.
        """
        space = self._space(surroundings)
        points = connect(space, start, goal, rng, self._iterations)
        if points is None:
            return None
        if len(points) > 2:
            points = shortcut(space, points, rng, _SHORTCUTS)
        return _rounded(space, points)

    def level_transit(
        self, surroundings: Surroundings, start: Array, goal: Array, rng: np.random.Generator
    ) -> list[Array] | None:
        """A free motion on which the hand keeps its tilt: what it holds stays level.

        Both ends must be on one branch of the inverse kinematics, and the hand at the same tilt.
        """
        arm = self.arms[surroundings.scene.gripper]
        rotation, position = arm.forward(np.stack([start, goal]))
        turn = rotation[1] @ rotation[0].T
        yaw = float(np.arctan2(turn[1, 0], turn[0, 0]))
        if not np.allclose(turned(rotation[0], np.array([yaw]))[0], rotation[1], atol=1e-6):
            return None
        branch = arm.branch(start)
        if arm.branch(goal) != branch:
            return None
        space = LevelSpace(self._space(surroundings), arm, rotation[0], branch)
        free = arm.redundancy(np.stack([start, goal]))
        ends = np.array([[*position[0], 0.0, free[0]], [*position[1], yaw, free[1]]])
        points = connect(space, ends[0], ends[1], rng, self._iterations)
        if points is None:
            return None
        if len(points) > 2:
            points = shortcut(space, points, rng, _SHORTCUTS)
        paths: list[Array] = []
        for first, last in pairwise(points):
            path = space.path(first, last)
            assert path is not None  # the planner has followed it
            paths.append(wound(path, arm, start if not paths else paths[-1][-1]))
        return paths

    def tool(self, gripper: str, q: Array) -> Tool:
        """Where the tool is for joints (n,)."""
        arm = self.arms[gripper]
        return Tool(*arm.forward(q), float(arm.redundancy(q)), arm.branch(q))

    def _space(self, surroundings: Surroundings) -> JointSpace:
        """The space of a motion; the checker is there already if it was the last one asked for."""
        self._deadline.check()
        if self._checker.entered is not surroundings.scene:
            self._checker.enter(surroundings.scene)
        if self._entered is None or self._entered[0] is not surroundings:
            arm = self.arms[surroundings.scene.gripper]
            space = JointSpace(self._checker, arm, surroundings.q, surroundings.fingers)
            self._entered = surroundings, space
        return self._entered[1]


def _rounded(space: JointSpace, points: list[Array]) -> list[Array]:
    """The polyline as smooth paths: corners become parabolas where these are free.

    A corner that cannot be rounded becomes a rest.
    """
    paths: list[Array] = []
    path = [points[0]]
    for before, corner, after in zip(points, points[1:], points[2:], strict=False):
        for share in _ROUNDINGS:
            begin, end = (
                corner + share * (before - corner),
                corner + share * (after - corner),
            )
            t = np.linspace(0.0, 1.0, 9)[:, None]
            curve = (1 - t) ** 2 * begin + 2 * t * (1 - t) * corner + t**2 * end
            if space.collision(curve) is None:
                path += [*space.path(path[-1], begin)[1::2], *curve]
                break
        else:
            paths.append(np.array([*path, *space.path(path[-1], corner)[1:]]))
            path = [corner]
    return [*paths, np.array([*path, *space.path(path[-1], points[-1])[1:]])]
