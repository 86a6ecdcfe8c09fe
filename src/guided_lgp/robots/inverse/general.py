"""Inverse kinematics of any arm of six or seven joints, for many tool poses at once.

A seventh joint is redundant: its value is given, and six remain. Most arms that are built have
one of three structures, which make six joints solvable in closed form (Pieper 1968): the last
three axes meet in a point, the first three do, or the second to fourth are parallel. An arm that
has one of them nearly (a wrist with an offset of a centimetre) is solved as if it had it, and
Newton's method closes the gap; one that has none is solved by Newton's method from fixed starts.
"""

from collections.abc import Mapping
from functools import cache

import numpy as np
from numpy.typing import NDArray

from guided_lgp.poses import rotation_matrix
from guided_lgp.robots.chain import Array, Chain, read_chain
from guided_lgp.robots.inverse.solvers import EXACT, Problem, best_solver, free_screws
from guided_lgp.robots.inverse.structures import Structure, closest
from guided_lgp.robots.robot import Robot

_NEARLY = 0.05
"""Largest misfit (m, or sine of an angle) of a structure that is used as a first guess."""
_STARTS = 24
"""Fixed starts of Newton's method for arms without structure."""
_JUMP = 0.35
"""Largest change (rad) of a joint from one pose of a path to the next."""
_TURN = 2 * np.pi


class InverseKinematics:
    """All solutions of one arm; the same pose gives the same solutions in the same order."""

    def __init__(
        self, chain: Chain, limits: Array, redundant: int | None = None, home: Array | None = None
    ) -> None:
        """Prepare an arm.

        Args:
            chain: six turning joints, or seven with a redundant one.
            limits: (n, 2) rad; infinite for joints that turn without end.
            redundant: index of the joint whose value is given with every pose.
            home: (n,) rad; whole turns are added to a solution to be near it. Default: zero.
        """
        if len(chain) != 6 + (redundant is not None):
            raise ValueError(f"{len(chain)} joints with redundant joint {redundant}")
        self.chain = chain
        self.problem = _problem(chain, limits, redundant)
        self._limits = limits
        self._home = np.zeros(len(chain)) if home is None else home
        self._solver = best_solver(self.problem)

    def inverse(
        self, rotation: Array, position: Array, redundancy: Array | float = 0.0
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Solve for tool poses.

        Args:
            rotation: (..., 3, 3) of the tool frame, in the frame of the chain.
            position: (..., 3) its origin (m).
            redundancy: (...,) value (rad) of the redundant joint, if there is one.

        Returns:
            q (..., branches, n) in rad and valid (..., branches): the tool is there and all joints
            are within their limits.
        """
        q, missing = self.nearest(rotation, position, redundancy)
        inside = np.all((q >= self._limits[:, 0]) & (q <= self._limits[:, 1]), axis=-1)
        return q, inside & (missing < EXACT)

    def nearest(
        self, rotation: Array, position: Array, redundancy: Array | float = 0.0
    ) -> tuple[Array, Array]:
        """Like :meth:`inverse`, but the nearest values where there is no solution.

        Returns:
            q (..., branches, n) in rad, perhaps beyond limits, and missing (..., branches): how far
            (m, rad) the tool is from its pose.
        """
        value = np.asarray(redundancy, float)
        shape = np.broadcast_shapes(rotation.shape[:-2], position.shape[:-1], value.shape)
        rotation = np.broadcast_to(rotation, (*shape, 3, 3)).reshape(-1, 3, 3)
        position = np.broadcast_to(position, (*shape, 3)).reshape(-1, 3)
        q, missing = self._solver(rotation, position, np.broadcast_to(value, shape).ravel())
        q = self._within_turns(q)
        return q.reshape(*shape, *q.shape[1:]), missing.reshape(*shape, q.shape[1])

    def follow(self, q: Array, valid: NDArray[np.bool_], branch: int) -> Array | None:
        """The solutions along a path as one motion that begins on a branch.

        Args:
            q: (steps, branches, n) from :meth:`inverse`, for poses close to each other.
            valid: (steps, branches).
            branch: where the motion begins.

        Returns:
            Configurations (steps, n) in rad, or None where the branch ends.
        """
        if not valid[0, branch]:
            return None
        low, high = self._limits.T
        path = [q[0, branch]]
        for solutions, reached in zip(q[1:], valid[1:], strict=True):
            near = solutions + _TURN * np.round((path[-1] - solutions) / _TURN)
            inside = np.all((near >= low) & (near <= high), axis=1)
            jump = np.where(reached & inside, np.abs(near - path[-1]).max(axis=1), np.inf)
            nearest = int(np.argmin(jump))
            if jump[nearest] > _JUMP:
                return None
            path.append(near[nearest])
        return np.array(path)

    def redundancies(self, count: int) -> Array:
        """Values (rad) of the redundant joint over its range; one zero where there is none."""
        if self.problem.redundant is None:
            return np.zeros(1)
        low, high = np.clip(self._limits[self.problem.redundant], -np.pi, np.pi)
        return np.linspace(low, high, count + 2)[1:-1]

    def forward(self, q: Array) -> tuple[Array, Array]:
        """Rotation (..., 3, 3) and origin (..., 3) of the tool frame for joints (..., n)."""
        return self.chain.forward(q)

    def _within_turns(self, q: Array) -> Array:
        """Whole turns added, so that joints are near the home posture and within their limits."""
        q = q + _TURN * np.round((self._home - q) / _TURN)
        low, high = self._limits.T
        q = q + np.where(q < low, _TURN, 0.0)
        return np.asarray(q - np.where((q > high) & (q - _TURN >= low), _TURN, 0.0))


def inverse_kinematics(robot: Robot, gripper: str, fixed: Mapping[str, float]) -> InverseKinematics:
    """The solver of a robot's arm, in the frame of its base link.

    Args:
        robot: whose arm it is.
        gripper: which one.
        fixed: values (rad or m) of the joints that the scene sets, by name.
    """
    return _solver(robot, gripper, tuple(sorted(fixed.items())))


@cache
def _solver(robot: Robot, gripper: str, fixed: tuple[tuple[str, float], ...]) -> InverseKinematics:
    arm = robot.arms[gripper]
    chain = read_chain(robot.urdf, robot.base_link, arm.tool_link, arm.joints, dict(fixed))
    chain = chain.extended(rotation_matrix(arm.tool_in_link[3:]), arm.tool_in_link[:3])
    return InverseKinematics(chain, arm.limits, arm.redundant, arm.home)


def _problem(chain: Chain, limits: Array, redundant: int | None) -> Problem:
    structure = _structure(chain, redundant)
    free = [i for i in range(len(chain)) if i != redundant]
    low, high = np.clip(limits[free], -np.pi, np.pi).T
    starts = np.random.default_rng(0).uniform(low, high, (_STARTS, 6))
    if structure.misfit < _NEARLY:
        return Problem(chain, redundant, structure, starts, 1e-3 + 40 * structure.misfit, 10)
    return Problem(chain, redundant, None, starts, np.inf, 40)


def _structure(chain: Chain, redundant: int | None) -> Structure:
    """What the six free joints come closest to, with the redundant one at zero."""
    axes, points, _, _ = free_screws(chain, redundant, np.eye(3), np.zeros(3), np.zeros(()))
    return closest(axes, points)
