"""The elementary problems of inverse kinematics, for many targets at once (Paden and Kahan).

Every one is about rotations exp(w q) about axes w through points; the names of the arguments are
those of the equations. All arrays broadcast; two solutions stand along a new last axis. Where
there is no solution, the nearest values are returned: the caller checks what comes out.
"""

import numpy as np

from guided_lgp.robots.chain import Array, turn


def dot(first: Array, second: Array) -> Array:
    """Scalar products of vectors (..., 3)."""
    return np.asarray(np.einsum("...i,...i->...", first, second))


def apply(rotation: Array, vector: Array) -> Array:
    """Matrices (..., 3, 3) times vectors (..., 3)."""
    return np.asarray((rotation @ vector[..., None])[..., 0])


def rotated(axis: Array, angle: Array, point: Array, vector: Array) -> Array:
    """Points (..., 3) turned by angles (...) about axes (..., 3) through points (..., 3)."""
    return point + apply(turn(axis, angle), vector - point)


def linear(a: Array, b: Array, c: Array) -> Array:
    """Both angles (..., 2) with a cos q + b sin q = c."""
    middle, cosine = np.arctan2(b, a), c / np.maximum(np.hypot(a, b), 1e-12)
    half = np.arccos(np.clip(cosine, -1.0, 1.0))
    return np.stack([middle + half, middle - half], axis=-1)


def onto(axis: Array, start: Array, end: Array) -> Array:
    """The angle (...) about ``axis`` that turns the vector ``start`` over ``end``."""
    sine = dot(axis, np.cross(start, end))
    cosine = dot(start, end) - dot(axis, start) * dot(axis, end)
    return np.arctan2(sine, cosine)


def to_distance(axis: Array, point: Array, vector: Array, centre: Array, distance: Array) -> Array:
    """Both angles (..., 2) that turn the point ``vector`` to a squared distance from ``centre``."""
    arm, offset = vector - point, point - centre
    along = dot(axis, arm)[..., None] * axis
    constant = dot(arm, arm) + dot(offset, offset) + 2 * dot(offset, along)
    a, b = 2 * dot(offset, arm - along), 2 * dot(offset, np.cross(axis, arm))
    return linear(a, b, distance - constant)


def to_height(axis: Array, vector: Array, normal: Array, height: Array) -> Array:
    """Both angles (..., 2) with normal · exp(axis q) vector = height."""
    along = dot(axis, vector)[..., None] * axis
    a, b = dot(normal, vector - along), dot(normal, np.cross(axis, vector))
    return linear(a, b, height - dot(normal, along))


def wrist(axes: Array, rotation: Array) -> Array:
    """Angles (..., 2, 3) of three axes (..., 3, 3) whose rotations multiply to ``rotation``."""
    first, middle, last = axes[..., 0, :], axes[..., 1, :], axes[..., 2, :]
    pointing = apply(rotation, last)
    q2 = to_height(middle, last, first, dot(first, pointing))
    first, middle, last = first[..., None, :], middle[..., None, :], last[..., None, :]
    bent = turn(middle, q2)
    q1 = onto(first, apply(bent, last), pointing[..., None, :])
    rest = np.swapaxes(turn(first, q1) @ bent, -1, -2) @ rotation[..., None, :, :]
    across = _across(last)
    return np.stack([q1, q2, onto(last, across, apply(rest, across))], axis=-1)


def _across(axis: Array) -> Array:
    """A vector at right angles to each of ``axis`` (..., 3)."""
    smallest = np.argmin(np.abs(axis), axis=-1)
    return np.asarray(np.cross(axis, np.eye(3)[smallest]))
