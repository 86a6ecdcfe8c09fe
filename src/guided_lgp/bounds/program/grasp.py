"""Where the tool is on a box that it holds.

A grasp has a pitch, an offset and a depth. The fingers close across the box's width; the approach
axis lies in the vertical plane along its length, ``pitch`` below the horizontal (pi/2: from above;
beyond: from the other end). ``depth`` is the distance of the palm from the box's nearest corner,
``offset`` moves the tool along its own z axis. One rule says which of them hold the box, for coarse
bound, path bound and verification: the palm is outside of it, by ``PALM_GAP`` or more, and the
tool frame's origin, which is between the fingertips, is over its side, by ``INSET`` or more.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import product
from typing import Any

import casadi as ca
import numpy as np

from guided_lgp.bounds.program.geometry import GraspSide, SceneGeometry
from guided_lgp.bounds.program.kernels import absolute
from guided_lgp.bounds.program.slots import HeldBox
from guided_lgp.bounds.results import Array
from guided_lgp.poses import compose, inverse, multiply, pose, rotation_matrix
from guided_lgp.robots import Arm
from guided_lgp.scene.grasps import is_held_flat
from guided_lgp.scene.tolerances import GRASP_ANGLE, GRASP_OFFSET

PALM_GAP = 0.002
"""Least distance of the box's nearest corner from the palm (m)."""
INSET = 0.003
"""How far inside the box's side the tool frame's origin is at least (m): a box of 25 mm on a table
is grasped from above only so. Fingertips reach 3 to 19 mm beyond that point and 11 mm to its sides,
so at least 6 by 14 mm of them are on the box."""
_SAME = 1e-4
"""Difference (m, or sine of half an angle) of poses that are one."""
ROLL = rotation_matrix(np.array([np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]))
"""From the tool frame of a hand that closes on top and bottom to the one that pitch is said of."""
Hand = tuple[float, float]
"""Offset of a hand and its depth (m)."""
Grip = tuple[float, float, float]
"""Pitch (rad), offset and depth (m)."""


@lru_cache(maxsize=256)
def grasp_sides(geometry: SceneGeometry, box: str, arm: Arm) -> tuple[GraspSide, ...]:
    """The sides of a box that a hand can close on; one for each grasp, where these are given."""
    body, half_height = geometry.movable[box], geometry.bodies[box].half[2]
    if not body.grasps:
        return _free_sides(geometry, box, arm)
    found = (
        read_grip(
            grasp, sides_of(geometry, box, arm, grasp), half_height, arm.palm_front, loosely=True
        )
        for grasp in inverse(body.grasp_poses)
    )
    return tuple(replace(side, given=grip) for side, grip in filter(None, found))


def _free_sides(geometry: SceneGeometry, box: str, arm: Arm) -> tuple[GraspSide, ...]:
    """Upright sides; where none are near enough to each other, top and bottom, if they may be."""
    widest = arm.fingers.grasp_width
    upright = geometry.grasp_sides(box, widest)
    flat = not upright and is_held_flat(geometry.movable[box], geometry.scene.bodies, widest)
    return tuple(_flat_sides(geometry.bodies[box].half, arm)) if flat else upright


def _flat_sides(half: tuple[float, float, float], arm: Arm) -> Iterator[GraspSide]:
    """Top and bottom, for a hand that comes from each end, either way up."""
    hx, hy, hz = half
    for quarter, pitch in product(range(4), (0.0, np.pi)):
        length = hy if quarter % 2 else hx
        fingers = -arm.palm_front - INSET
        deepest = max(PALM_GAP, fingers + 2 * (INSET - length))
        yield GraspSide(
            quarter * np.pi / 2,
            length,
            2 * hz,
            (length, hz),
            given=(pitch, 0.0, deepest),
            flat=True,
            slack=fingers - deepest,
        )


def sides_of(geometry: SceneGeometry, box: str, arm: Arm, grasp: Array) -> tuple[GraspSide, ...]:
    """The sides on which a grasp may close, a pose (7,) of the box in the tool frame.

    Of a cylinder that is the one that the fingers are at; of its top and bottom, the one from which
    the hand comes.
    """
    sides = _free_sides(geometry, box, arm)
    if not geometry.is_round(box) or not sides:
        return sides
    approach, closing, _ = rotation_matrix(inverse(grasp)[3:]).T
    x, y = (-approach[1], approach[0]) if sides[0].flat else closing[:2]
    return (replace(sides[0], turn=float(np.arctan2(-x, y))),)


def tool_target(pose: Any, height: Any, grip: Any, p: Any, palm_front: float) -> tuple[Any, Any]:
    """Where the tool must be to hold a level box, symbolically.

    Args:
        pose: (x, y, yaw) of the box.
        height: z of its centre (m).
        grip: pitch of the approach (rad), in [0, pi]; offset along the tool's z axis (m); depth,
            the palm's distance from the box (m).
        p: (half length, half height, turn of the length against the box's x axis, distance back
            along the approach).
        palm_front: x of the palm's front in the tool frame (m).

    Returns:
        position (3,) and rotation (3, 3) of the tool.
    """
    half_length, half_height, turn, back = (p[i] for i in range(4))
    pitch, offset, depth = (grip[i] for i in range(3))
    heading = pose[2] + turn
    ch, sh, cp, sp = ca.cos(heading), ca.sin(heading), ca.cos(pitch), ca.sin(pitch)
    x_axis = ca.vertcat(ch * cp, sh * cp, -sp)
    y_axis = ca.vertcat(-sh, ch, 0)
    z_axis = ca.vertcat(ch * sp, sh * sp, cp)
    extent = half_length * absolute(cp) + half_height * sp + palm_front + depth
    centre = ca.vertcat(pose[0], pose[1], height)
    return centre - (extent + back) * x_axis - offset * z_axis, ca.horzcat(x_axis, y_axis, z_axis)


def tool_targets(
    held: HeldBox, hand: Hand, poses: Array, pitches: Array, ends: Array, palm_front: float
) -> tuple[Array, Array]:
    """The same in numbers, over a grid.

    Args:
        held: the grasp's lengths and turn.
        hand: offset along the tool's z axis and depth (m).
        poses: (N, 4) x, y, yaw and z of the box.
        pitches: (M,) of the approach (rad).
        ends: (E, 2) how far the tool is back along its approach and up (m).
        palm_front: x of the palm's front in the tool frame (m).

    Returns:
        rotation (N, M, 1, 3, 3) and position (N, M, E, 3) of the tool.
    """
    heading = (poses[:, 2] + held.side.turn)[:, None]
    ch, sh, cp, sp = np.cos(heading), np.sin(heading), np.cos(pitches), np.sin(pitches)
    zero = np.zeros(np.broadcast_shapes(ch.shape, cp.shape))
    x_axis = np.stack([ch * cp, sh * cp, zero - sp], axis=-1)
    y_axis = np.stack([zero - sh, zero + ch, zero], axis=-1)
    z_axis = np.stack([ch * sp, sh * sp, zero + cp], axis=-1)
    offset, depth = hand
    extent = held.side.half_length * np.abs(cp) + held.half_height * sp + palm_front + depth
    contact = poses[:, None, [0, 1, 3]] - extent[:, None] * x_axis - offset * z_axis
    position = contact[:, :, None] - ends[:, :1] * x_axis[:, :, None]
    position[..., 2] += ends[:, 1]
    rotation = np.stack([x_axis, y_axis, z_axis], axis=-1)[:, :, None]
    return rotation @ ROLL.T if held.side.flat else rotation, position


def in_tool(held: HeldBox, values: Array, palm_front: float) -> Array:
    """Pose (7,) of a held box in the tool frame of its gripper."""
    pitch, offset, depth = values[list(held.grip)]
    extent = held.side.half_length * abs(np.cos(pitch)) + held.half_height * np.sin(pitch)
    level = np.array([0.0, -np.sin(pitch / 2), 0.0, np.cos(pitch / 2)])
    turned = multiply(level, _turned_back(held.side.turn))
    placement = np.array([extent + palm_front + depth, 0.0, offset, *turned])
    return compose(_rolled(1), placement) if held.side.flat else placement


@lru_cache(maxsize=256)
def _turned_back(turn: float) -> Array:
    """Quaternion (4,) of the opposite turn about z (rad)."""
    return pose((0, 0, 0), -turn)[3:]


def read_grip(
    grasp: Array,
    sides: Sequence[GraspSide],
    half_height: float,
    palm_front: float,
    loosely: bool = False,
) -> tuple[GraspSide, Grip] | None:
    """The side, and pitch, offset and depth, of the pose (7,) of a box in the tool frame.

    The inverse of :func:`in_tool`; None if the hand does not hold the box so, or ``loosely``: if it
    holds it farther from there than a grasp may be off.
    """
    off, turned_off = (GRASP_OFFSET, GRASP_ANGLE / 2) if loosely else (_SAME, _SAME)
    for side, about in product(sides, (0.0, np.pi)):
        turned = replace(side, turn=side.turn + about)
        seen = compose(_rolled(-1), grasp) if side.flat else grasp
        x, y, z, w = multiply(seen[3:], pose((0, 0, 0), turned.turn)[3:]).tolist()
        pitch = float((2 * np.arctan2(-y, w) + np.pi / 2) % (2 * np.pi) - np.pi / 2)
        across = max(abs(x), abs(z)) < turned_off and abs(seen[1]) < off
        if side.flat:  # the hand comes level, and the body is in the middle between the fingers
            across &= abs(np.sin(pitch)) < turned_off and abs(seen[2]) < off
        if across and -turned_off <= pitch <= np.pi + turned_off:
            extent = side.half_length * abs(np.cos(pitch)) + half_height * np.sin(pitch)
            return turned, (pitch, float(seen[2]), float(grasp[0] - extent - palm_front))
    return None


def _rolled(sense: int) -> Array:
    """Pose (7,) of that quarter turn about the approach, or of the one back."""
    return np.array([0.0, 0.0, 0.0, sense * np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)])
