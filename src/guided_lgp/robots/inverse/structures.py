"""The structures that make an arm of six joints solvable in closed form.

A structure answers two questions about six screws: how far they are from having it, and which
joint values move a frame from the origin to a pose if they have it. Screws are axes and points
(..., 6, 3); they may depend on the pose.
"""

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntFlag
from itertools import pairwise

import numpy as np

from guided_lgp.robots.chain import Array, turn
from guided_lgp.robots.inverse import subproblems as sub

Guess = Callable[[Array, Array, Array, Array], Array]
"""Axes, points, rotation (..., 3, 3) and shift (..., 3) to angles (..., branches, 6)."""
_Reach = Callable[[Array, Array, Array, Array], Array]
"""Three axes and points, a point and where it has to go, to angles (..., 4, 3)."""


BRANCHES = 8
"""Solutions of every structure, some of which may coincide or be out of reach."""


class Kind(IntFlag):
    """What a structure is made of; the numbers are those of inverse.c."""

    WRIST = 0
    """The last three axes meet."""
    BACKWARDS = 1
    """The first three do: the arm is read from its tool to its root."""
    REACH_PARALLEL = 2
    """The first two of the other three joints are parallel; otherwise they meet."""
    REACH_BACKWARDS = 4
    """The last two of them are meant."""
    PARALLEL = 8
    """The second to fourth axes are parallel, and the last two meet."""


@dataclass(frozen=True)
class Structure:
    """A way to solve six joints."""

    misfit: float
    """How far (m, or sine of an angle) the arm is from having the structure."""
    kind: Kind

    @property
    def guess(self) -> Guess:
        """Solves for poses as if the misfit were zero."""
        if self.kind & Kind.PARALLEL:
            return _parallel
        reach = _reach_parallel if self.kind & Kind.REACH_PARALLEL else _reach_crossing
        wrist = _wrist(_reach_backwards(reach) if self.kind & Kind.REACH_BACKWARDS else reach)
        return _backwards(wrist) if self.kind & Kind.BACKWARDS else wrist


def closest(axes: Array, points: Array) -> Structure:
    """The structure that six screws (6, 3) have, or nearly have."""
    parallel = _skew(axes[1], axes[2]) + _skew(axes[1], axes[3]) + _apart(axes[4:], points[4:])
    structures = [
        *_wrists(axes, points, Kind.WRIST),
        *_wrists(*_reversed(axes, points), Kind.BACKWARDS),
        Structure(parallel, Kind.PARALLEL),
    ]
    return min(structures, key=lambda structure: structure.misfit)


def _wrists(axes: Array, points: Array, kind: Kind) -> list[Structure]:
    """Three axes that meet, after three joints of one kind or another."""
    wrist = _apart(axes[3:], points[3:])
    reaches = {
        kind: _apart(axes[:2], points[:2]),
        kind | Kind.REACH_PARALLEL: _skew(axes[0], axes[1]),
        kind | Kind.REACH_BACKWARDS: _apart(axes[1:3], points[1:3]),
        kind | Kind.REACH_PARALLEL | Kind.REACH_BACKWARDS: _skew(axes[1], axes[2]),
    }
    return [Structure(wrist + misfit, kind) for kind, misfit in reaches.items()]


def _skew(first: Array, second: Array) -> float:
    """The sine of the angle between two axes."""
    return float(np.linalg.norm(np.cross(first, second)))


def _apart(axes: Array, points: Array) -> float:
    """How far (m) axes are from meeting in a point; infinite if neighbours are parallel."""
    if any(_skew(*pair) < 0.1 for pair in pairwise(axes)):
        return float("inf")
    offset = _meeting(axes, points) - points
    return float(np.linalg.norm(np.cross(axes, offset), axis=1).max())


def _meeting(axes: Array, points: Array) -> Array:
    """The point (..., 3) nearest to lines (..., k, 3)."""
    across = np.eye(3) - axes[..., :, None] * axes[..., None, :]
    total = sub.apply(across, points).sum(axis=-2)
    return np.asarray(np.linalg.solve(across.sum(axis=-3), total[..., None])[..., 0])


def _wrist(reach: _Reach) -> Guess:
    """The last three axes meet in a point: three joints bring it there, three turn about it."""

    def guess(axes: Array, points: Array, rotation: Array, shift: Array) -> Array:
        centre = _meeting(axes[..., 3:, :], points[..., 3:, :])
        target = sub.apply(rotation, centre) + shift
        first = reach(axes[..., :3, :], points[..., :3, :], centre, target)
        rest = rotation[..., None, :, :]
        for joint in range(3):
            axis = axes[..., None, joint, :]
            rest = turn(axis, -first[..., joint]) @ rest
        last = sub.wrist(axes[..., None, 3:, :], rest)
        first = np.broadcast_to(first[..., None, :], last.shape)
        return _branches(np.concatenate([first, last], axis=-1), 2)

    return guess


def _backwards(guess: Guess) -> Guess:
    """The same for the arm read from its tool to its root."""

    def reverse(axes: Array, points: Array, rotation: Array, shift: Array) -> Array:
        back = np.swapaxes(rotation, -1, -2)
        return guess(*_reversed(axes, points), back, -sub.apply(back, shift))[..., ::-1]

    return reverse


def _reversed(axes: Array, points: Array) -> tuple[Array, Array]:
    return -axes[..., ::-1, :], points[..., ::-1, :]


def _reach_crossing(axes: Array, points: Array, start: Array, end: Array) -> Array:
    """The first two axes meet: the third joint sets the distance from there."""
    first, second, third = (axes[..., i, :] for i in range(3))
    centre = _meeting(axes[..., :2, :], points[..., :2, :])
    aim = end - centre
    q3 = sub.to_distance(third, points[..., 2, :], start, centre, sub.dot(aim, aim))
    arm = sub.rotated(third[..., None, :], q3, points[..., None, 2, :], start[..., None, :])
    arm, aim, centre = arm - centre[..., None, :], aim[..., None, :], centre[..., None, :]
    first, second = first[..., None, :], second[..., None, :]
    q2 = sub.to_height(second, arm, first, sub.dot(first, aim))
    raised = sub.apply(turn(second[..., None, :], q2), arm[..., None, :])
    q1 = sub.onto(first[..., None, :], raised, aim[..., None, :])
    return _branches(np.stack(np.broadcast_arrays(q1, q2, q3[..., None]), axis=-1), 2)


def _reach_parallel(axes: Array, points: Array, start: Array, end: Array) -> Array:
    """The first two axes are parallel: the third joint sets the height along them."""
    first, second, third = (axes[..., i, :] for i in range(3))
    at = points[..., 2, :]
    q3 = sub.to_height(third, start - at, first, sub.dot(first, end - at))
    arm = sub.rotated(third[..., None, :], q3, points[..., None, 2, :], start[..., None, :])
    first, second, aim = (v[..., None, :] for v in (first, second, end - points[..., 0, :]))
    origin, at = points[..., None, 0, :], points[..., None, 1, :]
    q2 = sub.to_distance(second, at, arm, origin, sub.dot(aim, aim))
    first, second, aim, origin, at, arm = (
        v[..., None, :] for v in (first, second, aim, origin, at, arm)
    )
    q1 = sub.onto(first, sub.rotated(second, q2, at, arm) - origin, aim)
    return _branches(np.stack(np.broadcast_arrays(q1, q2, q3[..., None]), axis=-1), 2)


def _reach_backwards(reach: _Reach) -> _Reach:
    def reverse(axes: Array, points: Array, start: Array, end: Array) -> Array:
        return reach(*_reversed(axes, points), end, np.broadcast_to(start, end.shape))[..., ::-1]

    return reverse


def _parallel(axes: Array, points: Array, rotation: Array, shift: Array) -> Array:
    """The second to fourth axes are parallel, and the last two meet.

    The first joint puts the point where they meet into its plane, the last two turn the parallel
    axis into its direction, and three joints in the plane remain.
    """
    w = [axes[..., i, :] for i in range(6)]
    p = [points[..., i, :] for i in range(6)]
    centre = _meeting(axes[..., 4:, :], points[..., 4:, :])
    target = sub.apply(rotation, centre) + shift
    q1 = sub.to_height(-w[0], target - p[0], w[1], sub.dot(w[1], centre - p[0]))
    w, p = [v[..., None, :] for v in w], [v[..., None, :] for v in p]
    rotation, shift = rotation[..., None, :, :], shift[..., None, :]
    normal = sub.apply(np.swapaxes(rotation, -1, -2), sub.apply(turn(w[0], q1), w[1]))
    q5 = sub.to_height(-w[4], w[1], w[5], sub.dot(w[5], normal))
    w, p, normal = [v[..., None, :] for v in w], [v[..., None, :] for v in p], normal[..., None, :]
    rotation, shift, q1 = rotation[..., None, :, :], shift[..., None, :], q1[..., None]
    q6 = sub.onto(w[5], normal, sub.apply(turn(w[4], -q5), w[1]))

    def planar(vector: Array) -> Array:
        return sub.apply(turn(w[0], -q1), vector)

    tip = sub.rotated(w[5], -q6, p[5], sub.rotated(w[4], -q5, p[4], p[3]))
    tip = planar(sub.apply(rotation, tip) + shift - p[0]) + p[0]
    bent = turn(w[5], -q6) @ turn(w[4], -q5)
    direction = planar(sub.apply(rotation, sub.apply(bent, w[4])))
    total = sub.onto(w[1], w[4], direction)
    q3 = sub.to_distance(w[2], p[2], p[3], p[1], sub.dot(tip - p[1], tip - p[1]))
    w, p, tip = [v[..., None, :] for v in w], [v[..., None, :] for v in p], tip[..., None, :]
    q2 = sub.onto(w[1], sub.rotated(w[2], q3, p[2], p[3]) - p[1], tip - p[1])
    along = [np.sign(sub.dot(w[1], w[i])) for i in (2, 3)]
    q4 = along[1] * (total[..., None] - q2 - along[0] * q3)
    sides = (q1[..., None], q2, q3, q4, q5[..., None], q6[..., None])
    return _branches(np.stack(np.broadcast_arrays(*sides), axis=-1), 3)


def _branches(angles: Array, count: int) -> Array:
    """The last ``count`` axes before the joints, as one."""
    shape = angles.shape
    return angles.reshape(*shape[: -1 - count], -1, shape[-1])
