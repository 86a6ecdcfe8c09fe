"""``pads(gripper, box)``: fingertips and pads lie on the side of the box that they close on."""

import casadi as ca

from guided_lgp.bounds.checks import Pose, Vector, axes_of, dot, offset_of
from guided_lgp.bounds.program.context import Context
from guided_lgp.bounds.program.grasp import tool_target
from guided_lgp.bounds.program.kernels import SCALE, Kernel, kernel
from guided_lgp.bounds.program.kinematics import Chain, RobotKinematics
from guided_lgp.bounds.terms.hold import PAD_MARGIN, grip
from guided_lgp.bounds.terms.term import Term
from guided_lgp.scene.model import grasp_axis

PAD_CENTRE = -0.02
"""x of the centre of the fingertips' pads in the tool frame (m)."""
GRASP_INSET = 0.005
"""How far inside the box's side the fingertips' centre lies at least (m)."""


def _kernel(chain: Chain) -> Kernel:
    x, p = ca.SX.sym("x", 2), ca.SX.sym("p", 4)
    pitch, offset = x[0], x[1]
    grasp = ca.vertcat(p[0], p[1], 0, 0)
    target, rotation = tool_target(ca.SX.zeros(3), 0, pitch, offset, grasp, chain.palm_front)
    pad = target + PAD_CENTRE * rotation[:, 0]
    c = ca.vertcat(
        *(
            limit - sign * point[axis]
            for point in (target, pad)
            for sign in (1, -1)
            for axis, limit in ((0, p[2]), (2, p[3]))
        )
    )
    return kernel(f"pads_{chain.name}", x, p, SCALE * c)


def _kernels(robot: RobotKinematics) -> tuple[Kernel, ...]:
    return tuple(map(_kernel, robot.chains))


def _add(context: Context, gripper: str, box: str) -> None:
    """On a grasp's two variables alone: one constraint for all configurations of its mode."""
    held = grip(context, gripper, box)
    inner = (held.half_length - PAD_MARGIN, held.half_height - PAD_MARGIN)
    context.rows(
        f"pads_{context.robot.arms[gripper].chain.name}",
        (held.pitch, held.offset),
        (held.half_length, held.half_height, *inner),
        ("pads", gripper, box),
    )


def check(size: Vector, placement: Pose, tool: Pose) -> float:
    """By how much (m) the fingertips' centre is not on the box's side: negative where it is.

    Args:
        size: extents (m) of the box.
        placement: its pose.
        tool: pose of the gripper's tool frame.
    """
    sides, offset = axes_of(placement), offset_of(tool, placement)
    along = (axis for axis in range(3) if axis != grasp_axis(size))
    return max(abs(dot(offset, sides[axis])) - (size[axis] / 2 - GRASP_INSET) for axis in along)


TERM = Term(_add, _kernels)
