"""A few spheres that contain a link, for the coarse bound's distances."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import pairwise
from pathlib import Path

import numpy as np

from guided_lgp.cache import made
from guided_lgp.robots.chain import Array
from guided_lgp.robots.measures import hulls
from guided_lgp.robots.measures.hulls import between

_MOST = 3
"""Spheres of one link."""
_SMALLEST = 0.1
"""Share of the radius that another sphere has to save."""
_ITERATIONS = 300


@dataclass(frozen=True)
class Spheres:
    """Spheres in the frame of a link."""

    centres: Array
    """(k, 3) m."""
    radii: Array
    """(k,) m."""


def kept_spheres(shapes: Sequence[Array]) -> list[Spheres]:
    """:func:`covering_spheres` of every shape, computed once per content of shapes and program."""
    program = [Path(file).read_bytes() for file in (__file__, hulls.__file__)]
    content = sha256(b"".join([*program, *(shape.tobytes() for shape in shapes)])).hexdigest()

    def covered(_: Path) -> bytes:
        spheres = map(covering_spheres, shapes)
        return json.dumps([[s.centres.tolist(), s.radii.tolist()] for s in spheres]).encode()

    file = made(f"spheres-{content[:16]}.json", covered)
    assert file is not None  # a document is always made
    return [
        Spheres(np.array(centres), np.array(radii))
        for centres, radii in json.loads(file.read_text(encoding="utf-8"))
    ]


def covering_spheres(vertices: Array, most: int = _MOST) -> Spheres:
    """Spheres whose union contains the convex hull of points (n, 3) in m.

    The hull is cut into slices of equal thickness along its longest axis, and every slice gets the
    sphere around it. Of up to ``most`` slices, as many are made as shrink the spheres.
    """
    candidates = [_sliced(vertices, count) for count in range(1, most + 1)]
    best = candidates[0]
    for candidate in candidates[1:]:
        if candidate.radii.max() < (1 - _SMALLEST) * best.radii.max():
            best = candidate
    return best


def _sliced(vertices: Array, count: int) -> Spheres:
    axis = _longest_axis(vertices)
    heights = vertices @ axis
    cuts = np.linspace(heights.min(), heights.max(), count + 1)
    slices = [between(vertices, axis, low, high) for low, high in pairwise(cuts)]
    balls = [_ball(points) for points in slices]
    return Spheres(np.array([centre for centre, _ in balls]), np.array([r for _, r in balls]))


def _longest_axis(vertices: Array) -> Array:
    """The principal axis (3,) along which the points lie farthest apart."""
    axes = np.linalg.svd(vertices - vertices.mean(axis=0), full_matrices=False)[2]
    extent = np.ptp(vertices @ axes.T, axis=0)
    return np.asarray(axes[np.argmax(extent)])


def _ball(points: Array) -> tuple[Array, float]:
    """Centre and radius of a small ball around points (Bădoiu and Clarkson, 2003)."""
    centre = (points.min(axis=0) + points.max(axis=0)) / 2
    for i in range(1, _ITERATIONS):
        farthest = points[np.argmax(((points - centre) ** 2).sum(axis=1))]
        centre = centre + (farthest - centre) / (i + 1)
    return centre, float(np.linalg.norm(points - centre, axis=1).max())
