"""``balanced(box, support)``: the centres of mass of a stack are above what supports it."""

from collections.abc import Mapping

import casadi as ca
import numpy as np

from guided_lgp.bounds.checks import Pose, Top, Vector, axes_of, dot
from guided_lgp.bounds.program.context import Context
from guided_lgp.bounds.program.kernels import SCALE, Kernel, in_frame, kernel
from guided_lgp.bounds.program.kinematics import RobotKinematics
from guided_lgp.bounds.program.slots import ZERO
from guided_lgp.bounds.terms.term import Term, put_down
from guided_lgp.scene.tolerances import BALANCE_INSET

STACK = 8
"""Most boxes in one sum of weights."""
_LEAST = 1e-3
"""Half (m) of the area that is left on a support narrower than the margins."""


def _kernels(robot: RobotKinematics) -> tuple[Kernel, ...]:
    """The centre of mass of up to ``STACK`` boxes is inside the top of their support."""
    x, p = ca.SX.sym("x", 3 + 2 * STACK), ca.SX.sym("p", 2 + STACK)
    points = ca.reshape(x[3:], 2, STACK)
    along, across = in_frame(x[2], ca.mtimes(points, p[2:]) - x[:2])
    c = ca.vertcat(p[0] - along, p[0] + along, p[1] - across, p[1] + across)
    return (kernel("balanced", x, p, SCALE * c),)


def inner(context: Context, support: str) -> tuple[float, float]:
    """Half extents (m) of the part of a support's top in which a centre of mass may be."""
    (along, across), margin = context.geometry.bodies[support].rest, context.margins.balanced
    return max(along - margin, _LEAST), max(across - margin, _LEAST)


def _add(context: Context, box: str, support: str) -> None:
    """Of the box with all that it carries, after the action, and of all that is below it."""
    stack = (box, *context.after.carried_by(box))[:STACK]  # of higher towers, verification judges
    key = (support, *((name, context.pose[name].plane) for name in stack))
    if key not in context.balanced and any(context.pose[name].varies for name in stack):
        context.balanced.add(key)
        _rows(context, stack, support)
    below = context.after.support_of(support)
    if below is not None:
        _add(context, support, below)


def _rows(context: Context, stack: tuple[str, ...], support: str) -> None:
    masses = np.array([context.geometry.bodies[name].mass for name in stack])
    shares = [*(masses / masses.sum()), *[0.0] * (STACK - len(stack))]
    points = [slot for name in stack for slot in context.pose[name].plane[:2]]
    points += [ZERO] * (2 * STACK - len(points))
    context.rows(
        "balanced",
        (*context.pose[support].plane, *points),
        (*inner(context, support), *shares),
        ("balanced", stack[0], support),
    )


def check(
    box: str,
    boxes: Mapping[str, Pose],
    masses: Mapping[str, float],
    support: Mapping[str, str],
    top: Top,
) -> float:
    """By how much (m) the centre of mass of a stack is outside of what carries it.

    Args:
        box: at the bottom of the stack.
        boxes: poses of all boxes.
        masses: of all of them, in any unit.
        support: what each stands on.
        top: of the box's support.
    """
    x, y, _ = _centre_of_mass(box, boxes, masses, support)
    offset, axes = (x - top.pose[0], y - top.pose[1], 0.0), axes_of(top.pose)
    return max(abs(dot(offset, axes[axis])) - top.half[axis] + BALANCE_INSET for axis in (0, 1))


def whole_stack(box: str, support: Mapping[str, str]) -> list[str]:
    """A box and all that it carries."""
    group = [box]
    for base in group:  # grows while it is walked
        group += [above for above, below in support.items() if below == base]
    return group


def _centre_of_mass(
    box: str,
    boxes: Mapping[str, Pose],
    masses: Mapping[str, float],
    support: Mapping[str, str],
) -> Vector:
    """Of the box and everything it carries."""
    if box not in support.values():
        x, y, z = boxes[box][:3]
        return x, y, z
    group = whole_stack(box, support)
    weights = [masses[name] for name in group]
    x, y, z = (
        sum(w * boxes[name][axis] for w, name in zip(weights, group, strict=True)) / sum(weights)
        for axis in range(3)
    )
    return x, y, z


TERM = Term(_add, _kernels, needed=put_down)
