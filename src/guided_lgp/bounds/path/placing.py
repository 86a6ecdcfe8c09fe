"""The ways to place a box: straight down, past an arm that leans over it, or elsewhere."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import product
from typing import Literal, get_args

import numpy as np

from guided_lgp.bounds.path.ik import continuous_near
from guided_lgp.bounds.path.motions import Motion
from guided_lgp.bounds.path.placements import alternatives, placed, placement_of
from guided_lgp.bounds.path.situation import Attach, Fingers, Release, Situation, Step
from guided_lgp.bounds.path.spaces import wound
from guided_lgp.bounds.path.task import (
    LIFT,
    PAN_SHIFTS,
    UP,
    Choice,
    Outcome,
    Reach,
    Task,
    retreats,
)
from guided_lgp.bounds.results import Array, Keyframe
from guided_lgp.poses import compose, inverse, rotation_matrix
from guided_lgp.scene.pr2 import FINGER_LIMITS, HOME, arm_slice

_SIDEWAYS = [0.05 * UP + 0.07 * side for side in np.vstack([np.eye(3)[:2], -np.eye(3)[:2]])]
"""Ways (m) up from a place past an arm that leans over it."""
Variant = Literal["straight", "sideways", "elsewhere"]
"""How a place differs from the coarse one: not, in the way down, in the placement."""
VARIANTS: tuple[Variant, ...] = get_args(Variant)
_CLEARANCE = 0.03
"""Distance (m) of these from other boxes on the same table: room for fingers."""
_SAMPLES = 24
"""Placements tried beside the coarse bound's."""


class Placing:
    """Generates the ways to carry out the places of one task."""

    def __init__(self, task: Task) -> None:
        self._task = task

    def of(self, index: int, situation: Situation) -> Iterator[Outcome]:
        """Ways to carry out a place, each free of collisions from rest to rest."""
        action = self._task.skeleton[index]
        assert action.table is not None
        now = Keyframe(situation.q, situation.boxes(self._task.arms))
        reference = placement_of(
            self._task.top(action.table, self._task.at_switch[index]),
            self._task.at_switch[index].boxes[action.box],
        )
        support = self._task.top(action.table, now)
        for variant in VARIANTS:
            targets, ways = self.variant(index, situation, support, reference, variant)
            yield from self._places_at(index, situation, targets, ways)

    def variant(
        self,
        index: int,
        situation: Situation,
        support: Array,
        reference: Array,
        variant: Variant,
    ) -> tuple[Array, Array]:
        """Poses (n, 7) of a box to be placed, and ways (n, 3) up from there (m)."""
        placements, ways = [reference], [LIFT * UP]
        if variant == "sideways":
            ways = _SIDEWAYS
        elif variant == "elsewhere":
            placements = self._alternatives(index, situation, support, reference)
        half_height = self._task.boxes[self._task.skeleton[index].box].size[2] / 2
        pairs = list(product(placements, ways))
        targets = np.array([placed(support, placement, half_height) for placement, _ in pairs])
        return targets, np.array([way for _, way in pairs])

    def _places_at(
        self, index: int, situation: Situation, targets: Array, ways: Array
    ) -> Iterator[Outcome]:
        action = self._task.skeleton[index]
        assert action.table is not None
        gripper, box = action.gripper, action.box
        tools = compose(targets, inverse(situation.carried[box][1]))
        rotation, contact = rotation_matrix(tools[:, 3:]), tools[:, :3]
        reach = self._task.reach(index, self._task.arms[gripper], rotation, contact, contact + ways)
        if situation.state.carried_by(box):
            reach = self._task.level_reach(reach, gripper, situation)
        if not np.isfinite(reach.cost).any():
            self._task.trouble.note(index, 0, f"no inverse kinematics to place {box}")
            return
        at, above = situation.still(gripper, [(box, action.table)]), situation.still(gripper)
        yield from self._task.ways(
            index,
            reach,
            reach.order(),
            ((at, "placing"), (above, "descent")),
            lambda choice: self._place(index, situation, reach, choice, ways[choice[0]]),
        )

    def _place(
        self,
        index: int,
        situation: Situation,
        reach: Reach,
        choice: Choice,
        way: Array,
    ) -> Outcome | None:
        """Plan all motions of a place, straight lines first."""
        action, state = self._task.skeleton[index], situation.state
        assert action.table is not None
        gripper, box = action.gripper, action.box
        number, pan, side = choice
        start = situation.q[arm_slice(gripper)]
        angle = float(reach.pans[pan])
        tool = (reach.rotation[number], reach.contact[number])
        riders = state.carried_by(box)
        still = situation.still(gripper, [(box, action.table)])
        line = self._task.mover.line(still, tool, way, (angle, angle), side)
        if isinstance(line, str):
            self._task.trouble.note(index, 4, f"descent {line}")
            return None
        lowered = self._task.after(situation, [Motion(gripper, line[::-1])])
        opening, release = Fingers(gripper, FINGER_LIMITS[1]), Release((box, *riders))
        hand_over = self._hand_over(index, (box, *riders))
        left = self._task.after(lowered, [release, *hand_over, opening])
        left = replace(left, state=self._task.states[index + 1])
        leaving = left.still(gripper, [(gripper, box)])
        for direction, shift in product(retreats(tool[0][:, 0]), PAN_SHIFTS):
            back = self._task.mover.line(leaving, tool, direction, (angle, angle + shift), side)
            if isinstance(back, str):
                self._task.trouble.note(index, 5, f"retreat {back}")
                continue
            blocked = self._task.mover.collision(left.still(gripper), back[-1:])
            if blocked is not None:
                self._task.note(index, 6, "retreat collision", blocked)
                continue
            come = self._task.transit(
                situation.still(gripper),
                start,
                continuous_near(line[-1], start),
                bool(riders),
            )
            if come is None:
                self._task.trouble.note(index, 7, f"no motion found to place {box}")
                return None
            downward = wound(line[::-1], come[-1].path[-1])
            backward = wound(back, downward[-1])
            go = self._task.transit(left.still(gripper), backward[-1], HOME[gripper], level=False)
            if go is None:
                self._task.trouble.note(index, 8, f"no motion found from the place of {box}")
                continue
            steps: tuple[Step, ...] = (
                *come,
                Motion(gripper, downward),
                release,
                *hand_over,
                opening,
                Motion(gripper, backward),
                *go,
            )
            final = self._task.after(left, steps[-1 - len(go) :])
            return Outcome(steps, final, lowered.keyframe(self._task.arms))
        return None

    def _hand_over(self, index: int, boxes: tuple[str, ...]) -> list[Step]:
        """Boxes placed on one that the other gripper carries move with that one from then on."""
        holder = self._task.root(index)[1]
        return [] if holder is None else [Attach(boxes, holder)]

    def _alternatives(
        self, index: int, situation: Situation, support: Array, reference: Array
    ) -> list[Array]:
        action = self._task.skeleton[index]
        box, table = action.box, action.table
        assert table is not None
        on_table = table in self._task.tables
        poses = situation.boxes(self._task.arms)
        others = [
            (placement_of(support, poses[other]), self._task.half(other))
            for other in situation.state.standing_on(table)
        ]
        for j in range(index + 1, len(self._task.skeleton)):
            other = self._task.skeleton[j]
            if other.table == table and other.box != box:
                top = self._task.top(table, self._task.at_switch[j])
                placement = placement_of(top, self._task.at_switch[j].boxes[other.box])
                others.append((placement, self._task.half(other.box)))
        half = (
            np.array(self._task.tables[table].half_extents) if on_table else self._task.half(table)
        )
        return alternatives(
            reference,
            half,
            self._task.half(box),
            self._masses(index),
            others,
            _CLEARANCE if on_table else 0.0,
            on_table or situation.state.holder(table) is not None,
            self._task.rng,
            _SAMPLES,
        )

    def _masses(self, index: int) -> Array:
        """Centres of mass (n, 2), in its frame, of a placed box with what it will carry."""
        box = self._task.skeleton[index].box
        centres = [np.zeros(2)]
        for j in range(index, len(self._task.skeleton)):
            if j > index and self._task.skeleton[j].box == box:
                break
            bodies = (box, *self._task.states[j + 1].carried_by(box))
            poses = self._task.at_switch[j].boxes
            weights = np.array([np.prod(self._task.boxes[body].size) for body in bodies])
            relative = compose(inverse(poses[box]), np.array([poses[body] for body in bodies]))
            centres.append(weights @ relative[:, :2] / weights.sum())
        return np.array(centres)
