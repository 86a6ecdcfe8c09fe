"""The two kinds of motion of one arm: free in joint space, or with a level hand."""

from collections.abc import Mapping

import numpy as np

from guided_lgp.bounds.collision import CollisionChecker
from guided_lgp.bounds.results import Array
from guided_lgp.robots import PlacedArm

STEP = 0.015
"""Largest motion (m), by the levers' bound, of any point between two checked configurations."""
_LEVEL_STEP = 0.007
"""The same for level motions, where the motion is known and not a bound."""


_SAME = 1e-6
"""Difference (sine of half an angle) of two solutions that are the same."""


class JointSpace:
    """Points are the arm's joints (n,); the other arms stand still."""

    def __init__(
        self,
        checker: CollisionChecker,
        arm: PlacedArm,
        q: Array,
        fingers: Mapping[str, float],
    ) -> None:
        """The checker must have entered the scene of the motion; ``q`` holds the other arms."""
        self._checker = checker
        self._q = q
        self._fingers = fingers
        self._joints = arm.arm.slice
        self.scale = arm.arm.metric
        limits = arm.arm.limits.copy()
        limits[arm.turning] = -np.pi, np.pi
        self.low, self.high = limits.T

    def path(self, start: Array, end: Array) -> Array:
        """Configurations of the arm (m, n) along the line."""
        count = 2 + int(np.sum(np.abs(end - start) * self.scale) / STEP)
        return np.asarray(np.linspace(start, end, count))

    def free(self, start: Array, end: Array) -> bool:
        """Whether the line is free of collisions."""
        return self.collision(self.path(start, end)) is None

    def collision(self, path: Array) -> tuple[str, str] | None:
        """The first pair of bodies in collision along configurations (m, n) of the arm."""
        return self._checker.first_collision(self._whole(path), self._fingers)

    def collisions(self, path: Array) -> list[tuple[str, str] | None]:
        """The first pair in each of some configurations (m, n)."""
        moving = self._checker.moving_joints(self._whole(path), self._fingers)
        found = dict(self._checker.collisions(moving))
        return [found.get(row) for row in range(len(path))]

    def distances(self, path: Array, count: int) -> tuple[Array, Array]:
        """The smallest distances (n, count) of bodies along a path (m, n), and gradients."""
        values, gradients = self._checker.distances(self._whole(path), self._fingers, count)
        return values, gradients[..., self._joints]

    def room(self, path: Array, enough: float) -> float:
        """The smallest distance (m) along a path (m, n), or ``enough`` if it is more."""
        moving = self._checker.moving_joints(self._whole(path), self._fingers)
        return self._checker.narrowest(moving, enough)[0]

    def _whole(self, path: Array) -> Array:
        q = np.empty((len(path), len(self._q)))
        q[:] = self._q
        q[:, self._joints] = path
        return q


class LevelSpace:
    """Points are tool position (m), yaw about the vertical and redundant joint (rad): (5,).

    The hand keeps its tilt: what it holds stays level. One branch of the inverse kinematics
    throughout. The last coordinate does nothing where no joint is redundant.
    """

    scale = np.array([1.5, 1.5, 1.5, 0.3, 0.5])

    def __init__(self, joints: JointSpace, arm: PlacedArm, rotation: Array, branch: int) -> None:
        """``rotation`` (3, 3) of the tool at yaw zero; ``branch`` of the inverse kinematics."""
        self._joints = joints
        self._arm = arm
        self._rotation = rotation
        self._branch = branch
        low, high = arm.workspace
        redundant = arm.arm.redundant
        free = (0.0, 0.0) if redundant is None else arm.arm.limits[redundant]
        self.low = np.array([*low, -np.pi, free[0]])
        self.high = np.array([*high, np.pi, free[1]])

    def path(self, start: Array, end: Array) -> Array | None:
        """Configurations of the arm (m, n) along the line, or None out of reach."""
        count = 2 + int(np.sum(np.abs(end - start) * (1, 1, 1, 0.25, 0.5)) / _LEVEL_STEP)
        points = np.linspace(start, end, count)
        rotation = turned(self._rotation, points[:, 3])
        q, valid = self._arm.inverse(rotation, points[:, :3], points[:, 4])
        path = self._arm.follow(q, valid, self._branch)
        if path is None or np.abs(np.sin((path[-1] - q[-1, self._branch]) / 2)).max() > _SAME:
            return None
        return path

    def free(self, start: Array, end: Array) -> bool:
        """Whether the line is within reach and free of collisions."""
        path = self.path(start, end)
        return path is not None and self._joints.collision(path) is None


def turned(rotation: Array, yaw: Array) -> Array:
    """Rotations (n, 3, 3) of a body turned about the vertical by angles (n,)."""
    c, s, zero, one = np.cos(yaw), np.sin(yaw), np.zeros_like(yaw), np.ones_like(yaw)
    turn = np.stack([c, -s, zero, s, c, zero, zero, zero, one], axis=-1).reshape(-1, 3, 3)
    return np.asarray(turn @ rotation)


def wound(path: Array, arm: PlacedArm, start: Array) -> Array:
    """A motion (m, n) with joints turned by full turns to begin next to ``start`` (n,)."""
    first = arm.near(path[0], start)
    return np.asarray(path + (first - path[0]))
