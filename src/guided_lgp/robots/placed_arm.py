"""An arm of a robot that stands in a scene: its kinematics in the world."""

from collections.abc import Mapping
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from guided_lgp.poses import Array, rotation_matrix
from guided_lgp.robots.inverse import OffsetShoulder, inverse_kinematics, lengths_of
from guided_lgp.robots.robot import Robot

_VALUES = 15
"""Values of the redundant joint at which solutions are looked for."""
_TURN = 2 * np.pi


class Solver(Protocol):
    """All solutions of one arm in the frame of the robot's root, as in ``inverse/general.py``."""

    def inverse(
        self, rotation: Array, position: Array, redundancy: Array
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Branches q (..., branches, n) for tool poses, and which are valid."""
        ...

    def follow(self, q: Array, valid: NDArray[np.bool_], branch: int) -> Array | None:
        """One motion (steps, n) through the branches (steps, branches, n) of a path."""
        ...

    def forward(self, q: Array) -> tuple[Array, Array]:
        """Rotation (..., 3, 3) and origin (..., 3) of the tool frame."""
        ...

    def redundancies(self, count: int) -> Array:
        """Values (count,) of the redundant joint (rad) that are worth a try."""
        ...


class PlacedArm:
    """One arm. Poses are in the world; joints (..., n) in rad, from shoulder to wrist.

    The inverse kinematics has finitely many branches for a pose of the tool and, where the arm
    has a redundant joint, a value of that.
    """

    def __init__(self, robot: Robot, gripper: str, base: Array, fixed: Mapping[str, float]) -> None:
        """Place an arm.

        Args:
            robot: whose arm it is.
            gripper: which one.
            base: pose (7,) of the robot's root in the world.
            fixed: values (rad or m) of joints that stay as they are, by name.
        """
        self.arm = robot.arms[gripper]
        self.gripper = gripper
        self._origin, self._rotation = base[:3], rotation_matrix(base[3:])
        self._solver, centre, self._radius = _solver(robot, gripper, fixed)
        self._centre = self._origin + self._rotation @ centre

    @property
    def workspace(self) -> tuple[Array, Array]:
        """Lower and upper corner (3,) of a box that the tool's origin does not leave (m)."""
        return self._centre - self._radius, self._centre + self._radius

    @cached_property
    def redundancies(self) -> Array:
        """(m,) values (rad) of the redundant joint that are worth a try; zero if there is none."""
        return self._solver.redundancies(_VALUES)

    @cached_property
    def turning(self) -> NDArray[np.int64]:
        """The joints that have more than a turn, so that a posture has several values."""
        return np.flatnonzero(np.ptp(self.arm.limits, axis=1) > _TURN)

    def redundancy(self, q: Array) -> Array:
        """The value (...,) of the redundant joint; zero if there is none."""
        redundant = self.arm.redundant
        return np.zeros(q.shape[:-1]) if redundant is None else q[..., redundant]

    def inverse(
        self, rotation: Array, position: Array, redundancy: Array
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Solve for tool poses.

        Args:
            rotation: (..., 3, 3) of the tool frame.
            position: (..., 3) its origin (m).
            redundancy: (...,) value (rad) of the redundant joint, if there is one.

        Returns:
            q (..., branches, n) and valid (..., branches): the tool is there, within the limits.
        """
        local = (position - self._origin) @ self._rotation
        return self._solver.inverse(self._rotation.T @ rotation, local, redundancy)

    def follow(self, q: Array, valid: NDArray[np.bool_], branch: int) -> Array | None:
        """One motion (steps, n) through the branches of poses close to each other, or None.

        Args:
            q: (steps, branches, n).
            valid: (steps, branches).
            branch: on which it begins.
        """
        return self._solver.follow(q, valid, branch)

    def forward(self, q: Array) -> tuple[Array, Array]:
        """Rotation (..., 3, 3) and origin (..., 3) of the tool frame."""
        rotation, position = self._solver.forward(q)
        return self._rotation @ rotation, self._origin + position @ self._rotation.T

    def branch(self, q: Array) -> int:
        """The branch of the inverse kinematics on which joints (n,) are."""
        solutions, _ = self.inverse(*self.forward(q), self.redundancy(q))
        return int(np.argmin(np.abs(np.sin((solutions - q) / 2)).sum(axis=1)))

    def near(self, q: Array, reference: Array) -> Array:
        """Joints (..., n) by full turns next to a reference (n,)."""
        near, joints = q.copy(), self.turning
        turns = np.round((reference[..., joints] - q[..., joints]) / _TURN)
        near[..., joints] += _TURN * turns
        return near


def _solver(robot: Robot, gripper: str, fixed: Mapping[str, float]) -> tuple[Solver, Array, float]:
    """The solver of an arm; centre (3,) and radius (m) of a ball in which tools are looked for."""
    arm = robot.arms[gripper]
    if (lengths := lengths_of(robot, gripper)) is not None:
        limits = np.sort(arm.signs[:, None] * arm.limits, axis=1)
        lift = sum(fixed[name] for name in lengths.raised_by)
        solver = OffsetShoulder(lengths, limits, arm.signs, lift)
        return solver, solver.shoulder, float(arm.metric[1])
    general = inverse_kinematics(robot, gripper, fixed)
    return general, general.chain.points[1], float(arm.lever_arms[1])
