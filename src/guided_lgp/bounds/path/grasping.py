"""The ways to grasp a box, chosen so that its later place works."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from guided_lgp.bounds.path.grips import Grips
from guided_lgp.bounds.path.ik import continuous_near
from guided_lgp.bounds.path.motions import Motion
from guided_lgp.bounds.path.placements import placement_of
from guided_lgp.bounds.path.placing import VARIANTS, Placing, Variant
from guided_lgp.bounds.path.situation import Attach, Fingers, Situation, Step, matrix_pose
from guided_lgp.bounds.path.spaces import wound
from guided_lgp.bounds.path.task import (
    APPROACH,
    LIFT,
    PAN_SHIFTS,
    UP,
    Choice,
    Outcome,
    Reach,
    Task,
    retreats,
)
from guided_lgp.bounds.results import Array
from guided_lgp.poses import compose, inverse, rotation_matrix
from guided_lgp.scene.pr2 import FINGER_LIMITS, HOME, arm_slice, finger_joint

_FORESEEN = 10
"""Elbow postures at the later place that are looked at per grip."""


@dataclass(frozen=True)
class _Foresight:
    """What a grasp must know of the later place of its box."""

    cost: Array
    """(M,) of each grip: cheapest configuration at the place; infinite out of reach."""
    possible: Callable[[int], bool]
    """Whether a grip allows a place without collisions."""


class Grasping:
    """Generates the ways to carry out the grasps of one task."""

    def __init__(self, task: Task, placing: Placing) -> None:
        self._task = task
        self._placing = placing

    def of(self, index: int, situation: Situation) -> Iterator[Outcome]:
        """Ways to carry out a grasp, each free of collisions from rest to rest."""
        gripper = self._task.skeleton[index].gripper
        central, others = self._task.grips[self._task.skeleton[index].box]
        opening: tuple[Step, ...] = ()
        if situation.fingers[gripper] != FINGER_LIMITS[1]:
            opening = (Fingers(gripper, FINGER_LIMITS[1]),)
        opened = self._task.after(situation, opening)
        for variant in VARIANTS:
            for grips in (central + self._coarse_grip(index), others):
                for outcome in self._grasps_with(index, opened, grips, variant):
                    yield replace(outcome, steps=(*opening, *outcome.steps))

    def _grasps_with(
        self, index: int, situation: Situation, grips: Grips, variant: Variant
    ) -> Iterator[Outcome]:
        """Grasps with one of a set of grips, for one variant of the later place."""
        action = self._task.skeleton[index]
        gripper, box = action.gripper, action.box
        foresight = self._foresight(index, situation, grips, variant)
        if foresight is None:
            return
        box_pose = situation.boxes(self._task.arms)[box]
        rotation, contact = grips.tools(box_pose[:3], rotation_matrix(box_pose[3:]))
        off = contact - APPROACH * rotation[:, :, 0]
        reach = self._task.reach(index, self._task.arms[gripper], rotation, contact, off)
        if not np.isfinite(reach.cost).any():
            self._task.trouble.note(index, 0, f"no inverse kinematics for a grasp of {box}")
            return
        at, before = situation.still(gripper, [(gripper, box)]), situation.still(gripper)
        yield from self._task.ways(
            index,
            reach,
            reach.order(foresight.cost),
            ((at, "grasp"), (before, "approach")),
            lambda choice: self._grasp(index, situation, reach, choice),
            foresight.possible,
        )

    def _coarse_grip(self, index: int) -> Grips:
        """The coarse solution's own grip."""
        action, contact = self._task.skeleton[index], self._task.at_switch[index]
        box = contact.boxes[action.box]
        arm = self._task.arms[action.gripper]
        rotation, position = arm.forward(contact.q[arm_slice(action.gripper)])
        frame = rotation_matrix(box[3:])
        return Grips((frame.T @ rotation)[None], ((position - box[:3]) @ frame)[None])

    def _grasp(
        self,
        index: int,
        situation: Situation,
        reach: Reach,
        choice: Choice,
    ) -> Outcome | None:
        """Plan all motions of a grasp, straight lines first."""
        action, state = self._task.skeleton[index], situation.state
        gripper, box = action.gripper, action.box
        number, pan, side = choice
        start = situation.q[arm_slice(gripper)]
        angle = float(reach.pans[pan])
        tool = (reach.rotation[number], reach.contact[number])
        before = continuous_near(reach.q[number, 1, pan, side], start)
        line = self._task.mover.line(
            situation.still(gripper, [(gripper, box)]),
            tool,
            -APPROACH * tool[0][:, 0],
            (angle, angle),
            side,
        )
        if isinstance(line, str):
            self._task.trouble.note(index, 4, f"approach {line}")
            return None
        inward = wound(line[::-1], before)
        reached = self._task.after(situation, [Motion(gripper, inward)])
        riders = state.carried_by(box)
        closed = Fingers(gripper, finger_joint(min(self._task.boxes[box].size[:2])))
        attach = Attach((box, *riders), gripper)
        held = replace(
            self._task.after(reached, [closed, attach]),
            state=self._task.states[index + 1],
        )
        support = state.support_of(box)
        assert support is not None
        rising = held.still(gripper, [(box, support)])
        for direction, shift in product(_lifts(tool[0][:, 0]), PAN_SHIFTS):
            lift = self._task.mover.line(rising, tool, direction, (angle, angle + shift), side)
            if isinstance(lift, str):
                self._task.trouble.note(index, 5, f"lift {lift}")
                continue
            blocked = self._task.mover.collision(held.still(gripper), lift[-1:])
            if blocked is not None:
                self._task.note(index, 6, "lift collision", blocked)
                continue
            upward = wound(lift, inward[-1])
            come = self._task.transit(situation.still(gripper), start, before, level=False)
            if come is None:
                self._task.trouble.note(index, 7, f"no motion found to the grasp of {box}")
                return None
            go: list[Motion] | None = []
            if not riders:
                go = self._task.transit(held.still(gripper), upward[-1], HOME[gripper], level=False)
            if go is None:
                self._task.trouble.note(index, 8, f"no motion found from the grasp of {box}")
                continue
            steps: tuple[Step, ...] = (
                *come,
                Motion(gripper, inward),
                closed,
                attach,
                Motion(gripper, upward),
                *go,
            )
            final = self._task.after(held, steps[-1 - len(go) :])
            return Outcome(steps, final, reached.keyframe(self._task.arms))
        return None

    def _foresight(
        self, index: int, situation: Situation, grips: Grips, variant: Variant
    ) -> _Foresight | None:
        """What a grasp must know about a variant of the later place of the box; None if there is
        no place and hence no further variant.
        """
        box = self._task.skeleton[index].box
        later = next(
            (
                j
                for j in range(index + 1, len(self._task.skeleton))
                if self._task.skeleton[j].box == box
            ),
            None,
        )
        if later is None:
            first = variant == VARIANTS[0]
            return _Foresight(np.zeros(len(grips)), lambda grip: True) if first else None
        action = self._task.skeleton[later]
        assert action.table is not None
        expected = self._expected(index, later, situation)
        support = self._task.top(action.table, self._task.at_switch[later])
        reference = placement_of(support, self._task.at_switch[later].boxes[box])
        targets, ways = self._placing.variant(later, expected, support, reference, variant)
        tools = [grips.tools(target[:3], rotation_matrix(target[3:])) for target in targets]
        rotation = np.concatenate([tool[0] for tool in tools])
        contact = np.concatenate([tool[1] for tool in tools])
        above = contact + np.repeat(ways, len(grips), axis=0)
        reach = self._task.reach(later, self._task.arms[action.gripper], rotation, contact, above)
        cost = reach.cost.reshape(len(targets), len(grips), -1).min(axis=(0, 2))
        if not np.isfinite(cost).any():
            self._task.trouble.note(later, 0, f"no inverse kinematics to place {box}")
        known: dict[int, bool] = {}

        def possible(grip: int) -> bool:
            if grip not in known:
                known[grip] = self._place_possible(later, expected, targets, reach, grips, grip)
            return known[grip]

        return _Foresight(cost, possible)

    def _expected(self, index: int, later: int, situation: Situation) -> Situation:
        """The situation expected at a later place, its box and what stands on it left out."""
        action = self._task.skeleton[later]
        moved = {step.box for step in self._task.skeleton[index + 1 : later]}
        moved |= {rider for box in moved for s in self._task.states for rider in s.carried_by(box)}
        poses = situation.boxes(self._task.arms)
        contact = self._task.at_switch[later]
        away = {action.box, *self._task.states[later].carried_by(action.box)}
        standing = {
            box: contact.boxes[box] if box in moved else poses[box]
            for box in self._task.boxes
            if box not in away
        }
        return Situation(self._task.states[later], contact.q, situation.fingers, standing, {})

    def _place_possible(
        self,
        later: int,
        expected: Situation,
        targets: Array,
        reach: Reach,
        grips: Grips,
        grip: int,
    ) -> bool:
        """Whether the box, held so, can be put down somewhere without collisions."""
        action = self._task.skeleton[later]
        assert action.table is not None
        gripper, box = action.gripper, action.box
        arm = self._task.arms[gripper]
        count = len(grips)
        grasp = inverse(matrix_pose(grips.rotation[grip], grips.offset[grip]))
        box_pose = self._task.at_switch[later].boxes[box]
        riders = {
            rider: (
                gripper,
                compose(
                    grasp,
                    compose(inverse(box_pose), self._task.at_switch[later].boxes[rider]),
                ),
            )
            for rider in self._task.states[later].carried_by(box)
        }
        holding = replace(expected, carried={box: (gripper, grasp), **riders})
        cost = np.full_like(reach.cost, np.inf)
        cost[grip::count] = reach.cost[grip::count]
        still = holding.still(gripper, [(box, action.table)])
        for number, pan, side in replace(reach, cost=cost).order()[:_FORESEEN]:
            at, above = reach.q[number, :, pan, side]
            blocked = self._task.mover.collision(still, np.stack([at, above]))
            if blocked is not None:
                self._task.note(later, 1, "placing collision", blocked)
                continue
            standing = {**expected.standing, box: targets[number // count]}
            left = replace(
                self._task.after(expected, [Fingers(gripper, FINGER_LIMITS[1])]),
                standing=standing,
                state=self._task.states[later + 1],
            )
            tool = reach.rotation[number], reach.contact[number]
            ends = np.array([tool[1] + way for way in retreats(tool[0][:, 0])])[:, None]
            back, valid = arm.inverse(tool[0], ends, reach.pans[pan] + np.array(PAN_SHIFTS))
            if not valid[..., side].any():
                self._task.trouble.note(later, 2, "retreat out of reach")
            leaving = left.still(gripper)
            for end in back[..., side, :][valid[..., side]]:
                blocked = self._task.mover.collision(leaving, end[None])
                if blocked is None:
                    return True
                self._task.note(later, 3, "retreat collision", blocked)
        return False


def _lifts(approach: Array) -> list[Array]:
    """Directions (m) in which a held box leaves its support: up, up and back, a little up."""
    return [LIFT * UP, LIFT * (0.8 * UP - 0.6 * approach), 0.5 * LIFT * UP]
