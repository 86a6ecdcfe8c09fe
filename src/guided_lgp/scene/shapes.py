"""Convex shapes of bodies: what is around them, inside them, and the flat parts they stand on.

A shape's frame has its z axis up when the body stands; its origin is at half its height, above the
centre of mass.
"""

import math
from dataclasses import dataclass
from functools import cache
from itertools import product
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from guided_lgp.poses import Array

Shape = Literal["box", "cylinder", "mesh"]
Vector = tuple[float, float, float]

_SIDES = 32
"""Of the prism around a cylinder."""
_FLAT = 0.001
"""How far (m) the vertices of a mesh may be from a plane that it stands on."""
_LINE = 0.008
"""Half the width (m) of the strip of a cylinder that fingers touch: the hand is so near to it."""
_UP = 2
_DECIMALS = 6
"""Vertices of a mesh are given to a micrometre."""
_SAME = 5e-6
"""How far (m) rounding puts the origin of a hull off."""
MOST_VERTICES = 2000
"""Of a hull: more make every collision check slow."""


@dataclass(frozen=True)
class Convex:
    """A convex body about the origin of its frame."""

    shape: Shape
    half: Vector
    """Half extents (m) of the box around it, in its frame."""
    vertices: tuple[Vector, ...] = ()
    """Of a mesh: it is their convex hull."""

    @property
    def size(self) -> Vector:
        """Full extents (m) of the box around it."""
        x, y, z = self.half
        return 2 * x, 2 * y, 2 * z

    @property
    def volume(self) -> float:
        """m³; all bodies are equally dense."""
        if self.shape == "mesh":
            return _hull_volume(self.vertices)
        share = math.pi / 4 if self.shape == "cylinder" else 1.0
        return share * math.prod(2 * half for half in self.half)

    @property
    def rest(self) -> tuple[float, float]:
        """Half extents (m) of a rectangle inside both its top and its base.

        What stands on the body has its centre of mass above this; zero where nothing can.
        """
        if self.shape == "mesh":
            return _common_rectangle(self.vertices, self.half, _UP)
        share = math.sqrt(0.5) if self.shape == "cylinder" else 1.0
        return share * self.half[0], share * self.half[1]

    def side(self, axis: int) -> Vector:
        """Half extents (m) about the centre of what fingers may touch that close along an axis.

        Of a box, its sides; of a mesh, a rectangle inside both of two parallel faces, if there are
        any; of a cylinder, the line that they touch, or how far in from its middle they get at top
        and bottom. The component along the axis has no meaning.
        """
        found = list(self.half)
        if self.shape == "mesh":
            first, second = _common_rectangle(self.vertices, self.half, axis)
        elif self.shape == "cylinder":
            first, second = min(_LINE, self.half[0]), self.half[2]
            if axis == _UP:
                first = second = math.sqrt(self.half[0] ** 2 - first**2)
        else:
            return self.half
        found[_across(axis)[0]], found[_across(axis)[1]] = first, second
        return found[0], found[1], found[2]

    @property
    def stands(self) -> bool:
        """Whether the centre of mass is above a flat base."""
        return self.shape != "mesh" or min(_rectangle(self.vertices, self.half, _UP, -1)) > 0

    def faces(self) -> NDArray[np.int32]:
        """Triangles (m, 3) of the hull of :meth:`points`, seen from outside."""
        from scipy.spatial import ConvexHull

        points = self.points()
        found = ConvexHull(points)
        a, b, c = (points[found.simplices[:, corner]] for corner in range(3))
        inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), found.equations[:, :3]) < 0
        triangles = found.simplices.copy()
        triangles[inward] = triangles[inward][:, ::-1]
        return np.asarray(triangles, np.int32)

    def points(self) -> Array:
        """Points (n, 3) whose hull covers the body."""
        if self.shape == "mesh":
            return np.array(self.vertices)
        if self.shape == "cylinder":
            return _prism(self.half[0], self.half[2])
        return np.array(list(product((-1.0, 1.0), repeat=3))) * self.half


def _prism(radius: float, half_height: float) -> Array:
    """Vertices (n, 3) of a prism around a cylinder."""
    angles = 2 * np.pi * np.arange(_SIDES) / _SIDES
    ring = radius / np.cos(np.pi / _SIDES) * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.concatenate([np.insert(ring, 2, z * half_height, axis=1) for z in (-1.0, 1.0)])


def hull(points: Array) -> tuple[Array, Array]:
    """The convex hull of points (n, 3) about its own origin.

    Returns:
        its vertices (m, 3), and where the origin lies in the frame of the points (3,): at half its
        height, above the centre of mass.

    Raises:
        ValueError: the points lie in a plane, or the hull has too many vertices.
    """
    from scipy.spatial import ConvexHull, QhullError

    points = np.unique(np.round(points, _DECIMALS), axis=0)
    try:
        found = ConvexHull(points)
    except (QhullError, ValueError):
        raise ValueError("the points do not enclose a body") from None
    vertices = points[np.sort(found.vertices)]
    if len(vertices) > MOST_VERTICES:
        raise ValueError(f"the hull has {len(vertices)} vertices, more than {MOST_VERTICES}")
    origin = _centroid(points[found.simplices], points.mean(axis=0))
    origin[2] = (vertices[:, 2].min() + vertices[:, 2].max()) / 2
    if np.abs(origin).max() < _SAME:
        return vertices, np.zeros(3)
    return np.round(vertices - origin, _DECIMALS), origin


def read_mesh(path: Path) -> Array:
    """The vertices (n, 3) of a mesh file: STL, OBJ, or what else assimp reads.

    Raises:
        ValueError: the file is missing or cannot be read.
    """
    import coal  # heavy: only where a scene has a mesh

    if not _is_file(path):
        raise ValueError(f"there is no file {path}")
    try:
        return np.array(coal.MeshLoader().load(str(path), np.ones(3)).vertices())
    except (RuntimeError, ValueError):
        raise ValueError(f"{path} is no mesh that can be read") from None


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # the name is too long
        return False


def _centroid(triangles: Array, inside: Array) -> Array:
    """Centre of mass (3,) of the hull of triangles (n, 3, 3) around an inner point."""
    edges = triangles - inside
    volumes = np.abs(np.linalg.det(edges))
    return np.asarray(inside + volumes @ edges.mean(axis=1) * 0.75 / volumes.sum())


@cache
def _hull_volume(vertices: tuple[Vector, ...]) -> float:
    from scipy.spatial import ConvexHull

    return float(ConvexHull(np.array(vertices)).volume)


def _across(axis: int) -> tuple[int, int]:
    """The other two axes."""
    first, second = (other for other in range(3) if other != axis)
    return first, second


@cache
def _common_rectangle(vertices: tuple[Vector, ...], half: Vector, axis: int) -> tuple[float, float]:
    """Half extents (m) of a rectangle about an axis inside the flat faces at both of its ends."""
    one, other = (_rectangle(vertices, half, axis, side) for side in (1, -1))
    return min(one[0], other[0]), min(one[1], other[1])


def _rectangle(
    vertices: tuple[Vector, ...], half: Vector, axis: int, side: int
) -> tuple[float, float]:
    """Half extents (m) of a rectangle about an axis inside the flat face at one of its ends."""
    from scipy.spatial import ConvexHull, QhullError

    points = np.array(vertices)
    flat = points[side * points[:, axis] >= half[axis] - _FLAT][:, _across(axis)]
    try:
        normals_and_offsets = ConvexHull(flat).equations
    except (QhullError, ValueError):
        return 0.0, 0.0
    reach = np.abs(flat).max(axis=0)
    shares = -normals_and_offsets[:, 2] / (np.abs(normals_and_offsets[:, :2]) @ reach)
    share = max(0.0, float(shares.min()))
    return share * float(reach[0]), share * float(reach[1])
