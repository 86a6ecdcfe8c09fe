"""``present(body)``: if what the body stands on in the end is in a hand, it is held out, level.

It is held where another hand reaches it: as a support, or to take it.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from guided_lgp.bounds.program.context import Context
from guided_lgp.bounds.program.draft import Draft
from guided_lgp.bounds.program.slots import ArmConfiguration, PlanarPose
from guided_lgp.bounds.terms.hold import configuration, costs_of_both
from guided_lgp.bounds.terms.term import Term
from guided_lgp.logic.declarations import Instruction, Variable

_CANDIDATES = 6
"""Poses drawn, of which the best to reach is taken."""
_PLACE = (0.55, 0.0, 0.95)
"""Where a box is held out, in the robot's frame: the start of the search (m)."""
_FORWARD, _SIDEWAYS = (0.2, 0.9), (-0.6, 0.6)
"""Where it may be held out, in the robot's frame (m)."""
_ABOVE = 0.02
"""How far (m) its bottom is at least above all that stands there."""


@dataclass(frozen=True)
class Offer:
    """An arm that holds its box out: the pose of the box is a choice, too."""

    configuration: ArmConfiguration

    def start(self, draft: Draft) -> None:
        """Of a few poses drawn in front of the robot, one that is reached."""
        held, pose = self.configuration.held, self.configuration.pose
        if pose.x < draft.kept:
            return
        side = draft.robot.arms[held.gripper].left
        candidates = np.empty((_CANDIDATES, 4))
        candidates[:, 0] = draft.generator.uniform(0.4, 0.65, _CANDIDATES)
        candidates[:, 1] = draft.generator.uniform(-0.15, 0.25, _CANDIDATES) * side
        candidates[:, 2] = draft.generator.uniform(-np.pi / 2, np.pi / 2, _CANDIDATES)
        lowest = draft.lower[pose.z]
        candidates[:, 3] = lowest + draft.generator.uniform(0.0, 0.1, _CANDIDATES)
        segments = self.configuration.segments
        best = draft.choose(costs_of_both(draft, held, candidates, segments))
        draft.values[[*pose.plane, pose.z]] = candidates[best]


def _add(context: Context, body: str, by: str | None = None) -> None:
    """Nothing to do for what stands on furniture, or is held out already.

    Args:
        context: what is where.
        body: to be reached by another hand.
        by: the gripper that holds it, for readers; the state says so, too.
    """
    root = context.root(body)
    if not context.at_side(root):
        return
    held = context.held[root]
    pose = context.pose[root] = _variable_pose(context, root)
    added = configuration(context, held, pose, context.lines_of(held.gripper))
    context.standing[held.gripper] = added
    context.choose(Offer(added))


def _variable_pose(context: Context, box: str) -> PlanarPose:
    """Above all that stands in front of the robot; a high shelf beside it does not count."""
    reach = math.hypot(*context.half(box)[:2])
    tops = (
        context.top(name) for name in context.pose if name != box and _below(context, name, reach)
    )
    lowest = context.half(box)[2] + _ABOVE + max(tops)
    side = context.robot.arms[context.held[box].gripper].left
    x, y, z = _PLACE
    return PlanarPose(
        context.program.variable(*_FORWARD, 0.01, x),
        context.program.variable(*_SIDEWAYS, 0.01, y * side),
        context.program.variable(-2 * np.pi, 2 * np.pi, 1e-3, 0.0),
        context.program.variable(lowest, 1.5, 0.01, z),
        0.0,
    )


def _below(context: Context, name: str, reach: float) -> bool:
    """Whether what is held out, ``reach`` (m) about its centre, may be above or below a body."""
    if context.pose[name].varies:
        return True
    reach += math.hypot(*context.half(name)[:2])
    return all(
        low - reach < place < high + reach
        for place, (low, high) in zip(
            context.geometry.poses[name][:2], (_FORWARD, _SIDEWAYS), strict=True
        )
    )


def _needed(one: Instruction) -> Iterator[tuple[Variable, ...]]:
    """Of a support, which may be in a hand, and of what is handed over."""
    if not one.into_hand:
        yield (one.attached.parent,)
    elif one.holder is not None:
        yield (one.attached.body,)


TERM = Term(_add, needed=_needed)
