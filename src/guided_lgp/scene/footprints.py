"""Footprints: the rectangles that boxes and tables cover, seen from above (m)."""

import numpy as np

from guided_lgp.poses import Array
from guided_lgp.scene.bodies import Body

_CORNERS = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])


def footprint(body: Body) -> Array:
    """Corners (4, 2) of a level body in the world, counter-clockwise."""
    return _corners(body, body.convex.half[:2])


def seat(body: Body) -> Array:
    """Corners (4, 2) of the part of its top that may carry centres of mass."""
    return _corners(body, body.convex.rest)


def inner_radius(body: Body) -> float:
    """Of a disc (m) around its middle that a body has to itself, from its base to its top."""
    convex = body.convex
    return min(convex.rest if convex.shape == "mesh" else convex.half[:2])


def _corners(body: Body, half: tuple[float, float]) -> Array:
    return np.asarray(body.position[:2] + _CORNERS * np.array(half) @ _turn(body.yaw).T)


def gap(first: Array, second: Array) -> float:
    """Distance of two convex footprints; negative is the depth of their overlap."""
    return float(gaps(first[None], second[None])[0, 0])


def gaps(first: Array, second: Array) -> Array:
    """Distances (n, m) of convex footprints (n, 4, 2) from others (m, 4, 2), as in :func:`gap`."""
    one, other = first[:, None], second[None]
    separation = np.maximum(_separation(one, other), _separation(other, one))
    distance = np.minimum(_vertex_distance(one, other), _vertex_distance(other, one))
    return np.where(separation <= 0, separation, distance)


def inset(support: Array, points: Array) -> Array:
    """How far points (..., 2) lie inside a footprint (negative: outside)."""
    normals, offsets = _edges(support)
    return np.asarray(np.min(offsets - points @ normals.T, axis=-1))


def _turn(yaw: float) -> Array:
    return np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])


def _edges(corners: Array) -> tuple[Array, Array]:
    edges = np.roll(corners, -1, axis=-2) - corners
    normals = np.stack([edges[..., 1], -edges[..., 0]], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return normals, np.sum(normals * corners, axis=-1)


def _separation(first: Array, second: Array) -> Array:
    """The widest gaps along the outward normals of the first footprints' edges."""
    normals, offsets = _edges(first)
    along = second @ np.swapaxes(normals, -1, -2)
    return np.asarray(np.max(np.min(along, axis=-2) - offsets, axis=-1))


def _vertex_distance(vertices: Array, polygon: Array) -> Array:
    step = np.roll(polygon, -1, axis=-2) - polygon
    offset = vertices[..., :, None, :] - polygon[..., None, :, :]
    step, square = step[..., None, :, :], np.sum(step * step, axis=-1)[..., None, :]
    along = np.clip(np.sum(offset * step, axis=-1) / square, 0, 1)
    rest = np.linalg.norm(offset - along[..., None] * step, axis=-1)
    return np.asarray(np.min(rest, axis=(-2, -1)))
