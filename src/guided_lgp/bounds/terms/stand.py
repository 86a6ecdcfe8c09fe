"""``stand(box, support)``: a box is put down level on a support, with all that it carries."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from operator import add

import numpy as np

from guided_lgp.bounds.checks import Pose, Top, Vector, angle_of, axes_of
from guided_lgp.bounds.program.context import Aim, Context, Start
from guided_lgp.bounds.program.draft import Draft
from guided_lgp.bounds.program.slots import HeldBox, PlanarPose, StraightSegment
from guided_lgp.bounds.results import Array
from guided_lgp.bounds.terms import carried
from guided_lgp.bounds.terms.balanced import inner
from guided_lgp.bounds.terms.beside import Separation
from guided_lgp.bounds.terms.hold import costs_of_both
from guided_lgp.bounds.terms.term import Term, put_down
from guided_lgp.scene.tolerances import HEIGHT, LEVEL_ANGLE

CANDIDATES = 6
"""Placements drawn, of which the best to reach is taken."""
_OVERLAP = 20.0
"""Cost per m of overlap with a neighbour: as much as what is missing to reach."""


@dataclass(frozen=True)
class Placement:
    """A box put on a support; the boxes that it carries move along (old and new poses)."""

    action: int
    held: HeldBox
    old: PlanarPose
    pose: PlanarPose
    support: PlanarPose
    half: tuple[float, float]
    """Half extents (m) within which the centre must be."""
    carried: tuple[tuple[PlanarPose, PlanarPose], ...]
    aim: Aim | None
    """Where a goal wants it, if one does."""
    others: Sequence[Start]
    """What else the action leaves to the start; the separations from neighbours are there."""

    def start(self, draft: Draft) -> None:
        """Of a few places drawn on the support, one that is reached and free."""
        if self.pose.x < draft.kept:
            return
        candidates = self._draw(draft)
        overlaps = self._overlaps(draft, candidates)
        place = costs_of_both(draft, self.held, candidates, self._segments(draft))
        best = draft.choose(place + overlaps)
        draft.values[list(self.pose.plane)] = candidates[best, :3]
        for before, after in self.carried:
            old, above, new = (draft.pose(pose) for pose in (self.old, before, self.pose))
            carried.carry(draft, old, above, new, after)

    def _draw(self, draft: Draft) -> Array:
        """Poses (CANDIDATES, 4) on the support."""
        x, y, turn, z = draft.place(self.support)
        height = z + self.pose.offset - self.support.offset
        if self.aim is not None:
            places = self.aim(draft.generator, CANDIDATES, np.array((x, y, turn, z)))
            return np.column_stack([places, np.full(CANDIDATES, height)])
        local = draft.generator.uniform(-1, 1, (CANDIDATES, 2)).tolist()
        yaws = draft.generator.uniform(-np.pi / 2, np.pi / 2, CANDIDATES).tolist()
        cosine, sine, (half_along, half_across) = math.cos(turn), math.sin(turn), self.half
        candidates = []
        for shares, yaw in zip(local, yaws, strict=True):
            along, across = shares[0] * half_along, shares[1] * half_across
            there = x + cosine * along - sine * across, y + sine * along + cosine * across
            candidates.append((*there, yaw, height))
        return np.array(candidates)

    def _overlaps(self, draft: Draft, candidates: Array) -> Array:
        """Costs (CANDIDATES,) of what each candidate overlaps beside it."""
        total, places = [0.0] * len(candidates), candidates.tolist()
        for other in self.others:
            if isinstance(other, Separation) and other.first is self.pose:
                total = list(map(add, total, other.overlap(draft, places)))
        return _OVERLAP * np.array(total)

    def _segments(self, draft: Draft) -> tuple[StraightSegment, ...]:
        """The straight segments of the arm that puts the box down."""
        configurations = reversed(draft.configurations[self.held])
        return next(c.segments for c in configurations if c.action == self.action)


def _add(context: Context, box: str, support: str) -> None:
    """The pose of the box on its support is a choice of this action."""
    old, below = context.pose[box], context.pose[support]
    height = context.half(support)[2] + context.half(box)[2]
    pose = PlanarPose(*context.plane(), below.z, below.offset + height)
    riders = context.state.carried_by(box)
    before = [context.pose[name] for name in riders]
    context.pose[box] = pose
    carried.TERM.add(context, box)
    context.choose(
        Placement(
            action=context.action,
            held=context.held[box],
            old=old,
            pose=pose,
            support=below,
            half=inner(context, support),
            carried=tuple(zip(before, (context.pose[name] for name in riders), strict=True)),
            aim=context.aims.get((context.action, box)),
            others=context.choices[-1],
        )
    )


def check(size: Vector, placement: Pose, top: Top) -> float:
    """By how much (m or rad) a box does not stand level on a top: negative where it does."""
    tilted = max(tilt(placement), tilt(top.pose)) - LEVEL_ANGLE
    return max(tilted, gap(size, placement, top) - HEIGHT)


def tilt(placement: Pose) -> float:
    """Angle (rad) of a body's z axis from the vertical."""
    return angle_of(axes_of(placement)[2][2])


def gap(size: Vector, placement: Pose, top: Top) -> float:
    """Distance (m) of a level box's bottom from a top."""
    return abs(placement[2] - size[2] / 2 - top.height)


TERM = Term(_add, attaches="table", needed=put_down)
