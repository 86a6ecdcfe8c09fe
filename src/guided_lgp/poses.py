"""Arithmetic of rigid poses ``[x, y, z, qx, qy, qz, qw]`` (m, unit quaternion).

All functions broadcast over leading dimensions.
"""

import ctypes
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from guided_lgp.compiled import address, load_compiled

Array = NDArray[np.float64]

IDENTITY: Array = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])


def pose(position: ArrayLike, yaw: float = 0.0) -> Array:
    """The pose of a level body at a position (3,), turned by ``yaw`` (rad) about the vertical."""
    return np.array([*np.asarray(position, float), 0.0, 0.0, np.sin(yaw / 2), np.cos(yaw / 2)])


def rotate(quaternion: Array, vector: Array) -> Array:
    """Rotate vectors (..., 3) by unit quaternions (..., 4)."""
    axis, scalar = quaternion[..., :3], quaternion[..., 3:]
    twist = 2.0 * _cross(axis, vector)
    return np.asarray(vector + scalar * twist + _cross(axis, twist))


def multiply(first: Array, second: Array) -> Array:
    """Product of quaternions (..., 4): apply ``second``, then ``first``."""
    if first.ndim == second.ndim == 1:
        return np.array(_multiply_two(*first.tolist(), *second.tolist()))
    a, s = first[..., :3], first[..., 3:]
    b, t = second[..., :3], second[..., 3:]
    vector = s * b + t * a + _cross(a, b)
    scalar = s * t - np.sum(a * b, axis=-1, keepdims=True)
    return np.concatenate([vector, scalar], axis=-1)


def compose(first: Array, second: Array) -> Array:
    """The pose ``first * second``: ``second`` is given in the frame of ``first``."""
    if first.ndim == second.ndim == 1:
        return np.array(_compose_two(first.tolist(), second.tolist()))
    library = _library()
    if library is not None:
        shape = second.shape if first.ndim == 1 else np.broadcast_shapes(first.shape, second.shape)
        found = np.empty(shape)
        pair = _spread(first, shape), _spread(second, shape)
        library.compose(found.size // 7, *map(address, pair), address(found))
        return found
    position = first[..., :3] + rotate(first[..., 3:], second[..., :3])
    return np.concatenate([position, multiply(first[..., 3:], second[..., 3:])], axis=-1)


def _spread(transform: Array, shape: tuple[int, ...]) -> Array:
    """A contiguous array of a shape; ``numpy.broadcast_to`` takes longer than the composition."""
    if transform.shape == shape:
        return np.ascontiguousarray(transform, dtype=float)
    spread = np.empty(shape)
    spread[...] = transform
    return spread


def _compose_two(first: list[float], second: list[float]) -> tuple[float, ...]:
    """Two single poses, in plain numbers: ten times faster, to the last bit the same."""
    x, y, z, a, b, c, s = first
    u, v, w, d, e, f, t = second
    k, m, n = 2.0 * (b * w - c * v), 2.0 * (c * u - a * w), 2.0 * (a * v - b * u)
    return (
        x + (u + s * k + (b * n - c * m)),
        y + (v + s * m + (c * k - a * n)),
        z + (w + s * n + (a * m - b * k)),
        *_multiply_two(a, b, c, s, d, e, f, t),
    )


def _multiply_two(
    a: float, b: float, c: float, s: float, d: float, e: float, f: float, t: float
) -> tuple[float, float, float, float]:
    return (
        s * d + t * a + (b * f - c * e),
        s * e + t * b + (c * d - a * f),
        s * f + t * c + (a * e - b * d),
        s * t - (a * d + b * e + c * f),
    )


def inverse(transform: Array) -> Array:
    """The inverse pose."""
    conjugate = transform[..., 3:] * np.array([-1.0, -1.0, -1.0, 1.0])
    return np.concatenate([-rotate(conjugate, transform[..., :3]), conjugate], axis=-1)


def apply(transform: Array, points: Array) -> Array:
    """World coordinates of points (..., 3) given in the frame of the pose (..., 7)."""
    return transform[..., :3] + rotate(transform[..., 3:], points)


def rotation_matrix(quaternion: Array) -> Array:
    """Rotation matrices (..., 3, 3) of unit quaternions (..., 4); columns are the body's axes."""
    axes = rotate(quaternion[..., None, :], np.eye(3))
    return np.ascontiguousarray(np.swapaxes(axes, -1, -2))


def quaternion(rotation: Array) -> Array:
    """Unit quaternion (4,) of a rotation matrix (3, 3).

    Four times the products of its components stand in the matrix; the row of the largest component
    is divided by it.
    """
    r, (x, y, z) = rotation, np.diag(rotation)
    a, b, c = r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]
    d, e, f = r[1, 0] + r[0, 1], r[2, 0] + r[0, 2], r[2, 1] + r[1, 2]
    products = np.array(
        [
            [1 + x - y - z, d, e, a],
            [d, 1 - x + y - z, f, b],
            [e, f, 1 - x - y + z, c],
            [a, b, c, 1 + x + y + z],
        ]
    )
    largest = int(np.argmax(np.diag(products)))
    return np.asarray(products[largest] / (2 * np.sqrt(products[largest, largest])))


def yaw_of(transform: Array) -> Array:
    """Heading (rad) of the body's x axis, seen from above."""
    x_axis = rotate(transform[..., 3:], np.array([1.0, 0.0, 0.0]))
    return np.asarray(np.arctan2(x_axis[..., 1], x_axis[..., 0]))


def tilt(transform: Array) -> Array:
    """Angle (rad) between the body's z axis and the vertical."""
    z_axis = rotate(transform[..., 3:], np.array([0.0, 0.0, 1.0]))
    return np.asarray(np.arctan2(np.hypot(z_axis[..., 0], z_axis[..., 1]), z_axis[..., 2]))


def _cross(first: Array, second: Array) -> Array:
    """Cross product of vectors (..., 3): ``numpy.cross`` without its overhead."""
    a, b, c = first[..., 0], first[..., 1], first[..., 2]
    x, y, z = second[..., 0], second[..., 1], second[..., 2]
    product = np.empty(np.broadcast_shapes(first.shape, second.shape))
    np.subtract(b * z, c * y, out=product[..., 0])
    np.subtract(c * x, a * z, out=product[..., 1])
    np.subtract(a * y, b * x, out=product[..., 2])
    return product


@cache
def _library() -> ctypes.CDLL | None:
    source = Path(__file__).with_name("poses.c").read_text(encoding="utf-8")
    return load_compiled("poses", source)
