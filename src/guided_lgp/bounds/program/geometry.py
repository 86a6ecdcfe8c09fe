"""Bodies of a scene and where they are at first, in the robot's frame."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from guided_lgp.bounds.results import Array
from guided_lgp.poses import apply, inverse, pose, yaw_of
from guided_lgp.scene import Scene
from guided_lgp.scene.bodies import Body
from guided_lgp.scene.footprints import gap
from guided_lgp.scene.grasps import ROUND_TURNS, grasp_axes
from guided_lgp.scene.model import Column
from guided_lgp.scene.shapes import Convex, Vector
from guided_lgp.scene.world import initial_poses


@dataclass(frozen=True)
class Margins:
    """Distances (m) that the program keeps."""

    clear: float = 0.004
    """Link spheres to boxes and tables."""
    apart: float = 0.005
    """Link spheres of one arm to another's."""
    beside: float = 0.006
    """Box to box."""
    balanced: float = 0.012
    """Centre of mass to the edge of the support."""


@dataclass(frozen=True)
class LevelBody:
    """A body as the program sees it: the level box around it."""

    name: str
    half: tuple[float, float, float]
    """Half extents (m)."""
    rest: tuple[float, float]
    """Half extents (m) of the part of its top above which centres of mass may be."""
    mass: float
    sides: tuple[Vector, Vector]
    """What fingers may touch that close along its x and y axis, see :meth:`Convex.side`."""


@dataclass(frozen=True)
class GraspSide:
    """A pair of sides of a box that fingers close on: upright ones, or top and bottom."""

    turn: float
    """Of their length against the box's x axis (rad)."""
    half_length: float
    width: float
    """From one to the other (m)."""
    touched: tuple[float, float]
    """Half extents (m) of what fingertips may touch, along the length and in height."""
    given: tuple[float, float, float] | None = None
    """Pitch, offset and depth of the one grasp on it, where these are not variables."""
    flat: bool = False
    """Whether it is top and bottom: the hand comes level, a quarter turn about its approach from
    where its fingers would close on the upright sides along that length ..."""
    slack: float = 0.0
    """... and may be so much less deep than given (m)."""


class SceneGeometry:
    """Bodies and initial poses of a scene in the robot's frame."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.movable = {box.name: box for box in scene.movable}
        self.domain = scene.symbols.domain
        to_robot = inverse(scene.robot.level_pose)
        self._turn = float(yaw_of(to_robot))
        self._shift = to_robot[:3]
        self.bodies: dict[str, LevelBody] = {}
        self.poses: dict[str, tuple[float, float, float, float]] = {}
        self.supports = tuple(map(self._add, scene.supports))
        """What stays where it is and may be stood on."""
        self.boxes = tuple(map(self._add, scene.movable))
        """What may be moved."""
        for name in scene.loaded:
            x, y, z = initial_poses(scene)[name][:3]
            yaw = float(yaw_of(initial_poses(scene)[name]))
            self.poses[name] = (*self.in_robot(x, y, yaw), z + float(self._shift[2]))
        columns = map(self._add, _lower_parts(scene.robot.columns))
        self.obstacles = (*columns, *map(self._add, scene.obstacles))
        self.overhung = frozenset(filter(self._is_overhung, self.supports))
        """What is, in part, below other furniture or an obstacle."""

    def _add(self, body: Body | Column) -> str:
        half, (x, y, z), yaw = level_box(body)
        convex = body.convex
        self.bodies[body.name] = LevelBody(
            body.name, half, convex.rest, convex.volume, (convex.side(0), convex.side(1))
        )
        self.poses[body.name] = (*self.in_robot(x, y, yaw), z + float(self._shift[2]))
        return body.name

    def _is_overhung(self, name: str) -> bool:
        top = self.poses[name][3] + self.bodies[name].half[2]
        return any(
            self.poses[other][3] - self.bodies[other].half[2] >= top
            and gap(self._outline(name), self._outline(other)) < 0
            for other in (*self.supports, *self.obstacles)
            if other != name
        )

    def _outline(self, name: str) -> Array:
        """Corners (4, 2) of a body, seen from above (m)."""
        x, y, yaw, _ = self.poses[name]
        corners = np.array([[1, 1, 0], [-1, 1, 0], [-1, -1, 0], [1, -1, 0]])
        return apply(pose((x, y, 0), yaw), corners * self.bodies[name].half)[:, :2]

    def in_robot(self, x: float, y: float, yaw: float) -> tuple[float, float, float]:
        """x, y and yaw in the robot's frame of a place in the world."""
        cosine, sine = np.cos(self._turn), np.sin(self._turn)
        return (
            float(cosine * x - sine * y + self._shift[0]),
            float(sine * x + cosine * y + self._shift[1]),
            yaw + self._turn,
        )

    def in_world(self, x: float, y: float, yaw: float, z: float) -> Array:
        """Pose (7,) in the world of a level body in the robot's frame."""
        base_x, base_y, base_yaw = self.scene.robot.base
        cosine, sine = math.cos(base_yaw), math.sin(base_yaw)
        half = (yaw + base_yaw) / 2
        height = z + self.scene.robot.height
        position = (base_x + cosine * x - sine * y, base_y + sine * x + cosine * y, height)
        return np.array([*position, 0.0, 0.0, math.sin(half), math.cos(half)])

    def grasp_sides(self, name: str, widest: float) -> tuple[GraspSide, ...]:
        """The sides of a box that fingers, open up to ``widest`` (m), can close on.

        Where they touch it, is the scene's matter if that gives the grasps. A cylinder has sides
        all around.
        """
        body = self.bodies[name]
        (hx, hy, hz), (along_y, along_x) = body.half, body.sides
        sides = (
            GraspSide(np.pi / 2, hy, 2 * hx, along_y[1:]),
            GraspSide(0.0, hx, 2 * hy, along_x[::2]),
        )
        order = grasp_axes((2 * hx, 2 * hy, 2 * hz), widest)
        given = bool(self.movable[name].grasps)
        found = tuple(sides[axis] for axis in order if given or min(sides[axis].touched) > 0)
        turns = ROUND_TURNS if self.is_round(name) else ()
        return found + tuple(replace(s, turn=s.turn + turn) for turn in turns for s in found)

    def is_round(self, name: str) -> bool:
        """Whether a box is a cylinder."""
        return self.movable[name].shape == "cylinder"


_SHOULDER = 0.1
"""Height (m) below the base that balls around the first links may reach, wherever they turn."""


def _lower_parts(columns: Iterable[Column]) -> Iterator[Column]:
    """What the program sees of columns; the verification sees all of them."""
    for column in columns:
        x, y, z = column.convex.half
        if 2 * z > _SHOULDER:
            placement = column.placement.copy()
            placement[2] -= _SHOULDER / 2
            low = Convex("box", (x, y, z - _SHOULDER / 2))
            yield replace(column, convex=low, placement=placement)


def level_box(body: Body | Column) -> tuple[Vector, Vector, float]:
    """Half extents, centre (m) and yaw (rad) of a level box around a body."""
    x, y, z, *turn = (float(value) for value in body.placement)
    if turn[0] == turn[1] == 0.0:
        return body.convex.half, (x, y, z), body.yaw
    yaw = float(yaw_of(body.placement))
    level = pose((x, y, z), yaw)
    points = apply(inverse(level), apply(body.placement, body.convex.points()))
    low, high = points.min(axis=0), points.max(axis=0)
    centre = apply(level, (low + high) / 2)
    return _vector((high - low) / 2), _vector(centre), yaw


def _vector(array: Array) -> Vector:
    x, y, z = (float(value) for value in array)
    return x, y, z
