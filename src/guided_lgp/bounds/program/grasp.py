"""Where the tool is on a box that it holds.

A grasp has a pitch and an offset. The fingers close across the box's width; the approach axis lies
in the vertical plane along its length, ``pitch`` below the horizontal (pi/2: from above; beyond:
from the other end). The palm touches the box's nearest corner, ``offset`` moves the tool along its
own z axis.
"""

from typing import Any

import casadi as ca
import numpy as np

from guided_lgp.bounds.program.kernels import absolute
from guided_lgp.bounds.program.slots import HeldBox
from guided_lgp.bounds.results import Array
from guided_lgp.poses import multiply, pose

PALM_GAP = 0.002
"""Distance of the box's nearest corner from the palm (m)."""


def tool_target(
    pose: Any, height: Any, pitch: Any, offset: Any, p: Any, palm_front: float
) -> tuple[Any, Any]:
    """Where the tool must be to hold a level box, symbolically.

    Args:
        pose: (x, y, yaw) of the box.
        height: z of its centre (m).
        pitch: of the approach (rad), in [0, pi].
        offset: along the tool's z axis (m).
        p: (half length, half height, turn of the length against the box's x axis, distance back
            along the approach).
        palm_front: x of the palm's front in the tool frame (m).

    Returns:
        position (3,) and rotation (3, 3) of the tool.
    """
    half_length, half_height, turn, back = (p[i] for i in range(4))
    heading = pose[2] + turn
    ch, sh, cp, sp = ca.cos(heading), ca.sin(heading), ca.cos(pitch), ca.sin(pitch)
    x_axis = ca.vertcat(ch * cp, sh * cp, -sp)
    y_axis = ca.vertcat(-sh, ch, 0)
    z_axis = ca.vertcat(ch * sp, sh * sp, cp)
    reach = half_length * absolute(cp) + half_height * sp + palm_front + PALM_GAP
    centre = ca.vertcat(pose[0], pose[1], height)
    return centre - (reach + back) * x_axis - offset * z_axis, ca.horzcat(x_axis, y_axis, z_axis)


def tool_targets(
    held: HeldBox, offset: float, poses: Array, pitches: Array, ends: Array, palm_front: float
) -> tuple[Array, Array]:
    """The same in numbers, over a grid.

    Args:
        held: the grasp's lengths and turn.
        offset: along the tool's z axis (m).
        poses: (N, 4) x, y, yaw and z of the box.
        pitches: (M,) of the approach (rad).
        ends: (E, 2) how far the tool is back along its approach and up (m).
        palm_front: x of the palm's front in the tool frame (m).

    Returns:
        rotation (N, M, 1, 3, 3) and position (N, M, E, 3) of the tool.
    """
    heading = (poses[:, 2] + held.turn)[:, None]
    ch, sh, cp, sp = np.cos(heading), np.sin(heading), np.cos(pitches), np.sin(pitches)
    zero = np.zeros(np.broadcast_shapes(ch.shape, cp.shape))
    x_axis = np.stack([ch * cp, sh * cp, zero - sp], axis=-1)
    y_axis = np.stack([zero - sh, zero + ch, zero], axis=-1)
    z_axis = np.stack([ch * sp, sh * sp, zero + cp], axis=-1)
    depth = held.half_length * np.abs(cp) + held.half_height * sp + palm_front + PALM_GAP
    contact = poses[:, None, [0, 1, 3]] - depth[:, None] * x_axis - offset * z_axis
    position = contact[:, :, None] - ends[:, :1] * x_axis[:, :, None]
    position[..., 2] += ends[:, 1]
    return np.stack([x_axis, y_axis, z_axis], axis=-1)[:, :, None], position


def in_tool(held: HeldBox, values: Array, palm_front: float) -> Array:
    """Pose (7,) of a held box in the tool frame of its gripper."""
    pitch, offset = values[held.pitch], values[held.offset]
    reach = held.half_length * abs(np.cos(pitch)) + held.half_height * np.sin(pitch)
    level = np.array([0.0, -np.sin(pitch / 2), 0.0, np.cos(pitch / 2)])
    turned = multiply(level, pose((0, 0, 0), -held.turn)[3:])
    return np.array([reach + palm_front + PALM_GAP, 0.0, offset, *turned])
