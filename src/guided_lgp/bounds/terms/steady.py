"""``steady(gripper)``: what stands on a box does not turn it between the pads of the gripper.

Plans for users ask for it of every hand, with a margin for what accelerates the load; the paper
does not. It is on how the box is held and on where the others stand on it, so a program takes the
box nearer to what it will carry, or puts that nearer to the hand.
"""

import math
from collections.abc import Sequence

import casadi as ca

from guided_lgp.bounds.checks import GRAVITY, Pose, Vector, axes_of, closing_axis, dot, offset_of
from guided_lgp.bounds.program.context import Context
from guided_lgp.bounds.program.grasp import tool_target
from guided_lgp.bounds.program.kernels import SCALE, Kernel, in_frame, kernel
from guided_lgp.bounds.program.kinematics import Chain, RobotKinematics
from guided_lgp.bounds.program.slots import ZERO, HeldBox
from guided_lgp.bounds.terms.term import Term
from guided_lgp.robots import Fingers
from guided_lgp.scene.shapes import Convex
from guided_lgp.scene.world import BOX_DENSITY

FRICTION = 0.6
"""Coefficient of friction that grips are made for: cardboard on rubber."""
RATIO = 0.5
"""Share of what the pads can carry that a load should take ..."""
AT_REST = 0.38
"""... and at rest, so that its acceleration leaves that much."""
_MOST = 8
"""Boxes that the sum of weights has room for; of more, the verdict on the motion judges."""
_LEAST_SHARE = 0.1
"""Of a pad that is on the box, so that no load is infinite."""


def _kernel(chain: Chain) -> Kernel:
    """How far the common centre of mass is from the hand, along the sides that fingers close on."""
    x, p = ca.SX.sym("x", 6 + 2 * _MOST), ca.SX.sym("p", 4 + _MOST)
    grip, pose, points = x[:3], x[3:6], ca.reshape(x[6:], 2, _MOST)
    bound, shares = p[3], p[4:]
    turned, grasp = ca.vertcat(0, 0, pose[2]), ca.vertcat(p[:3], 0)
    tool, _ = tool_target(turned, 0, grip, grasp, chain.palm_front)
    centre = ca.mtimes(points, shares) - ca.sum1(shares) * pose[:2]
    lever, _ = in_frame(pose[2] + p[2], centre - tool[:2])
    return kernel(f"steady_{chain.name}", x, p, SCALE * ca.vertcat(bound - lever, bound + lever))


def _kernels(robot: RobotKinematics) -> tuple[Kernel, ...]:
    return tuple(map(_kernel, robot.chains))


def _add(context: Context, gripper: str) -> None:
    """Whatever the hand takes, see :func:`keep_steady`."""
    context.steady |= {gripper}


def keep_steady(context: Context) -> None:
    """Of every box in a hand that carries others after the action."""
    for box, held in context.held.items():
        riders = context.after.carried_by(box)
        chosen = held.given is None and not held.side.flat
        if held.gripper in context.steady and chosen and 0 < len(riders) <= _MOST:
            _rows(context, held, riders)


def _rows(context: Context, held: HeldBox, riders: Sequence[str]) -> None:
    arm = context.robot.arms[held.gripper]
    masses = [context.geometry.bodies[name].mass for name in (held.box, *riders)]
    shares = [mass / sum(masses) for mass in masses[1:]] + [0.0] * (_MOST - len(riders))
    points = [slot for name in riders for slot in context.pose[name].plane[:2]]
    points += [ZERO] * (2 * _MOST - len(points))
    weight = BOX_DENSITY * sum(masses) * GRAVITY
    bound = AT_REST * 2 * FRICTION * arm.arm.fingers.force * arm.arm.fingers.pad / weight
    context.rows(
        f"steady_{arm.chain.name}",
        (*held.grip, *context.pose[held.box].plane, *points),
        (held.side.half_length, held.half_height, held.side.turn, bound, *shares),
        ("steady", held.gripper, held.box),
    )


def check(
    body: Convex,
    placement: Pose,
    tool: Pose,
    fingers: Fingers,
    loads: Sequence[tuple[float, Vector]],
) -> float:
    """The share of what the pads can carry that a load at rest takes.

    Args:
        body: the box that they press on.
        placement: its pose.
        tool: pose of the gripper's tool frame.
        fingers: of the gripper.
        loads: volume (m³) and centre (m) of the box and of all that it carries.
    """
    (cx, cy, cz), middle = axes_of(tool)[1], offset_of(placement, tool)
    across, twist = closing_axis(placement, tool), 0.0
    for volume, centre in loads:
        twist += volume * ((centre[1] - tool[1]) * cx - (centre[0] - tool[0]) * cy)
    sides = axes_of(placement)
    share = on_box(body, [dot(middle, side) for side in sides], across, fingers.pad)
    sideways = sum(volume for volume, _ in loads) * math.sqrt(max(0.0, 1 - cz * cz))
    need = max(sideways, abs(twist) / (fingers.pad * share)) * BOX_DENSITY * GRAVITY
    return need / (2 * FRICTION * fingers.force)


def on_box(body: Convex, middle: Sequence[float], across: int, pad: float) -> float:
    """How much of a square pad lies on the side of the box that it presses on.

    Args:
        body: the box.
        middle: of the pad, in the frame of the box (m).
        across: axis along which the fingers close.
        pad: mean distance of its points from the middle (m).
    """
    half, touched = pad / math.sqrt(2), body.side(across)
    share = 1.0
    for axis in range(3):
        if axis != across:
            over = (touched[axis] - abs(middle[axis]) + half) / (2 * half)
            share *= min(max(over, 0.0), 1.0)
    return max(_LEAST_SHARE, share)


TERM = Term(_add, _kernels, part="lasting")
