"""The two kinds of motion of one arm: free in joint space, or with a level hand."""

from collections.abc import Mapping

import numpy as np

from guided_lgp.bounds.path.collision import CollisionChecker
from guided_lgp.bounds.path.ik import REACH, Arm, continuous_near, unwrapped
from guided_lgp.bounds.results import Array
from guided_lgp.scene.pr2 import JOINT_LIMITS, arm_slice

STEP = 0.015
"""Largest motion (m), by the levers' bound, of any point between two checked configurations."""
_LEVEL_STEP = 0.007
"""The same for level motions, where the motion is known and not a bound."""
_JUMP = 0.35
"""Largest change (rad) of a joint in one step of a level motion or a straight line; beyond it the
inverse kinematics jumped."""


class JointSpace:
    """Points are the arm's joints (7,); the other arm stands still."""

    scale = REACH

    def __init__(
        self,
        checker: CollisionChecker,
        arm: Arm,
        q: Array,
        fingers: Mapping[str, float],
    ) -> None:
        """The checker's mode must be the one of the motion; ``q`` (14,) holds the other arm."""
        self._checker = checker
        self._q = q
        self._fingers = fingers
        self._joints = arm_slice(arm.gripper)
        limits = JOINT_LIMITS[self._joints].copy()
        limits[[4, 6]] = -np.pi, np.pi
        self.low, self.high = limits.T

    def path(self, start: Array, end: Array) -> Array:
        """Configurations of the arm (n, 7) along the line."""
        count = 2 + int(np.sum(np.abs(end - start) * REACH) / STEP)
        return np.asarray(np.linspace(start, end, count))

    def free(self, start: Array, end: Array) -> bool:
        """Whether the line is free of collisions."""
        return self.collision(self.path(start, end)) is None

    def collision(self, path: Array) -> tuple[str, str] | None:
        """The first pair of bodies in collision along configurations (n, 7) of the arm."""
        return self._checker.first_collision(self._whole(path), self._fingers)

    def distances(self, path: Array, count: int) -> tuple[Array, Array]:
        """The smallest distances (n, count) of bodies along a path (n, 7), and gradients."""
        values, gradients = self._checker.distances(self._whole(path), self._fingers, count)
        return values, gradients[..., self._joints]

    def _whole(self, path: Array) -> Array:
        q = np.tile(self._q, (len(path), 1))
        q[:, self._joints] = path
        return q


class LevelSpace:
    """Points are tool position (m), yaw about the vertical and pan angle (rad): (5,).

    The hand keeps its tilt: what it holds stays level. One side of the elbow throughout.
    """

    scale = np.array([1.5, 1.5, 1.5, 0.3, 0.5])

    def __init__(self, joints: JointSpace, arm: Arm, rotation: Array, side: int) -> None:
        """``rotation`` (3, 3) of the tool at yaw zero; ``side`` of the elbow."""
        self._joints = joints
        self._arm = arm
        self._rotation = rotation
        self._side = side
        pan = JOINT_LIMITS[arm_slice(arm.gripper)][0]
        self.low = np.array([*(arm.shoulder - 0.9), -np.pi, pan[0]])
        self.high = np.array([*(arm.shoulder + 0.9), np.pi, pan[1]])

    def path(self, start: Array, end: Array) -> Array | None:
        """Configurations of the arm (n, 7) along the line, or None out of reach."""
        count = 2 + int(np.sum(np.abs(end - start) * (1, 1, 1, 0.25, 0.5)) / _LEVEL_STEP)
        points = np.linspace(start, end, count)
        rotation = turned(self._rotation, points[:, 3])
        q, valid = self._arm.inverse(rotation, points[:, :3], points[:, 4])
        return continuous_path(q[:, self._side], valid[:, self._side])

    def free(self, start: Array, end: Array) -> bool:
        """Whether the line is within reach and free of collisions."""
        path = self.path(start, end)
        return path is not None and self._joints.collision(path) is None


def continuous_path(q: Array, valid: Array) -> Array | None:
    """The solutions (n, 7) as one motion, or None where one is missing or jumps."""
    if not valid.all():
        return None
    path = unwrapped(q)
    if np.abs(np.diff(path, axis=0)).max(initial=0.0) > _JUMP:
        return None
    return path


def turned(rotation: Array, yaw: Array) -> Array:
    """Rotations (n, 3, 3) of a body turned about the vertical by angles (n,)."""
    c, s, zero, one = np.cos(yaw), np.sin(yaw), np.zeros_like(yaw), np.ones_like(yaw)
    turn = np.stack([c, -s, zero, s, c, zero, zero, zero, one], axis=-1).reshape(-1, 3, 3)
    return np.asarray(turn @ rotation)


def wound(path: Array, start: Array) -> Array:
    """A motion (n, 7) with its continuous joints turned to begin next to ``start`` (7,)."""
    first = continuous_near(path[0], start)
    return np.asarray(path + (first - path[0]))
