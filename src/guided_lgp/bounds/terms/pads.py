"""``pads(gripper, box)``: the fingertips lie on the side of the box that they close on."""

import math
from collections.abc import Iterator

import casadi as ca

from guided_lgp.bounds.checks import Pose, axes_of, closing_axis, dot, offset_of
from guided_lgp.bounds.program.context import Context
from guided_lgp.bounds.program.grasp import INSET, tool_target
from guided_lgp.bounds.program.kernels import SCALE, Kernel, kernel
from guided_lgp.bounds.program.kinematics import Chain, RobotKinematics
from guided_lgp.bounds.terms.hold import grip
from guided_lgp.bounds.terms.term import Term
from guided_lgp.logic.declarations import Instruction, Variable
from guided_lgp.scene.shapes import Convex

_UP = 2
TOLERANCE = 0.001
"""By how much (m) a grasp that is looked at may be off that rule."""


def _kernel(chain: Chain) -> Kernel:
    x, p = ca.SX.sym("x", 3), ca.SX.sym("p", 4)
    grasp = ca.vertcat(p[0], p[1], 0, 0)
    target, _ = tool_target(ca.SX.zeros(3), 0, x, grasp, chain.palm_front)
    c = ca.vertcat(
        *(
            half - INSET - sign * target[axis]
            for sign in (1, -1)
            for axis, half in ((0, p[2]), (2, p[3]))
        )
    )
    return kernel(f"pads_{chain.name}", x, p, SCALE * c)


def _kernels(robot: RobotKinematics) -> tuple[Kernel, ...]:
    return tuple(map(_kernel, robot.chains))


def _add(context: Context, gripper: str, box: str) -> None:
    """On a grasp's variables alone: one constraint for all configurations of its mode.

    What grasps the scene gives is the scene's matter.
    """
    held = grip(context, gripper, box)
    if held.given is not None:
        return
    context.rows(
        f"pads_{context.robot.arms[gripper].chain.name}",
        held.grip,
        (held.side.half_length, held.half_height, *held.side.touched),
        ("pads", gripper, box),
    )


def check(body: Convex, placement: Pose, tool: Pose) -> float:
    """By how much (m) the fingertips' centre is not on the box's side: negative where it is.

    Args:
        body: the box.
        placement: its pose.
        tool: pose of the gripper's tool frame.
    """
    axes, offset = axes_of(placement), offset_of(tool, placement)
    across = closing_axis(placement, tool)
    touched, along = body.side(across), (axis for axis in range(3) if axis != across)
    if body.shape == "cylinder" and across == _UP:
        away = math.hypot(*(dot(offset, axes[axis]) for axis in along))
        return away - body.half[0] + INSET - TOLERANCE
    outside = (abs(dot(offset, axes[axis])) - touched[axis] for axis in along)
    return max(outside) + INSET - TOLERANCE


def _needed(one: Instruction) -> Iterator[tuple[Variable, ...]]:
    """Of every new grasp."""
    if one.into_hand:
        yield one.attached.parent, one.attached.body


TERM = Term(_add, _kernels, needed=_needed)
