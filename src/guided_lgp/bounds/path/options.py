"""The ways to carry out one action, tried from the likeliest on."""

from collections.abc import Iterator
from itertools import islice

import numpy as np

from guided_lgp.bounds.path.grasping import Grasping
from guided_lgp.bounds.path.ik import continuous_near
from guided_lgp.bounds.path.placing import Placing
from guided_lgp.bounds.path.situation import Situation, Step
from guided_lgp.bounds.path.task import ELBOWS, Outcome, Task
from guided_lgp.bounds.results import Array
from guided_lgp.poses import compose, inverse, pose, rotation_matrix, yaw_of
from guided_lgp.scene import GRIPPERS
from guided_lgp.scene.pr2 import HOME, arm_slice

_OUTCOMES = 4
"""Ways to carry out an action that are passed on, before an earlier action is changed."""


class Options:
    """Generates the ways to carry out the actions of one task."""

    def __init__(self, task: Task) -> None:
        self._task = task
        self.length = len(task.skeleton)
        self._placing = Placing(task)
        self._grasping = Grasping(task, self._placing)
        self.visits = 0
        """Actions begun so far, in how many situations."""

    def of(self, index: int, situation: Situation) -> Iterator[Outcome]:
        """Ways to carry out an action, each free of collisions from rest to rest."""
        self.visits += 1
        action = self._task.skeleton[index]
        for steps, presented in self._presented(index, situation):
            if action.instruction == "grasp":
                outcomes = self._grasping.of(index, presented)
            else:
                outcomes = self._placing.of(index, presented)
            for outcome in islice(outcomes, _OUTCOMES):
                tidied = self._tidied(index, outcome.situation)
                if tidied is not None:
                    rest, final = tidied
                    yield Outcome((*steps, *outcome.steps, *rest), final, outcome.contact)

    def culprit(self, index: int) -> int:
        """The earlier action to change when none of the ways of this one works."""
        action = self._task.skeleton[index]
        if action.instruction == "grasp":
            return index - 1
        return next(
            j
            for j in range(index - 1, -1, -1)
            if action.box in (self._task.skeleton[j].box, self._task.root(j)[0])
        )

    def _presented(
        self, index: int, situation: Situation
    ) -> Iterator[tuple[tuple[Step, ...], Situation]]:
        """Bring the held box on which the action takes place, if any, to where it is needed."""
        state = situation.state
        root, holder = self._task.root(index)
        if root is None or holder is None:
            yield (), situation
            return
        loaded = bool(state.carried_by(root))
        if loaded:
            yield (), situation
        arm = self._task.arms[holder]
        target = _upright(self._task.at_switch[index].boxes[root])
        tool = compose(target, inverse(situation.carried[root][1]))
        rotation = rotation_matrix(tool[3:])[None]
        now = situation.q[arm_slice(holder)]
        reach = self._task.reach(index, arm, rotation, tool[None, :3], tool[None, :3])
        still = situation.still(holder)
        if loaded:
            reach = self._task.level_reach(reach, holder, situation)
        for _, pan, side in reach.order()[: 2 * ELBOWS]:
            goal = continuous_near(reach.q[0, 0, pan, side], now)
            blocked = self._task.mover.collision(still, goal[None])
            if blocked is not None:
                self._task.note(index, 0, "presenting collision", blocked)
                continue
            steps = self._task.transit(still, now, goal, loaded)
            if steps is None:
                self._task.trouble.note(index, 1, "no motion found to present the support")
                continue
            yield tuple(steps), self._task.after(situation, steps)

    def _tidied(
        self, index: int, situation: Situation
    ) -> tuple[tuple[Step, ...], Situation] | None:
        """Send the other arm home when it no longer presents anything."""
        acting = self._task.skeleton[index].gripper
        other = next(gripper for gripper in GRIPPERS if gripper != acting)
        held = situation.state.held_by(other)
        now = situation.q[arm_slice(other)]
        if np.array_equal(now, HOME[other]) or (held and situation.state.carried_by(held)):
            return (), situation
        steps = self._task.transit(situation.still(other), now, HOME[other], level=False)
        if steps is None:
            self._task.trouble.note(index, 9, "no motion found for the other arm to its side")
            return None
        return tuple(steps), self._task.after(situation, steps)


def _upright(box: Array) -> Array:
    return pose(box[:3], float(yaw_of(box)))
