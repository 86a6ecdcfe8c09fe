"""Two ways to run one algorithm for the inverse kinematics of six joints: compiled, and in numpy.

Both begin with the guess of the arm's structure, or with fixed starts, and improve every branch by
damped Newton steps until the tool is where it has to be.
"""

import ctypes
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Protocol

import numpy as np

from guided_lgp.compiled import address, load_compiled
from guided_lgp.robots.chain import Array, Chain, turn
from guided_lgp.robots.inverse import subproblems as sub
from guided_lgp.robots.inverse.structures import BRANCHES, Structure

EXACT = 1e-8
"""Error (m, rad) up to which a solution counts as one; it is improved down to a tenth of it."""
DAMPING = 0.01
"""Of the squared singular values, for an error of one; it vanishes with the error."""
LONGEST_STEP = 0.7
"""Of a joint in one iteration (rad)."""
_SOURCES = ("subproblems.c", "structures.c", "inverse.c")
"""The compiled form, each part after what it calls."""


@dataclass(frozen=True)
class Problem:
    """The six joints of an arm that are solved for, and how."""

    chain: Chain
    redundant: int | None
    """Index of the joint that is not solved for."""
    structure: Structure | None
    starts: Array
    """(branches, 6) rad; used where there is no structure."""
    capture: float
    """Largest error (m, rad) of a guess that is improved."""
    iterations: int

    @property
    def free(self) -> list[int]:
        """The joints that are solved for."""
        return [i for i in range(len(self.chain)) if i != self.redundant]

    @property
    def branches(self) -> int:
        """Solutions that are looked for."""
        return len(self.starts) if self.structure is None else BRANCHES


class Solver(Protocol):
    """Solves N poses."""

    def __call__(self, rotation: Array, position: Array, value: Array) -> tuple[Array, Array]:
        """Joints (N, branches, n) and what is missing to the pose (N, branches) in m or rad.

        Args:
            rotation: (N, 3, 3) of the tool frame.
            position: (N, 3) its origin (m).
            value: (N,) of the redundant joint (rad).
        """
        ...


def best_solver(problem: Problem) -> Solver:
    """The compiled solver, or the one in numpy where there is no C compiler."""
    library = _library()
    return InNumpy(problem) if library is None else Compiled(problem, library)


@cache
def _library() -> ctypes.CDLL | None:
    folder = Path(__file__).parent
    parts = [(folder / name).read_text(encoding="utf-8") for name in _SOURCES]
    return load_compiled("inverse", "\n".join(parts))


class _Arm(ctypes.Structure):
    """``Arm`` of inverse.c."""

    _fields_ = (
        *((name, ctypes.c_int) for name in ("joints", "redundant", "structure")),
        *((name, ctypes.c_int) for name in ("branches", "iterations")),
        *((name, ctypes.c_double) for name in ("exact", "capture", "damping", "longest")),
        *((name, ctypes.c_void_p) for name in ("axes", "points", "tool", "starts")),
    )


class Compiled:
    """The solver in C."""

    def __init__(self, problem: Problem, library: ctypes.CDLL) -> None:
        chain, structure = problem.chain, problem.structure
        tool = np.concatenate([chain.rotation.ravel(), chain.position])
        self._arrays = [
            np.ascontiguousarray(array)
            for array in (chain.axes, chain.points, tool, problem.starts)
        ]
        self._arm = _Arm(
            len(chain),
            -1 if problem.redundant is None else problem.redundant,
            -1 if structure is None else structure.kind,
            problem.branches,
            problem.iterations,
            EXACT,
            problem.capture,
            DAMPING,
            LONGEST_STEP,
            *(array.ctypes.data for array in self._arrays),
        )
        self._shape = problem.branches, len(chain)
        self._inverse = library.inverse

    def __call__(self, rotation: Array, position: Array, value: Array) -> tuple[Array, Array]:
        """See :class:`Solver`."""
        poses = [np.ascontiguousarray(array) for array in (rotation, position, value)]
        q = np.empty((len(value), *self._shape))
        missing = np.empty(q.shape[:2])
        pointers = [*map(address, (*poses, q, missing))]
        self._inverse(ctypes.byref(self._arm), len(value), *pointers)
        return q, missing


class InNumpy:
    """The same for all poses at once."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._chain = problem.chain
        self._free = np.array(problem.free)

    def __call__(self, rotation: Array, position: Array, value: Array) -> tuple[Array, Array]:
        """See :class:`Solver`."""
        q = np.empty((len(value), self._problem.branches, len(self._chain)))
        q[...] = value[:, None, None]
        if self._problem.structure is None:
            q[..., self._free] = self._problem.starts
        else:
            motion = free_screws(self._chain, self._problem.redundant, rotation, position, value)
            q[..., self._free] = self._problem.structure.guess(*motion)
        count = self._problem.branches
        poses = np.repeat(rotation, count, axis=0), np.repeat(position, count, axis=0)
        return q, self._polish(q.reshape(-1, q.shape[-1]), *poses).reshape(q.shape[:2])

    def _polish(self, q: Array, rotation: Array, position: Array) -> Array:
        """Improve q (k, n) in place where it is near a solution; what is missing in the end."""
        error = np.linalg.norm(_error(*self._chain.forward(q), rotation, position), axis=-1)
        active = np.flatnonzero((error > EXACT / 10) & (error < self._problem.capture))
        for _ in range(self._problem.iterations):
            if not len(active):
                break
            target = rotation[active], position[active]
            turned, origin, jacobian = self._chain.jacobian(q[active])
            step = _newton(_error(turned, origin, *target), jacobian[..., self._free])
            q[np.ix_(active, self._free)] += step
            rest = _error(*self._chain.forward(q[active]), *target)
            error[active] = np.linalg.norm(rest, axis=-1)
            active = active[error[active] > EXACT / 10]
        return np.asarray(error)


def free_screws(
    chain: Chain, redundant: int | None, rotation: Array, position: Array, value: Array
) -> tuple[Array, Array, Array, Array]:
    """The screws of the six free joints, and the motion that they have to make.

    The redundant joint's turn is carried over to the end of the product of motions: it turns the
    screws behind it and the tool.

    Returns:
        axes (..., 6, 3) and points (..., 6, 3), rotation (..., 3, 3) and shift (..., 3).
    """
    axes, points, tool, origin = chain.axes, chain.points, chain.rotation, chain.position
    free = [i for i in range(len(chain)) if i != redundant]
    if redundant is not None:
        bend, at = turn(axes[redundant], value), points[redundant]
        back = np.swapaxes(bend, -1, -2)
        behind = (np.arange(len(chain)) > redundant)[:, None]
        axes = np.where(behind, axes @ back, axes)
        points = np.where(behind, at + (points - at) @ back, points)
        tool, origin = bend @ tool, at + sub.apply(bend, origin - at)
    motion = rotation @ np.swapaxes(tool, -1, -2)
    shift = position - sub.apply(motion, np.broadcast_to(origin, position.shape))
    return axes[..., free, :], points[..., free, :], motion, shift


def _error(turned: Array, origin: Array, rotation: Array, position: Array) -> Array:
    """What is missing (..., 6) from a pose to another: a shift (m) and a rotation (rad)."""
    rest = rotation @ np.swapaxes(turned, -1, -2)
    skew = rest - np.swapaxes(rest, -1, -2)
    twist = np.stack([skew[..., 2, 1], skew[..., 0, 2], skew[..., 1, 0]], axis=-1) / 2
    sine = np.linalg.norm(twist, axis=-1)
    angle = np.arctan2(sine, (np.trace(rest, axis1=-2, axis2=-1) - 1) / 2)
    scale = np.where(sine > 1e-9, angle / np.maximum(sine, 1e-12), 1.0)
    return np.concatenate([position - origin, scale[..., None] * twist], axis=-1)


def _newton(error: Array, jacobian: Array) -> Array:
    """Damped steps (k, 6) of the joints against errors (k, 6)."""
    size = np.linalg.norm(error, axis=-1)
    square = jacobian @ np.swapaxes(jacobian, -1, -2)
    damped = square + (DAMPING * size**2)[:, None, None] * np.eye(6)
    weights = np.linalg.solve(damped, error[..., None])[..., 0]
    step = sub.apply(np.swapaxes(jacobian, -1, -2), weights)
    longest = np.abs(step).max(axis=-1, keepdims=True)
    return np.asarray(step * np.minimum(1.0, LONGEST_STEP / np.maximum(longest, 1e-12)))
