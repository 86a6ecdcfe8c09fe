"""``carried(box)``: what stands on a box keeps its place on it while the box is moved."""

import math
from typing import Any

import casadi as ca
import numpy as np

from guided_lgp.bounds.checks import Pose, angle_of, axes_of, dot, offset_of
from guided_lgp.bounds.program.context import Context
from guided_lgp.bounds.program.draft import Draft
from guided_lgp.bounds.program.kernels import SCALE, Kernel, in_frame, kernel
from guided_lgp.bounds.program.kinematics import RobotKinematics
from guided_lgp.bounds.program.slots import PlanarPose
from guided_lgp.bounds.results import Array
from guided_lgp.bounds.terms.term import Term

RIGID_POSITION, RIGID_ANGLE = 0.001, 0.01
"""How far (m, rad) a box may slip between keyframes in what holds or supports it."""


def _kernels(robot: RobotKinematics) -> tuple[Kernel, ...]:
    """Relative poses before and after agree."""
    x, p = ca.SX.sym("x", 12), ca.SX.sym("p", 0)

    def relative(below: Any, above: Any) -> Any:
        return ca.vertcat(*in_frame(below[2], above[:2] - below[:2]))

    before, after = relative(x[:3], x[3:6]), relative(x[6:9], x[9:12])
    turn = (x[11] - x[8]) - (x[5] - x[2])
    c = ca.vertcat(SCALE * (after - before), turn)
    return (kernel("carried", x, p, c, equality=True, lengths=2),)


def _add(context: Context, box: str) -> None:
    """What stands on the box goes with it from where it was before the action."""
    old, new = context.before[box], context.pose[box]
    for name in context.state.carried_by(box):
        above = context.pose[name]
        rise = above.offset - old.offset
        after = PlanarPose(*context.plane(), new.z, new.offset + rise)
        inputs = (*old.plane, *above.plane, *new.plane, *after.plane)
        context.rows("carried", inputs, (), ("carried", name, box))
        context.pose[name] = after


def carry(draft: Draft, old: Array, before: Array, new: Array, after: PlanarPose) -> None:
    """The start of a pose after a move, from the carrier's old and new one."""
    turn = new[2] - old[2]
    cosine, sine = np.cos(turn), np.sin(turn)
    dx, dy = before[0] - old[0], before[1] - old[1]
    draft.values[after.x] = new[0] + cosine * dx - sine * dy
    draft.values[after.y] = new[1] + sine * dx + cosine * dy
    draft.values[after.yaw] = before[2] + turn


# check

Relative = tuple[list[float], list[float]]
"""Position of a box and cosines of its axes in the frame of what carries it."""


def relative(placement: Pose, carrier: Pose | None) -> Relative:
    """Where a box is in its carrier; in the world without one."""
    if carrier is None:
        return list(placement[:3]), [c for axis in axes_of(placement) for c in axis]
    offset, axes = offset_of(carrier, placement), axes_of(carrier)
    position = [dot(offset, axis) for axis in axes]
    return position, [dot(side, axis) for side in axes_of(placement) for axis in axes]


def check(before: Relative, after: Relative) -> float:
    """By how much more (m or rad) than allowed a box has slipped: negative where it is carried."""
    slip = math.dist(before[0], after[0])
    turn = angle_of((sum(a * b for a, b in zip(before[1], after[1], strict=True)) - 1) / 2)
    return max(slip - RIGID_POSITION, turn - RIGID_ANGLE)


TERM = Term(_add, _kernels)
