"""How a hand holds a body at the start, where the scene leaves it open."""

import math
from collections.abc import Iterable

import numpy as np

from guided_lgp.poses import inverse, multiply, pose
from guided_lgp.robots import Arm
from guided_lgp.scene.bodies import Body, Box
from guided_lgp.scene.footprints import footprint, inset
from guided_lgp.scene.tolerances import GRASP_ANGLE, GRASP_OFFSET

_PALM_GAP = 0.002
"""Distance (m) of the palm from the body."""
_INSET = 0.003
"""How far (m) the point between the fingertips is inside the side that they press on, at least."""

_ROUNDING = 1e-9
"""By how much (m) lengths of a scene that should be the same may differ."""

ROUND_TURNS = (math.pi / 4, math.pi / 8, 3 * math.pi / 8)
"""Turns (rad) about its axis by which a cylinder is taken, beside those of a box around it: between
two of them, the side that a hand closes on is less than 12 degrees away."""


def grasp_axes(size: tuple[float, float, float], widest: float) -> tuple[int, ...]:
    """The box axes that fingers can close along, the narrower one first (0: x, 1: y).

    Args:
        size: extents (m) of the box.
        widest: side (m) that the hand can take.
    """
    order = (0, 1) if size[0] < size[1] else (1, 0)
    return tuple(axis for axis in order if size[axis] <= widest)


def is_held_flat(box: Box, bodies: Iterable[Body], widest: float) -> bool:
    """Whether fingers may close on top and bottom of a box: no two upright sides are near enough.

    Part of its underside is free at the start, since it juts out over what it stands on or is in a
    hand already; nobody could take it from anywhere else.

    Args:
        box: which has no grasps of its own.
        bodies: of the scene.
        widest: side (m) that the hand can take.
    """
    if grasp_axes(box.size, widest) or box.size[2] > widest:
        return False
    below = next((body for body in bodies if body.name == box.on), None)
    return below is None or _juts_out(box, below)


def _juts_out(box: Box, below: Body) -> bool:
    """Whether a body is not all above what it stands on."""
    radius, points = 0.0, footprint(box)
    if box.shape == "cylinder":
        radius, points = box.convex.half[0], np.array([box.position[:2]])
    if below.convex.shape == "cylinder":
        away = np.linalg.norm(points - below.position[:2], axis=1)
        return bool(away.max() + radius > below.convex.half[0] + _ROUNDING)
    return bool(inset(footprint(below), points).min() < radius - _ROUNDING)


def grasp_at_start(box: Box, arm: Arm) -> tuple[float, ...]:
    """Pose (7,) of a box in the tool frame of a hand that holds it: the first of its own grasps.

    Raises:
        ValueError: it has none, and no side of the box is narrow enough.
    """
    if box.grasps:
        return tuple(inverse(box.grasp_poses[0]).tolist())
    return grasp_from_above(box, arm)


def is_given(box: Box) -> bool:
    """Whether a box is held, at the start, in one of its own grasps."""
    tool = inverse(np.array(box.grasp))
    way = np.linalg.norm(box.grasp_poses[:, :3] - tool[:3], axis=1)
    turn = 2 * np.arccos(np.minimum(np.abs(box.grasp_poses[:, 3:] @ tool[3:]), 1.0))
    return bool(np.any((way <= GRASP_OFFSET) & (turn <= GRASP_ANGLE)))


def grasp_from_above(box: Box, arm: Arm) -> tuple[float, ...]:
    """Pose (7,) of a box in the tool frame of a hand that holds it from above, as deep as it goes.

    Raises:
        ValueError: no side of the box is narrow enough.
    """
    widest = arm.fingers.grasp_width
    axes = grasp_axes(box.size, widest)
    if not axes:
        raise ValueError(f"{arm.gripper} cannot hold {box.name!r}: no side of at most {widest} m")
    height = box.size[2]
    depth = max(_PALM_GAP, _INSET - arm.palm_front - height)
    down = np.array([0.0, -math.sqrt(0.5), 0.0, math.sqrt(0.5)])
    turn = pose((0.0, 0.0, 0.0), 0.0 if axes[0] == 1 else -math.pi / 2)[3:]
    quaternion = (float(value) for value in multiply(down, turn))
    return height / 2 + arm.palm_front + depth, 0.0, 0.0, *quaternion
