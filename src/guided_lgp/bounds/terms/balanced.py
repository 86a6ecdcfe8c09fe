"""``balanced(box, support)``: the centres of mass of a stack are above what supports it."""

from collections.abc import Mapping
from functools import lru_cache

import casadi as ca
import numpy as np

from guided_lgp.bounds.checks import Pose, Top, Vector, axes_of, dot
from guided_lgp.bounds.program.context import Context
from guided_lgp.bounds.program.kernels import SCALE, Kernel, in_frame, kernel
from guided_lgp.bounds.program.kinematics import RobotKinematics
from guided_lgp.bounds.program.slots import ZERO
from guided_lgp.bounds.terms.term import Term, put_down
from guided_lgp.scene.tolerances import BALANCE_INSET, LEVEL_ANGLE

SUMS = {"balanced": 8, "balanced_tower": 32}
"""Kernels, and most boxes in their sums of weights: a sum costs as much as it is long."""
_LEAST = 1e-3
"""Half (m) of the area that is left on a support narrower than the margins."""


def _kernels(robot: RobotKinematics) -> tuple[Kernel, ...]:
    return tuple(_kernel(name, most) for name, most in SUMS.items())


def _kernel(name: str, most: int) -> Kernel:
    """The centre of mass of up to so many boxes is inside the top of their support."""
    x, p = ca.SX.sym("x", 3 + 2 * most), ca.SX.sym("p", 2 + most)
    points = ca.reshape(x[3:], 2, most)
    along, across = in_frame(x[2], ca.mtimes(points, p[2:]) - x[:2])
    c = ca.vertcat(p[0] - along, p[0] + along, p[1] - across, p[1] + across)
    return kernel(name, x, p, SCALE * c)


def inner(context: Context, support: str, height: float = 0.0) -> tuple[float, float]:
    """Half extents (m) of the part of a support's top in which a centre of mass may be.

    Of a stack of a height (m), the margin is at least as far as its top goes to the side where it
    leans by what passes for level: twice what its middle does, which verification asks for.
    """
    along, across = context.geometry.bodies[support].rest
    margin = max(context.margins.balanced, LEVEL_ANGLE * height)
    return max(along - margin, _LEAST), max(across - margin, _LEAST)


def _add(context: Context, box: str, support: str) -> None:
    """Of the box with all that it carries, after the action, and of all that is below it."""
    stack = (box, *context.after.carried_by(box))[: max(SUMS.values())]  # verification judges all
    _rows(context, stack, support)
    if context.unaided:
        _rows(context, stack[:1], support)
    below = context.after.support_of(support)
    if below is not None:
        _add(context, support, below)


def _rows(context: Context, stack: tuple[str, ...], support: str) -> None:
    """Of a box with some that it carries, unless they are there or nothing can change them."""
    key = (support, *((name, context.pose[name].plane) for name in stack))
    if key in context.balanced or not any(context.pose[name].varies for name in stack):
        return
    context.balanced.add(key)
    kernel_name, most = next(sums for sums in SUMS.items() if sums[1] >= len(stack))
    masses = tuple(context.geometry.bodies[name].mass for name in stack)
    inputs = list(context.pose[support].plane)
    for name in stack:
        inputs += (context.pose[name].x, context.pose[name].y)
    inputs += [ZERO] * (2 * (most - len(stack)))
    context.rows(
        kernel_name,
        inputs,
        (*inner(context, support, _height(context, stack[0])), *_shares(masses, most)),
        ("balanced", stack[0], support),
    )


@lru_cache(maxsize=256)
def _shares(masses: tuple[float, ...], most: int) -> tuple[float, ...]:
    """Of the sum of some masses; 0 for what is missing to so many."""
    shares = (np.array(masses) / np.sum(masses)).tolist()
    return (*shares, *[0.0] * (most - len(masses)))


def _height(context: Context, box: str) -> float:
    """Of a box with all that it carries (m)."""
    above = [_height(context, other) for other in context.after.standing_on(box)]
    return 2 * context.half(box)[2] + max(above, default=0.0)


def check(
    box: str,
    boxes: Mapping[str, Pose],
    masses: Mapping[str, float],
    support: Mapping[str, str],
    top: Top,
    placed: bool = True,
) -> float:
    """By how much (m) the centre of mass of a stack is outside of what carries it.

    Where a plan puts it, it keeps an inset, and stays inside if all leans by what passes for level.

    Args:
        box: at the bottom of the stack.
        boxes: poses of all boxes.
        masses: of all of them, in any unit.
        support: what each stands on.
        top: of the box's support.
        placed: whether a plan has put something there.
    """
    x, y, z = _centre_of_mass(box, boxes, masses, support)
    offset, axes = (x - top.pose[0], y - top.pose[1], 0.0), axes_of(top.pose)
    inset = max(BALANCE_INSET, LEVEL_ANGLE * (z - top.height)) if placed else 0.0
    return max(abs(dot(offset, axes[axis])) - top.half[axis] + inset for axis in (0, 1))


def leans(box: str, boxes: Mapping[str, Pose], masses: Mapping[str, float], top: Top) -> bool:
    """Whether a box that a plan puts down stands there only by what it carries; see ``check``."""
    return check(box, boxes, masses, {}, top) > 0


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
