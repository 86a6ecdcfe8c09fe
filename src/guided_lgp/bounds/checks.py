"""What numeric checks share: violations, and poses as plain floats.

Poses are sequences of seven floats here, ``[x, y, z, qx, qy, qz, qw]``: for single poses that is
many times faster than arrays.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from guided_lgp.poses import Array, compose, pose
from guided_lgp.scene import Scene
from guided_lgp.scene.shapes import Convex

GRAVITY = 9.81
"""m/s²."""
Pose = Sequence[float]
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Violation:
    """A constraint that does not hold."""

    constraint: str
    amount: float
    """By how much, in m, rad, or units of the limit; 0 where there is no amount."""
    action: int = -1
    """Index of the action in the skeleton, where there is one."""
    time: float = math.nan
    """Where on a path (s)."""

    def __str__(self) -> str:
        return f"{self.constraint} by {self.amount:.3g}"


@lru_cache(maxsize=64)
def box_sizes(scene: Scene) -> Mapping[str, Vector]:
    """Extents (m) of every box that may be moved."""
    return {box.name: box.size for box in scene.movable}


@lru_cache(maxsize=64)
def box_bodies(scene: Scene) -> Mapping[str, Convex]:
    """Every box that may be moved."""
    return {box.name: box.convex for box in scene.movable}


@lru_cache(maxsize=64)
def given_grasps(scene: Scene) -> Mapping[str, Array]:
    """Grasps (n, 7) of the boxes for which the scene gives them: the tool in the box's frame."""
    return {box.name: box.grasp_poses for box in scene.movable if box.grasps}


@lru_cache(maxsize=64)
def volumes(scene: Scene) -> Mapping[str, float]:
    """Volume (m³) of every box that may be moved; all are equally dense."""
    return {box.name: box.convex.volume for box in scene.movable}


@lru_cache(maxsize=64)
def body_names(scene: Scene) -> frozenset[str]:
    """Boxes, tables and obstacles."""
    return frozenset(body.name for body in scene.bodies)


def overlap_name(first: str, second: str, bodies: Collection[str]) -> str:
    """The constraint that two overlapping parts violate.

    ``clear link body``, ``apart link link`` or ``beside body body``.

    Args:
        first: a link of the robot, or a body.
        second: another one.
        bodies: names of all boxes and tables.
    """
    links = [name for name in (first, second) if name not in bodies]
    others = [name for name in (first, second) if name in bodies]
    return " ".join((("beside", "clear", "apart")[len(links)], *links, *others))


@dataclass(frozen=True)
class Top:
    """What a box can stand on: pose of the body, half extents and height of its top (m).

    Of round and odd shapes, the half extents of a rectangle inside the top.
    """

    pose: Pose
    half: Sequence[float]
    height: float


def top_of(scene: Scene, boxes: Mapping[str, Pose], name: str) -> Top:
    """The top of a table or of a box."""
    if name not in boxes:
        return _still_tops(scene)[name]
    half, height = _tops_in_boxes(scene)[name]
    return Top(boxes[name], half, boxes[name][2] + height)


@lru_cache(maxsize=64)
def _still_tops(scene: Scene) -> Mapping[str, Top]:
    return {
        body.name: Top(pose(body.top, body.yaw).tolist(), body.convex.rest, body.top[2])
        for body in scene.supports
    }


@lru_cache(maxsize=64)
def _tops_in_boxes(scene: Scene) -> Mapping[str, tuple[tuple[float, float], float]]:
    """Half extents of the tops of boxes, and their heights above the boxes' centres (m)."""
    return {box.name: (box.convex.rest, box.convex.half[2]) for box in scene.movable}


def axes_of(pose: Pose) -> tuple[Vector, Vector, Vector]:
    """The body's x, y and z axis in the world."""
    return _axes(tuple(pose[3:]))


@lru_cache(maxsize=4096)
def _axes(quaternion: tuple[float, ...]) -> tuple[Vector, Vector, Vector]:
    """Kept, since several checks look at one pose, and most boxes stay where they are."""
    x, y, z, w = quaternion
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
        (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
    )


def closing_axis(placement: Pose, tool: Pose) -> int:
    """The axis of a box that is nearest to the one along which a hand's fingers close."""
    _, closing, _ = axes_of(tool)
    cosines = [abs(dot(closing, side)) for side in axes_of(placement)]
    return cosines.index(max(cosines))


def turned_to_fingers(placement: Pose, tool: Pose) -> Pose:
    """A pose of a cylinder, turned about its axis such that a hand's fingers close along its y.

    Where they close on top and bottom: such that the hand comes along its x.
    """
    approach, closing, _ = axes_of(tool)
    x, y, z = (dot(closing, axis) for axis in axes_of(placement))
    turn = math.atan2(-x, y)
    if abs(z) > math.sqrt(0.5):
        x, y, _ = (dot(approach, axis) for axis in axes_of(placement))
        turn = math.atan2(y, x)
    turned: list[float] = compose(np.asarray(placement), pose(np.zeros(3), turn)).tolist()
    return turned


def dot(first: Sequence[float], second: Sequence[float]) -> float:
    """Scalar product of two vectors (3,)."""
    return first[0] * second[0] + first[1] * second[1] + first[2] * second[2]


def offset_of(origin: Sequence[float], target: Sequence[float]) -> Vector:
    """From one position to another, in the world."""
    return (target[0] - origin[0], target[1] - origin[1], target[2] - origin[2])


def angle_of(cosine: float) -> float:
    """The angle (rad) of a cosine that rounding may have put beyond one."""
    return math.acos(max(-1.0, min(1.0, cosine)))
