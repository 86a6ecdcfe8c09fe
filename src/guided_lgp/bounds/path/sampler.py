"""The ways to carry out one action: an interpretation of the steps of its declared motion.

For every contact of the hand (grip or place), posture of the arm and straight way: first the
contact and the ends of the straight ways are free, then the ways, then the transits between them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from typing import Literal

import numpy as np

from guided_lgp.bounds.path.contacts import Contacts, ContactSampler
from guided_lgp.bounds.path.motions import Motion, Pair, Tool
from guided_lgp.bounds.path.postures import Postures
from guided_lgp.bounds.path.situation import Attach, Fingers, Release, Situation, Step
from guided_lgp.bounds.path.spaces import wound
from guided_lgp.bounds.path.task import Choice, Culprits, IkSolutions, Outcome, Stage, Task
from guided_lgp.bounds.results import Array
from guided_lgp.poses import compose, inverse, pose, rotation_matrix, yaw_of

_OUTCOMES = 4
"""Ways to carry out an action that are passed on, before an earlier action is changed."""
_CONFIGURATIONS = 150
"""Configurations at the contact that are looked at per action and batch of contacts."""
_POSTURES = 3
"""Postures of the arm per contact from which motions are planned."""


class OutcomeSampler:
    """Generates the ways to carry out the actions of one task."""

    def __init__(self, task: Task) -> None:
        self._task = task
        self._contacts = ContactSampler(task)
        self.visits = 0
        """Actions begun so far, in how many situations."""

    def outcomes(self, index: int, situation: Situation) -> Iterator[Outcome]:
        """Ways to carry out an action, each free of collisions from rest to rest."""
        self.visits += 1
        self._task.culprits = Culprits()
        action = self._task.manoeuvres[index]
        others = [gripper for gripper in self._task.arms if gripper != action.gripper]
        widths = [None] if action.closing is None else self._task.widths(index)
        for steps, there in self._presented(index, situation, action.presented):
            for width in widths:
                opening = self._opening(there, action.closing, width)
                opened = self._task.after(there, opening)
                for outcome in islice(self._carried_out(index, opened, width), _OUTCOMES):
                    rest = self._home(index, Stage.ASIDE, outcome.situation, others)
                    if rest is not None:
                        yield Outcome(
                            (*steps, *opening, *outcome.steps, *rest),
                            self._task.after(outcome.situation, rest),
                            outcome.contact,
                        )

    def backjump_target(self, index: int, situation: Situation, begun: bool) -> int:
        """The earlier action to change when none of the ways of this one works; -1 for none.

        Where no way of it was found at all, that is the last action that decided on what stood
        in its way (conflict-directed backjumping; Prosser, 1993). Where later actions failed, it
        is the last one, or for a body in a hand the one that decided how it is held.

        Args:
            index: of the action.
            situation: in which it was begun last.
            begun: whether a way of it was found.
        """
        task, action = self._task, self._task.manoeuvres[index]
        held = task.states[index].holder(action.body) is not None
        if begun and held:
            culprits = {action.body}
        elif begun or task.culprits.anything or situation.loaded(action.gripper):
            return index - 1
        else:
            symbols = {action.body, action.parent, *action.presented, action.way_out.gripper}
            symbols = symbols - {action.gripper} | task.culprits.symbols
            culprits = {below for symbol in symbols for below in task.below(index, symbol)}
        earlier = range(index - 1, -1, -1)
        return next((j for j in earlier if not culprits.isdisjoint(self._decided(j))), -1)

    def _decided(self, index: int) -> set[str]:
        """The bodies and arms of which an action decides where they are."""
        task, action = self._task, self._task.manoeuvres[index]
        shown = {task.root(index, body) for body in action.presented} & task.boxes.keys()
        return {action.body, action.gripper, action.way_out.gripper, *shown}

    def _presented(
        self, index: int, situation: Situation, bodies: Sequence[str]
    ) -> Iterator[tuple[tuple[Step, ...], Situation]]:
        """Bring what is held and needed, or carries what is, to where the action takes place."""
        if not bodies:
            yield (), situation
            return
        for steps, presented in self._present(index, situation, bodies[0]):
            for more, final in self._presented(index, presented, bodies[1:]):
                yield (*steps, *more), final

    def _present(
        self, index: int, situation: Situation, body: str
    ) -> Iterator[tuple[tuple[Step, ...], Situation]]:
        task = self._task
        root = task.root(index, body)
        holder = situation.state.holder(root)
        if holder is None:
            yield (), situation
            return
        loaded = situation.loaded(holder)
        if loaded:
            yield (), situation
        tool = compose(
            _upright(task.contacts[index].boxes[root]), inverse(situation.carried[root][1])
        )
        arm = task.arms[holder]
        rotation, nowhere = rotation_matrix(tool[3:])[None], np.zeros((1, 3))
        solutions = task.solutions(index, arm, rotation, tool[None, :3], nowhere)
        if loaded:
            solutions = task.level_solutions(solutions, holder, situation)
        now, around = situation.q[arm.arm.slice], situation.around(holder)
        for _, value, branch in solutions.order()[: 2 * _POSTURES]:
            goal = arm.near(solutions.q[0, 0, value, branch], now)
            if task.blocked(index, Stage.REACH, "presenting", around, goal[None]):
                continue
            steps = task.transit(around, now, goal, loaded)
            if steps is None:
                task.unmoved(index, Stage.CONTACT, f"no motion found to present {body}")
                continue
            yield tuple(steps), task.after(situation, steps)

    def _opening(
        self, situation: Situation, gripper: str | None, width: float | None
    ) -> tuple[Step, ...]:
        """Fingers that are to close open before, around a width (m)."""
        if gripper is None or width is None:
            return ()
        opened = self._task.opened(gripper, width)
        return () if situation.fingers[gripper] == opened else (Fingers(gripper, opened),)

    def _carried_out(
        self, index: int, situation: Situation, width: float | None
    ) -> Iterator[Outcome]:
        """Carry out an action at the likeliest contacts that are within reach."""
        task = self._task
        gripper = task.manoeuvres[index].gripper
        for contacts in self._contacts.contacts(index, situation, width):
            solutions = task.solutions(
                index, task.arms[gripper], contacts.rotation, contacts.position, contacts.way
            )
            if situation.loaded(gripper):
                solutions = task.level_solutions(solutions, gripper, situation)
            if np.isfinite(solutions.cost).any():
                yield from self._at(index, situation, contacts, solutions)
            else:
                task.record(index, Stage.REACH, "no inverse kinematics")

    def _at(
        self, index: int, situation: Situation, contacts: Contacts, solutions: IkSolutions
    ) -> Iterator[Outcome]:
        """Carry out an action with the nearest configurations that are free of collisions."""
        task, action = self._task, self._task.manoeuvres[index]
        at = situation.around(action.gripper, [(action.body, action.parent)])
        off = situation.around(action.gripper)
        attempts = np.zeros(len(solutions.cost), dtype=int)
        choices = solutions.order(contacts.cost)[:_CONFIGURATIONS]
        postures = Postures(task.mover, at, off, solutions.chosen(choices))
        for row, choice in enumerate(choices):
            number, value, branch = choice
            if attempts[number] >= _POSTURES:
                continue
            if task.met(index, Stage.CONTACT, "at the contact", postures.met_at(row)):
                continue
            if task.met(index, Stage.OFF, "before the contact", postures.met_off(row)):
                continue
            if task.overloaded(index, situation, solutions.q[number, :, value, branch]):
                continue
            if not contacts.possible(number):
                continue
            attempts[number] += 1
            outcome = self._planned(index, situation, solutions, choice)
            if outcome is not None:
                attempts[number] = _POSTURES
                yield outcome

    def _planned(
        self, index: int, situation: Situation, solutions: IkSolutions, choice: Choice
    ) -> Outcome | None:
        """Plan all motions of an action from one configuration, straight lines first."""
        task, action = self._task, self._task.manoeuvres[index]
        gripper, arm = action.gripper, task.arms[action.gripper]
        leaving = task.arms[action.way_out.gripper]
        start, tool = situation.q[arm.arm.slice], solutions.tool(choice)
        around = situation.around(gripper, [(action.body, action.parent)])
        straight = task.mover.line(around, tool, solutions.way[choice[0]])
        line = self._free(index, Stage.LINE_IN, straight)
        if line is None:
            return None
        # Full turns of a joint move the hand in the last bit only, but what is let go of keeps it.
        held = situation.state.holder(action.body) is not None
        at = line[::-1] if held else wound(line[::-1], arm, start)
        reached = task.after(situation, [Motion(arm.arm, at)])
        switch = self._switch(index, reached)
        switched = replace(task.after(reached, switch), state=task.states[index + 1])
        if leaving != arm:
            tool = task.mover.tool(leaving.gripper, switched.q[leaving.arm.slice])
        for out in self._ways_out(index, switched, tool):
            goal = arm.near(line[-1], start)
            come = task.transit(situation.around(gripper), start, goal, situation.loaded(gripper))
            if come is None:
                task.unmoved(
                    index, Stage.TRANSIT, f"no motion found to {action.name} {action.body}"
                )
                return None
            inward = Motion(arm.arm, wound(line[::-1], arm, come[-1].path[-1]))
            left = task.after(switched, [inward])
            outward = Motion(leaving.arm, wound(out, leaving, left.q[leaving.arm.slice]))
            left = task.after(left, [outward])
            go = self._home(index, Stage.HOME, left, action.homes)
            if go is not None:
                steps = (*come, inward, *switch, outward, *go)
                return Outcome(steps, task.after(left, go), reached.keyframe(task.arms))
        return None

    def _ways_out(self, index: int, switched: Situation, tool: Tool) -> Iterator[Array]:
        """Free straight ways of the leaving arm, whose end is free without any contact."""
        task, action = self._task, self._task.manoeuvres[index]
        around = switched.around(action.way_out.gripper, [(action.body, self._parent(index))])
        at_end = switched.around(action.way_out.gripper)
        shifts = task.shifts(action.way_out.gripper)
        for way in action.ways_out(tool.rotation):
            for line in task.mover.lines(around, tool, way.of(tool.rotation), shifts):
                out = self._free(index, Stage.LINE_OUT, line)
                if out is not None and not task.blocked(
                    index, Stage.OUT, "after the contact", at_end, out[-1:]
                ):
                    yield out

    def _free(
        self,
        index: int,
        stage: Literal[Stage.LINE_IN, Stage.LINE_OUT],
        line: Array | Pair | None,
    ) -> Array | None:
        """A line if it is free, or None, and what is wrong with it is remembered."""
        where = "on the way in" if stage == Stage.LINE_IN else "on the way out"
        if line is None:
            self._task.record(index, stage, f"out of reach {where}")
        elif isinstance(line, tuple):
            self._task.collided(index, stage, line, where)
            return None
        return line

    def _switch(self, index: int, situation: Situation) -> tuple[Step, ...]:
        """Fingers close; the body and what stands on it change their carrier; fingers open."""
        task, action = self._task, self._task.manoeuvres[index]
        bodies = (action.body, *situation.state.carried_by(action.body))
        carrier = task.carrier(index + 1, action.body)
        steps: list[Step] = []
        boxes = situation.boxes(task.arms)
        if action.closing is not None:
            width = task.width(action.closing, action.body, situation.q, boxes)
            closed = task.arms[action.closing].arm.fingers.value(width)
            steps.append(Fingers(action.closing, closed))
        if action.body in situation.carried:
            steps.append(Release(bodies))
        if carrier is not None:
            steps.append(Attach(bodies, carrier))
        if action.opening is not None:
            width = task.width(action.opening, action.body, situation.q, boxes)
            steps.append(Fingers(action.opening, task.opened(action.opening, width)))
        return tuple(steps)

    def _home(
        self, index: int, stage: Stage, situation: Situation, grippers: Sequence[str]
    ) -> tuple[Step, ...] | None:
        """Send arms to their side, one after the other."""
        steps: list[Step] = []
        for gripper in grippers:
            motions = self._task.home(self._task.after(situation, steps), gripper)
            if motions is None:
                self._task.unmoved(index, stage, f"no motion found for {gripper} to its side")
                return None
            steps += motions
        return tuple(steps)

    def _parent(self, index: int) -> str:
        """What holds or supports the body of an action before it."""
        state, body = self._task.states[index], self._task.manoeuvres[index].body
        parent = state.holder(body) or state.support_of(body)
        assert parent is not None
        return parent


def _upright(box: Array) -> Array:
    return pose(box[:3], float(yaw_of(box)))
