"""Inverse kinematics of any arm of six or seven joints, for many tool poses at once.

A seventh joint is redundant: its value is given, and six remain. Most arms that are built have
one of three structures, which make six joints solvable in closed form (Pieper 1968): the last
three axes meet in a point, the first three do, or the second to fourth are parallel. An arm that
has one of them nearly (a wrist with an offset of a centimetre) is solved as if it had it, and
Newton's method closes the gap; one that has none is solved by Newton's method from fixed starts.
"""

import numpy as np
from numpy.typing import NDArray

from guided_lgp.robots import subproblems as sub
from guided_lgp.robots.chain import Array, Chain, turn
from guided_lgp.robots.structures import Guess, closest

_EXACT = 1e-8
"""Error (m, rad) up to which a solution counts as one."""
_NEARLY = 0.05
"""Largest misfit (m, or sine of an angle) of a structure that is used as a first guess."""
_STARTS = 24
"""Fixed starts of Newton's method for arms without structure."""
_DAMPING = 0.01
"""Of the squared singular values, for an error of one; it vanishes with the error."""
_LONGEST_STEP = 0.7
"""Of a joint in one iteration (rad)."""
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
        self._limits = limits
        self._redundant = redundant
        self._home = np.zeros(len(chain)) if home is None else home
        self._free = [i for i in range(len(chain)) if i != redundant]
        axes, points, _, _ = self._six(np.eye(3), np.zeros(3), np.zeros(()))
        structure = closest(axes, points)
        self.misfit = structure.misfit
        """How far (m, rad) the arm is from a structure that is solved in closed form."""
        nearly = structure.misfit < _NEARLY
        self._guess = structure.guess if nearly else _fixed_starts(limits[self._free])
        self._capture = 1e-3 + 40 * structure.misfit if nearly else np.inf
        self._iterations = 10 if nearly else 40

    def inverse(
        self, rotation: Array, position: Array, redundancy: Array | float = 0.0
    ) -> tuple[Array, Array]:
        """Solve for tool poses.

        Args:
            rotation: (..., 3, 3) of the tool frame, in the frame of the chain.
            position: (..., 3) its origin (m).
            redundancy: (...,) value (rad) of the redundant joint, if there is one.

        Returns:
            q (..., branches, n) in rad and valid (..., branches): the tool is there and all joints
            are within their limits.
        """
        value = np.asarray(redundancy, float)
        shape = np.broadcast_shapes(rotation.shape[:-2], position.shape[:-1], value.shape)
        rotation = np.broadcast_to(rotation, (*shape, 3, 3))
        position = np.broadcast_to(position, (*shape, 3))
        value = np.broadcast_to(value, shape)
        axes, points, turned, moved = self._six(rotation, position, value)
        angles = self._guess(axes, points, turned, moved)
        q = np.empty((*angles.shape[:-1], len(self.chain)))
        q[..., self._free] = angles
        if self._redundant is not None:
            q[..., self._redundant] = value[..., None]
        exact = self._polish(q, rotation[..., None, :, :], position[..., None, :])
        q = self._within_turns(q)
        inside = np.all((q >= self._limits[:, 0]) & (q <= self._limits[:, 1]), axis=-1)
        return q, inside & exact

    def follow(self, q: Array, valid: Array, branch: int) -> Array | None:
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

    def forward(self, q: Array) -> tuple[Array, Array]:
        """Rotation (..., 3, 3) and origin (..., 3) of the tool frame for joints (..., n)."""
        return self.chain.forward(q)

    def _six(
        self, rotation: Array, position: Array, value: Array
    ) -> tuple[Array, Array, Array, Array]:
        """The six free screws, and the motion (..., 3, 3), (..., 3) that they have to make.

        The redundant joint's turn is carried over to the end of the product of motions: it turns
        the screws behind it and the tool.
        """
        axes, points = self.chain.axes, self.chain.points
        tool, origin = self.chain.rotation, self.chain.position
        joint = self._redundant
        if joint is not None:
            bend, at = turn(axes[joint], value), points[joint]
            ahead = np.arange(len(axes)) < joint
            axes = np.where(ahead[:, None], axes, axes @ np.swapaxes(bend, -1, -2))
            turned = at + (points - at) @ np.swapaxes(bend, -1, -2)
            points = np.where(ahead[:, None], points, turned)
            tool, origin = bend @ tool, at + sub.apply(bend, origin - at)
        motion = rotation @ np.swapaxes(tool, -1, -2)
        shift = position - sub.apply(motion, np.broadcast_to(origin, position.shape))
        return axes[..., self._free, :], points[..., self._free, :], motion, shift

    def _polish(self, q: Array, rotation: Array, position: Array) -> NDArray[np.bool_]:
        """Improve q (..., n) in place where it is near a solution; whether it is one."""
        flat = q.reshape(-1, q.shape[-1])
        rotation = np.broadcast_to(rotation, (*q.shape[:-1], 3, 3)).reshape(-1, 3, 3)
        position = np.broadcast_to(position, (*q.shape[:-1], 3)).reshape(-1, 3)
        error = np.linalg.norm(_error(*self.chain.forward(flat), rotation, position), axis=-1)
        active = np.flatnonzero((error > _EXACT / 10) & (error < self._capture))
        for _ in range(self._iterations):
            if not len(active):
                break
            turned, origin, jacobian = self.chain.jacobian(flat[active])
            error[active], step = _newton(
                _error(turned, origin, rotation[active], position[active]),
                jacobian[..., self._free],
            )
            going = error[active] > _EXACT / 10
            flat[np.ix_(active[going], self._free)] += step[going]
            active = active[going]
        return np.asarray(error < _EXACT).reshape(q.shape[:-1])

    def _within_turns(self, q: Array) -> Array:
        """Whole turns added, so that joints are near the home posture and within their limits."""
        q = q + _TURN * np.round((self._home - q) / _TURN)
        low, high = self._limits.T
        q = q + np.where(q < low, _TURN, 0.0)
        return np.asarray(q - np.where((q > high) & (q - _TURN >= low), _TURN, 0.0))


def _fixed_starts(limits: Array) -> Guess:
    """The same starts for every pose, spread over the joints' ranges (6, 2)."""
    low, high = np.clip(limits, -np.pi, np.pi).T
    starts = np.random.default_rng(0).uniform(low, high, (_STARTS, 6))

    def guess(axes: Array, points: Array, rotation: Array, shift: Array) -> Array:
        return np.broadcast_to(starts, (*shift.shape[:-1], *starts.shape))

    return guess


def _error(turned: Array, origin: Array, rotation: Array, position: Array) -> Array:
    """What is missing (..., 6) from a pose to another: a shift (m) and a rotation (rad)."""
    rest = rotation @ np.swapaxes(turned, -1, -2)
    twist = np.stack([rest[..., 2, 1], rest[..., 0, 2], rest[..., 1, 0]], axis=-1)
    twist = (twist - np.stack([rest[..., 1, 2], rest[..., 2, 0], rest[..., 0, 1]], axis=-1)) / 2
    sine = np.linalg.norm(twist, axis=-1)
    angle = np.arctan2(sine, (np.trace(rest, axis1=-2, axis2=-1) - 1) / 2)
    scale = angle / np.maximum(sine, 1e-12)
    return np.concatenate(
        [position - origin, np.where(sine > 1e-9, scale, 1.0)[..., None] * twist], axis=-1
    )


def _newton(error: Array, jacobian: Array) -> tuple[Array, Array]:
    """Sizes (k,) of errors (k, 6), and damped steps (k, 6) of the joints against them."""
    size = np.linalg.norm(error, axis=-1)
    square = jacobian @ np.swapaxes(jacobian, -1, -2)
    damped = square + (_DAMPING * size**2)[:, None, None] * np.eye(6)
    step = sub.apply(
        np.swapaxes(jacobian, -1, -2), np.linalg.solve(damped, error[..., None])[..., 0]
    )
    longest = np.abs(step).max(axis=-1, keepdims=True)
    return size, step * np.minimum(1.0, _LONGEST_STEP / np.maximum(longest, 1e-12))
