"""Convex hulls of a robot's links, from the collision shapes of its description."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from guided_lgp.robots.chain import Array

_SIDES = 12
"""Of the prism that stands for a cylinder."""
_ON_PLANE = 1e-12


@cache
def link_hulls(urdf: Path) -> dict[str, tuple[Array, ...]]:
    """Vertices (n, 3) in the link's frame (m) of every collision shape, by link.

    Round shapes are replaced by prisms and polyhedra around them. The paths of meshes in the file
    must be plain.
    """
    import pinocchio as pin  # heavy: only where a robot is measured

    model = pin.buildModelFromUrdf(str(urdf))
    shapes = pin.buildGeomFromUrdf(model, str(urdf), pin.GeometryType.COLLISION)
    hulls: dict[str, list[Array]] = {}
    for shape in shapes.geometryObjects:
        frame = model.frames[shape.parentFrame]
        placement = frame.placement.actInv(shape.placement)
        vertices = shape_vertices(shape.geometry) @ placement.rotation.T + placement.translation
        hulls.setdefault(frame.name, []).append(vertices)
    return {link: tuple(vertices) for link, vertices in hulls.items()}


def shape_vertices(shape: Any) -> Array:
    """Vertices (n, 3) in its own frame (m) of a polyhedron that a shape of coal's fills at most."""
    import coal

    if isinstance(shape, coal.BVHModelBase):
        shape.buildConvexHull(True, "Qt")
        shape = shape.convex
    if isinstance(shape, coal.Box):
        return _corners(shape.halfSide)
    if isinstance(shape, coal.Sphere):
        return np.asarray(shape.radius * _round())
    if isinstance(shape, coal.Cylinder):
        return _prism(shape.radius, shape.halfLength)
    if isinstance(shape, coal.Capsule):
        ends = np.array([0.0, 0.0, shape.halfLength])
        return np.concatenate([shape.radius * _round() + end for end in (ends, -ends)])
    return np.array(shape.points())


def _corners(half: Array) -> Array:
    signs = np.stack(np.meshgrid(*[(-1.0, 1.0)] * 3), axis=-1).reshape(-1, 3)
    return np.asarray(signs * np.asarray(half))


def _prism(radius: float, half: float) -> Array:
    angles = 2 * np.pi * np.arange(_SIDES) / _SIDES
    outer = radius / np.cos(np.pi / _SIDES)
    ring = outer * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return np.concatenate([np.insert(ring, 2, height, axis=1) for height in (-half, half)])


@cache
def _round() -> Array:
    """Vertices (12, 3) of the icosahedron around the unit sphere."""
    golden = (1 + np.sqrt(5)) / 2
    signs = [(s, t * golden) for s in (-1.0, 1.0) for t in (-1.0, 1.0)]
    vertices = np.array([np.roll([0.0, *pair], shift) for pair in signs for shift in range(3)])
    inner = golden**2 / np.sqrt(3)  # distance of a face from the centre
    return np.asarray(vertices / inner)


def between(vertices: Array, axis: Array, low: float, high: float) -> Array:
    """Points (m, 3) whose hull is the part of the hull of points (n, 3) between two planes.

    Args:
        vertices: (n, 3), not all in a plane.
        axis: (3,) normal of the planes.
        low: of the first plane, along the axis (m).
        high: of the second.
    """
    from scipy.spatial import ConvexHull

    heights = vertices @ axis
    inside = vertices[(heights >= low - _ON_PLANE) & (heights <= high + _ON_PLANE)]
    triangles = ConvexHull(vertices).simplices
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [0, 2]]])
    return np.concatenate([inside, *(_crossings(vertices[edges], axis, at) for at in (low, high))])


def _crossings(edges: Array, axis: Array, level: float) -> Array:
    """Where edges (n, 2, 3) cross a plane."""
    first, second = (edges @ axis - level).T
    crossing = first * second < 0
    share = (first[crossing] / (first - second)[crossing])[:, None]
    start, end = edges[crossing, 0], edges[crossing, 1]
    return np.asarray(start + share * (end - start))
