"""Bodies of a scene and where they are at first, in the robot's frame."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from guided_lgp.bounds.results import Array
from guided_lgp.poses import inverse, yaw_of
from guided_lgp.scene import Scene
from guided_lgp.scene.model import grasp_axes
from guided_lgp.scene.world import TABLE_THICKNESS


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
class Body:
    """A box or table: half extents (m)."""

    name: str
    half: tuple[float, float, float]
    mass: float


@dataclass(frozen=True)
class GraspSide:
    """A pair of upright sides of a box that fingers close on."""

    turn: float
    """Of their length against the box's x axis (rad)."""
    half_length: float
    width: float
    """From one to the other (m)."""


class SceneGeometry:
    """Bodies and initial poses of a scene in the robot's frame."""

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.domain = scene.symbols.domain
        to_robot = inverse(scene.robot.base_pose)
        self._turn = float(yaw_of(to_robot))
        self._shift = to_robot[:3]
        self.bodies: dict[str, Body] = {}
        self.poses: dict[str, tuple[float, float, float, float]] = {}
        for table in scene.tables:
            half = (*table.half_extents, TABLE_THICKNESS / 2)
            self._add(table.name, half, table.position, table.yaw, -TABLE_THICKNESS / 2)
        for box in scene.boxes:
            sx, sy, sz = box.size
            self._add(box.name, (sx / 2, sy / 2, sz / 2), box.position, box.yaw, 0.0)
        self.tables = tuple(table.name for table in scene.tables)
        self.boxes = tuple(box.name for box in scene.boxes)

    def _add(
        self,
        name: str,
        half: tuple[float, float, float],
        position: Sequence[float],
        yaw: float,
        raised: float,
    ) -> None:
        x, y, z = position
        self.bodies[name] = Body(name, half, 8 * half[0] * half[1] * half[2])
        self.poses[name] = (*self.in_robot(x, y, yaw), z + raised + float(self._shift[2]))

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
        """The sides of a box that fingers, open up to ``widest`` (m), can close on."""
        hx, hy, hz = self.bodies[name].half
        sides = GraspSide(np.pi / 2, hy, 2 * hx), GraspSide(0.0, hx, 2 * hy)
        return tuple(sides[axis] for axis in grasp_axes((2 * hx, 2 * hy, 2 * hz), widest))
