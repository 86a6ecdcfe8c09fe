"""What a grip must allow: the next action on the body that it holds."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from guided_lgp.bounds.path.grips import Grips
from guided_lgp.bounds.path.placing import STRATEGIES, Place, PlacementSampler, PlaceStrategy
from guided_lgp.bounds.path.situation import Fingers, Situation, matrix_pose
from guided_lgp.bounds.path.steps import Way
from guided_lgp.bounds.path.task import IkSolutions, Stage, Task
from guided_lgp.bounds.results import Array
from guided_lgp.poses import compose, inverse, rotation_matrix

_FORESEEN = 10
"""Configurations at the later contact that are looked at per grip."""


@dataclass(frozen=True)
class Outlook:
    """What each of M grips means for the next action on the body."""

    cost: Array
    """(M,): cheapest configuration at the later contact; infinite out of reach."""
    possible: Callable[[int], bool]
    """Whether a grip allows the action without collisions."""


class Foresight:
    """Looks from the grasp of a body to the next action on it, near the coarse solution."""

    def __init__(self, task: Task, placements: PlacementSampler) -> None:
        self._task = task
        self._placements = placements

    def outlook(
        self,
        index: int,
        situation: Situation,
        grips: Grips,
        width: float,
        strategy: PlaceStrategy,
    ) -> Outlook | None:
        """How grips of the body, so wide (m) there, suit its next action, by a strategy.

        None where the strategy adds nothing: nobody moves the body again, or hands take it.
        """
        later = self._task.next_move(index)
        if later is None:
            first = strategy == STRATEGIES[0]
            return Outlook(np.zeros(len(grips)), lambda grip: True) if first else None
        expected = self._expected(index, later, situation)
        targets = self._targets(later, expected, strategy)
        if not targets:
            return None
        holder = self._task.manoeuvres[index].parent
        solutions = self._solutions(later, holder, targets, grips)
        cost = solutions.cost.reshape(len(targets), len(grips), -1).min(axis=(0, 2))
        if not np.isfinite(cost).any():
            self._task.record(later, Stage.REACH, "no inverse kinematics")
        return Outlook(
            cost,
            cache(
                lambda grip: self._possible(
                    later, holder, expected, targets, solutions, grips, width, grip
                )
            ),
        )

    def _targets(self, later: int, expected: Situation, strategy: PlaceStrategy) -> list[Place]:
        """Where the body has to be for its next action."""
        action, coarse = self._task.manoeuvres[later], self._task.contacts[later].boxes
        if action.parent not in self._task.arms:
            return self._placements.places(later, expected, coarse, strategy)
        return [Place(coarse[action.body], Way(0.0))] if strategy == STRATEGIES[0] else []

    def _solutions(
        self, later: int, holder: str, targets: list[Place], grips: Grips
    ) -> IkSolutions:
        """Configurations for every target, and there for every grip."""
        poses = np.array([target.pose for target in targets])
        turns = rotation_matrix(poses[:, 3:])
        tools = [grips.tools(*at) for at in zip(poses[:, :3], turns, strict=True)]
        rotation = np.concatenate([tool[0] for tool in tools])
        contact = np.concatenate([tool[1] for tool in tools])
        ways = [t.way.of(tool[0]) for t, tool in zip(targets, tools, strict=True)]
        return self._task.solutions(
            later, self._task.arms[holder], rotation, contact, np.concatenate(ways)
        )

    def _expected(self, index: int, later: int, situation: Situation) -> Situation:
        """The situation expected at a later action, its body and what stands on it left out."""
        task, action = self._task, self._task.manoeuvres[later]
        moved = {between.body for between in task.manoeuvres[index + 1 : later]}
        moved |= {rider for body in moved for s in task.states for rider in s.carried_by(body)}
        poses = situation.boxes(task.arms)
        contact = task.contacts[later]
        away = {action.body, *task.states[later].carried_by(action.body)}
        standing = {
            box: contact.boxes[box] if box in moved else poses[box]
            for box in task.boxes
            if box not in away
        }
        closing = action.closing
        opened = {} if closing is None else {closing: task.opened(closing, task.widths(later)[0])}
        fingers = {**situation.fingers, **opened}
        return replace(
            situation,
            state=task.states[later],
            q=contact.q,
            fingers=fingers,
            standing=standing,
            carried={},
        )

    def _possible(
        self,
        later: int,
        holder: str,
        expected: Situation,
        targets: list[Place],
        solutions: IkSolutions,
        grips: Grips,
        width: float,
        grip: int,
    ) -> bool:
        """Whether the body, held so, can be moved on somewhere without collisions."""
        task, action = self._task, self._task.manoeuvres[later]
        count = len(grips)
        holding = replace(expected, carried=self._carried(later, holder, grips, grip))
        around = holding.around(holder, [(action.body, action.parent)])
        cost = np.full_like(solutions.cost, np.inf)
        cost[grip::count] = solutions.cost[grip::count]
        for choice in replace(solutions, cost=cost).order()[:_FORESEEN]:
            number, value, branch = choice
            ends = solutions.q[number, :, value, branch]
            if task.blocked(later, Stage.CONTACT, "at the contact", around, ends):
                continue
            left = self._left(later, expected, targets[number // count].pose, width)
            if self._can_leave(later, holder, left, solutions, choice):
                return True
        return False

    def _carried(
        self, later: int, holder: str, grips: Grips, grip: int
    ) -> dict[str, tuple[str, Array]]:
        """The body in the hand, and what stands on it."""
        task, body = self._task, self._task.manoeuvres[later].body
        grasp = inverse(matrix_pose(grips.rotation[grip], grips.offset[grip]))
        coarse = task.contacts[later].boxes
        riders = {
            rider: (holder, compose(grasp, compose(inverse(coarse[body]), coarse[rider])))
            for rider in task.states[later].carried_by(body)
        }
        return {body: (holder, grasp), **riders}

    def _left(self, later: int, expected: Situation, target: Array, width: float) -> Situation:
        """When the body has been let go of, with what stands on it."""
        body, opening = self._task.manoeuvres[later].body, self._task.manoeuvres[later].opening
        coarse = self._task.contacts[later].boxes
        moved = compose(target, inverse(coarse[body]))
        riders = self._task.states[later].carried_by(body)
        opened = [] if opening is None else [Fingers(opening, self._task.opened(opening, width))]
        return replace(
            self._task.after(expected, opened),
            standing={
                **expected.standing,
                body: target,
                **{rider: compose(moved, coarse[rider]) for rider in riders},
            },
            state=self._task.states[later + 1],
        )

    def _can_leave(
        self,
        later: int,
        holder: str,
        left: Situation,
        solutions: IkSolutions,
        choice: tuple[int, int, int],
    ) -> bool:
        """Whether the hand, where it is the one that leaves, has a free end of its way out."""
        task, (number, value, branch) = self._task, choice
        action = task.manoeuvres[later]
        if action.way_out.gripper != holder:
            return True
        rotation, contact = solutions.rotation[number], solutions.contact[number]
        ends = [contact + way.of(rotation) for way in action.ways_out(rotation)]
        q, valid = task.arms[holder].inverse(
            rotation,
            np.reshape(ends, (-1, 1, 3)),
            solutions.redundancies[value] + np.array(task.shifts(holder)),
        )
        if not valid[..., branch].any():
            task.record(later, Stage.OFF, "out of reach on the way out")
        around = left.around(holder)
        return not all(
            task.blocked(later, Stage.LEFT, "after the contact", around, end[None])
            for end in q[..., branch, :][valid[..., branch]]
        )
