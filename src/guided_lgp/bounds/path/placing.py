"""Where a body may be put down: as in the coarse solution, past a leaning arm, or elsewhere."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import product
from typing import Literal, get_args

import numpy as np

from guided_lgp.bounds.path.placements import alternatives, placed, placement_of
from guided_lgp.bounds.path.situation import Situation
from guided_lgp.bounds.path.steps import LOW, Way
from guided_lgp.bounds.path.task import Task
from guided_lgp.bounds.results import Array
from guided_lgp.poses import compose, inverse

PlaceStrategy = Literal["straight", "aside", "elsewhere"]
"""How a place differs from the coarse one: not, in its way in, in the placement."""
STRATEGIES: tuple[PlaceStrategy, ...] = get_args(PlaceStrategy)
_CLEARANCE = 0.03
"""Distance (m) of other placements from other boxes on the same table: room for fingers."""
_SAMPLES = 24
"""Placements tried beside the coarse bound's."""


@dataclass(frozen=True)
class Place:
    """Where a body may be put down, and the way from there back to where the way in begins."""

    pose: Array
    """(7,) of the body."""
    way: Way


class PlacementSampler:
    """Generates the places of the bodies of one task."""

    def __init__(self, task: Task) -> None:
        self._task = task

    def places(
        self, index: int, situation: Situation, boxes: Mapping[str, Array], strategy: PlaceStrategy
    ) -> list[Place]:
        """Places of the body of an action, by one strategy.

        Args:
            index: of the action.
            situation: before it.
            boxes: where the support is, if that is a box.
            strategy: how they differ from the coarse solution.
        """
        task, action = self._task, self._task.manoeuvres[index]
        coarse = task.contacts[index].boxes
        support = task.top(action.parent, boxes)
        reference = placement_of(task.top(action.parent, coarse), coarse[action.body])
        placements, ways = [reference], self._ways(index)
        if strategy == "aside":
            ways = action.way_in.aside
        elif strategy == "elsewhere":
            placements = self._alternatives(index, situation, support, reference)
        half_height = task.boxes[action.body].size[2] / 2
        poses = [placed(support, placement, half_height) for placement in placements]
        suitable = [pose for pose in poses if task.suits(index, pose, boxes)]
        return [Place(pose, way) for pose, way in product(suitable, ways)]

    def _ways(self, index: int) -> tuple[Way, ...]:
        """The ways in to a place; below something, a low one, too."""
        task, action = self._task, self._task.manoeuvres[index]
        below = task.root(index, action.parent) in task.overhung
        return (*action.way_in.ways, LOW) if below else action.way_in.ways

    def _alternatives(
        self, index: int, situation: Situation, support: Array, reference: Array
    ) -> list[Array]:
        task, action = self._task, self._task.manoeuvres[index]
        fixed = action.parent in task.supports
        poses = situation.boxes(task.arms)
        others = [
            (placement_of(support, poses[other]), task.half(other))
            for other in situation.state.standing_on(action.parent)
        ]
        for later, keyframe in zip(
            task.manoeuvres[index + 1 :], task.contacts[index + 1 :], strict=True
        ):
            if later.parent == action.parent and later.body != action.body:
                top = task.top(later.parent, keyframe.boxes)
                placement = placement_of(top, keyframe.boxes[later.body])
                others.append((placement, task.half(later.body)))
        return alternatives(
            reference,
            task.rest(action.parent),
            task.half(action.body),
            self._masses(index),
            others,
            _CLEARANCE if fixed else 0.0,
            fixed or situation.state.holder(action.parent) is not None,
            task.rng,
            _SAMPLES,
        )

    def _masses(self, index: int) -> Array:
        """Centres of mass (n, 2), in its frame, of a placed body with what it will carry."""
        task, body = self._task, self._task.manoeuvres[index].body
        later = task.next_move(index)
        centres = [np.zeros(2)]
        for j in range(index, len(task) if later is None else later):
            bodies = (body, *task.states[j + 1].carried_by(body))
            poses = task.contacts[j].boxes
            weights = np.array([task.boxes[name].convex.volume for name in bodies])
            relative = compose(inverse(poses[body]), np.array([poses[name] for name in bodies]))
            centres.append(weights @ relative[:, :2] / weights.sum())
        return np.array(centres)
