"""``beside(box, support)``: a box that is put down, or lifted, passes its neighbours.

A line, seen from above, separates the box and each neighbour that it meets on its straight way: its
angle is a variable of the pair. What ends below the box, or begins above its way, is none.
"""

import math
from collections.abc import Iterator, Sequence
from math import cos, sin
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from guided_lgp.bounds.program.context import Context
from guided_lgp.bounds.program.draft import Draft
from guided_lgp.bounds.program.kernels import SCALE, Kernel, absolute, kernel
from guided_lgp.bounds.program.kinematics import RobotKinematics
from guided_lgp.bounds.program.slots import PlanarPose
from guided_lgp.bounds.terms.term import Term, put_down
from guided_lgp.logic.declarations import Instruction, Variable

_TOUCH = 0.002
"""Heights (m) that differ by less are one."""


class Separation(NamedTuple):
    """Two level boxes beside each other, and the slot of the angle that separates them."""

    angle: int
    first: PlanarPose
    second: PlanarPose
    halves: tuple[float, float, float, float]

    def start(self, draft: Draft) -> None:
        """The best direction along an axis of the boxes."""
        if self.angle >= draft.kept:
            poses = draft.place(self.first), draft.place(self.second)
            draft.values[self.angle] = _separation(*poses, self.halves)[1]

    def overlap(self, draft: Draft, first: Sequence[Sequence[float]]) -> list[float]:
        """How much (m) the first box, if it stood at each of these places, would overlap."""
        second, (a, b, c, d) = draft.place(self.second), self.halves
        reach = math.hypot(a, b) + math.hypot(c, d)
        return [
            max(0.0, -_separation(place, second, self.halves, enough=0.0)[0])
            if math.dist(place[:2], second[:2]) < reach
            else 0.0
            for place in first
        ]


def _kernels(robot: RobotKinematics) -> tuple[Kernel, ...]:
    x, p = ca.SX.sym("x", 7), ca.SX.sym("p", 5)
    first, second, angle = x[:3], x[3:6], x[6]
    normal = ca.vertcat(ca.cos(angle), ca.sin(angle))
    extent: Any = 0
    for pose, half in ((first, p[:2]), (second, p[2:4])):
        cosine, sine = ca.cos(pose[2]), ca.sin(pose[2])
        extent += half[0] * absolute(normal[0] * cosine + normal[1] * sine)
        extent += half[1] * absolute(-normal[0] * sine + normal[1] * cosine)
    gap = ca.dot(normal, second[:2] - first[:2])
    return (kernel("beside", x, p, SCALE * (gap - extent - p[4])),)


def _add(context: Context, box: str, support: str | None = None) -> None:
    """Of a box, with all that it carries, on its support."""
    moved = (box, *context.state.carried_by(box))
    support = support or context.state.support_of(box)
    geometry = context.geometry
    bodies = (*geometry.boxes, *geometry.supports, *geometry.obstacles)
    others = [n for n in bodies if n not in moved and n != support and not context.at_side(n)]
    rise = max((line.up for line in context.lines), default=0.0)
    for name in moved:
        for other in others:
            if _neighbours(context, name, other, rise):
                _separate(context, name, other)


def _neighbours(context: Context, name: str, other: str, rise: float) -> bool:
    """Whether a box has to be separated from another body: one may move, and their heights meet.

    The box meets it on its way, a ``rise`` (m), too.
    """
    first, second = context.pose[name], context.pose[other]
    if first.z != second.z or not (first.varies or second.varies):
        return False
    apart = second.offset - first.offset
    reach = context.half(name)[2] + context.half(other)[2] - _TOUCH
    return -reach < apart < reach + rise


def _separate(context: Context, name: str, other: str) -> None:
    first, second = context.pose[name], context.pose[other]
    pair = frozenset((first.plane, second.plane))
    if pair in context.separated:
        return
    context.separated.add(pair)
    angle = context.program.variable(-4 * np.pi, 4 * np.pi, 1e-6, 0.0)
    halves = (*context.half(name)[:2], *context.half(other)[:2])
    context.rows(
        "beside",
        (*first.plane, *second.plane, angle),
        (*halves, context.margins.beside),
        ("beside", name, other),
    )
    context.choose(Separation(angle, first, second, halves))


def _separation(
    first: Sequence[float],
    second: Sequence[float],
    halves: tuple[float, float, float, float],
    enough: float = math.inf,
) -> tuple[float, float]:
    """Largest distance (m) along the boxes' axes that separates them, and that direction (rad).

    In plain numbers: for two places many times faster than with arrays. The first distance that is
    enough will do.
    """
    dx, dy, one, other = second[0] - first[0], second[1] - first[1], first[2], second[2]
    along, across, others_along, others_across = halves
    best, direction = -math.inf, 0.0
    for yaw in (one, other):
        for quarter in _QUARTERS:
            angle = yaw + quarter
            distance = dx * cos(angle) + dy * sin(angle)
            distance -= along * abs(cos(angle - one))
            distance -= across * abs(sin(angle - one))
            distance -= others_along * abs(cos(angle - other))
            distance -= others_across * abs(sin(angle - other))
            if distance > best:
                best, direction = distance, angle
                if best >= enough:
                    return best, direction
    return best, direction


_QUARTERS = (0.0, np.pi / 2, np.pi, 3 * np.pi / 2)


def _needed(one: Instruction) -> Iterator[tuple[Variable, ...]]:
    """Of what is put down, and of what is lifted off its support."""
    yield from put_down(one)
    if one.into_hand and one.holder is None:
        yield (one.attached.body,)


TERM = Term(_add, _kernels, needed=_needed)
