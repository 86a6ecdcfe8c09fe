"""``pads(gripper, box)``: the fingertips lie on the side of the box that they close on."""

import casadi as ca

from guided_lgp.bounds.checks import Pose, Vector, axes_of, closing_axis, dot, offset_of
from guided_lgp.bounds.program.context import Context
from guided_lgp.bounds.program.grasp import INSET, tool_target
from guided_lgp.bounds.program.kernels import SCALE, Kernel, kernel
from guided_lgp.bounds.program.kinematics import Chain, RobotKinematics
from guided_lgp.bounds.terms.hold import grip
from guided_lgp.bounds.terms.term import Term

TOLERANCE = 0.001
"""By how much (m) a grasp that is looked at may be off that rule."""


def _kernel(chain: Chain) -> Kernel:
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p", 2)
    grasp = ca.vertcat(p[0], p[1], 0, 0)
    target, _ = tool_target(ca.SX.zeros(3), 0, x, grasp, chain.palm_front)
    c = ca.vertcat(
        *(
            half - INSET - sign * target[axis]
            for sign in (1, -1)
            for axis, half in ((0, p[0]), (2, p[1]))
        )
    )
    return kernel(f"pads_{chain.name}", x, p, SCALE * c)


def _kernels(robot: RobotKinematics) -> tuple[Kernel, ...]:
    return tuple(map(_kernel, robot.chains))


def _add(context: Context, gripper: str, box: str) -> None:
    """On a grasp's variables alone: one constraint for all configurations of its mode."""
    held = grip(context, gripper, box)
    context.rows(
        f"pads_{context.robot.arms[gripper].chain.name}",
        held.grip,
        (held.side.half_length, held.half_height),
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
    along = (axis for axis in range(3) if axis != closing_axis(placement, tool))
    outside = (abs(dot(offset, sides[axis])) - size[axis] / 2 for axis in along)
    return max(outside) + INSET - TOLERANCE


TERM = Term(_add, _kernels)
