"""The ways to carry out one action: grips, elbows and placements, tried from the likeliest on."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product
from typing import Literal, get_args

import numpy as np

from guided_lgp.logic import Skeleton, successor
from guided_lgp.nlp.path.grips import Grips
from guided_lgp.nlp.path.ik import REACH, Arm, continuous_near
from guided_lgp.nlp.path.motions import Free, Motion, Mover, Still
from guided_lgp.nlp.path.placements import alternatives, placed, placement_of
from guided_lgp.nlp.path.situation import (
    Attach,
    Fingers,
    Release,
    Situation,
    Step,
    matrix_pose,
)
from guided_lgp.nlp.path.spaces import wound
from guided_lgp.nlp.results import Array, Keyframe
from guided_lgp.scene import GRIPPERS, Scene
from guided_lgp.scene.poses import compose, inverse, pose, rotation_matrix, yaw_of
from guided_lgp.scene.pr2 import FINGER_LIMITS, HOME, arm_slice, finger_joint
from guided_lgp.scene.world import initial_poses

APPROACH = 0.09
"""Length (m) of the straight way to a grasp and from a place, along the hand."""
LIFT = 0.08
"""Length (m) of the straight way up after a grasp and down to a place."""
_UP = np.array([0.0, 0.0, 1.0])
_SIDEWAYS = [0.05 * _UP + 0.07 * side for side in np.vstack([np.eye(3)[:2], -np.eye(3)[:2]])]
"""Ways (m) up from a place past an arm that leans over it."""
Variant = Literal["straight", "sideways", "elsewhere"]
"""How a place differs from the coarse one: not, in the way down, in the placement."""
_VARIANTS: tuple[Variant, ...] = get_args(Variant)
_PANS = np.linspace(-0.7, 2.28, 15)
"""Pan angles (rad) of the left arm that are tried for every pose, beside the coarse one."""
_CONFIGURATIONS = 150
"""Configurations of grip and elbow that are looked at per action and batch of placements."""
_ELBOWS = 3
"""Elbow postures per grip or placement whose motions are planned."""
_FORESEEN = 10
"""Elbow postures at the later place that are looked at per grip."""
_OUTCOMES = 4
"""Ways to carry out an action that are passed on, before an earlier action is changed."""
_PAN_SHIFTS = (0.0, 0.25, -0.25, 0.5, -0.5)
"""Turns of the pan joint (rad) on the straight way off a box that are tried."""
_CLEARANCE = 0.03
"""Distance (m) of these from other boxes on the same table: room for fingers."""
_SAMPLES = 24
"""Placements tried beside the coarse bound's."""


@dataclass(frozen=True)
class Outcome:
    """One way to carry out an action."""

    steps: tuple[Step, ...]
    situation: Situation
    contact: Keyframe


@dataclass
class Trouble:
    """The obstacle met farthest on the way through the skeleton."""

    action: int = -1
    stage: int = -1
    constraint: str = "no motion found"

    def note(self, action: int, stage: int, constraint: str) -> None:
        """Remember the obstacle unless one farther on is known."""
        if (action, stage) > (self.action, self.stage):
            self.action, self.stage, self.constraint = action, stage, constraint


@dataclass(frozen=True)
class _Reach:
    """Configurations of an arm for N tool poses at a contact and before (or after) it."""

    rotation: Array
    """(N, 3, 3) of the tool frame."""
    contact: Array
    """(N, 3) origin of the tool frame (m)."""
    q: Array
    """(N, 2, P, 2, 7): at the contact and off it, by pan angle and side of the elbow."""
    pans: Array
    """(P,) rad."""
    cost: Array
    """(N, P, 2): distance of the second from the home posture; infinite out of reach."""

    def order(self, extra: Array | None = None) -> list[tuple[int, int, int]]:
        """Pose, pan and side, cheapest first; ``extra`` (N,) is added to the cost."""
        cost = self.cost if extra is None else self.cost + extra[:, None, None]
        flat = np.argsort(cost, axis=None, kind="stable")
        flat = flat[: int(np.isfinite(cost).sum())]
        return [
            (int(n), int(p), int(s)) for n, p, s in np.transpose(np.unravel_index(flat, cost.shape))
        ]


@dataclass(frozen=True)
class _Foresight:
    """What a grasp must know of the later place of its box."""

    cost: Array
    """(M,) of each grip: cheapest configuration at the place; infinite out of reach."""
    possible: Callable[[int], bool]
    """Whether a grip allows a place without collisions."""


class Options:
    """Generates the ways to carry out the actions of one skeleton, near one coarse solution."""

    def __init__(
        self,
        scene: Scene,
        mover: Mover,
        grips: Mapping[str, tuple[Grips, Grips]],
        skeleton: Skeleton,
        contacts: Sequence[Keyframe],
        trouble: Trouble,
        seed: int,
    ) -> None:
        self._mover = mover
        self._arms = mover.arms
        self._skeleton = skeleton
        self.length = len(skeleton)
        self.visits = 0
        """Actions begun so far, in how many situations."""
        self._contacts = contacts
        self._trouble = trouble
        self._rng = np.random.default_rng(np.random.SeedSequence([7, seed]))
        self._boxes = {box.name: box for box in scene.boxes}
        self._tables = {table.name: table for table in scene.tables}
        self._grips = grips
        self._states = [scene.state]
        for action in skeleton:
            self._states.append(successor(self._states[-1], action))
        self.start = Situation(
            scene.state,
            np.concatenate([HOME[gripper] for gripper in GRIPPERS]),
            dict.fromkeys(GRIPPERS, FINGER_LIMITS[0]),
            initial_poses(scene),
            {},
        )

    def of(self, index: int, situation: Situation) -> Iterator[Outcome]:
        """Ways to carry out an action, each free of collisions from rest to rest."""
        self.visits += 1
        action = self._skeleton[index]
        for steps, presented in self._presented(index, situation):
            if action.instruction == "grasp":
                outcomes = self._grasps(index, presented)
            else:
                outcomes = self._places(index, presented)
            for outcome in islice(outcomes, _OUTCOMES):
                tidied = self._tidied(index, outcome.situation)
                if tidied is not None:
                    rest, final = tidied
                    yield Outcome((*steps, *outcome.steps, *rest), final, outcome.contact)

    def culprit(self, index: int) -> int:
        """The earlier action to change when none of the ways of this one works."""
        action = self._skeleton[index]
        if action.instruction == "grasp":
            return index - 1
        return next(
            j
            for j in range(index - 1, -1, -1)
            if action.box in (self._skeleton[j].box, self._root(j)[0])
        )

    # -- Held boxes as supports ------------------------------------------------------------

    def _presented(
        self, index: int, situation: Situation
    ) -> Iterator[tuple[tuple[Step, ...], Situation]]:
        """Bring the held box on which the action takes place, if any, to where it is needed."""
        state = situation.state
        root, holder = self._root(index)
        if root is None or holder is None:
            yield (), situation
            return
        loaded = bool(state.carried_by(root))
        if loaded:
            yield (), situation
        arm = self._arms[holder]
        target = _upright(self._contacts[index].boxes[root])
        tool = compose(target, inverse(situation.carried[root][1]))
        rotation = rotation_matrix(tool[3:])[None]
        now = situation.q[arm_slice(holder)]
        reach = self._reach(index, arm, rotation, tool[None, :3], tool[None, :3])
        still = situation.still(holder)
        if loaded:
            reach = self._level_reach(reach, holder, situation)
        for _, pan, side in reach.order()[: 2 * _ELBOWS]:
            goal = continuous_near(reach.q[0, 0, pan, side], now)
            blocked = self._mover.collision(still, goal[None])
            if blocked is not None:
                self._note(index, 0, "presenting collision", blocked)
                continue
            steps = self._transit(still, now, goal, loaded)
            if steps is None:
                self._trouble.note(index, 1, "no motion found to present the support")
                continue
            yield tuple(steps), self._after(situation, steps)

    def _tidied(
        self, index: int, situation: Situation
    ) -> tuple[tuple[Step, ...], Situation] | None:
        """Send the other arm home when it no longer presents anything."""
        acting = self._skeleton[index].gripper
        other = next(gripper for gripper in GRIPPERS if gripper != acting)
        held = situation.state.held_by(other)
        now = situation.q[arm_slice(other)]
        if np.array_equal(now, HOME[other]) or (held and situation.state.carried_by(held)):
            return (), situation
        steps = self._transit(situation.still(other), now, HOME[other], level=False)
        if steps is None:
            self._trouble.note(index, 9, "no motion found for the other arm to its side")
            return None
        return tuple(steps), self._after(situation, steps)

    # -- Grasps ------------------------------------------------------------------------------

    def _grasps(self, index: int, situation: Situation) -> Iterator[Outcome]:
        central, others = self._grips[self._skeleton[index].box]
        opened = self._opened(situation, self._skeleton[index].gripper)
        opening = (
            ()
            if opened.fingers == situation.fingers
            else (Fingers(self._skeleton[index].gripper, FINGER_LIMITS[1]),)
        )
        for variant in _VARIANTS:
            for grips in (central + self._coarse_grip(index), others):
                for outcome in self._grasps_with(index, opened, grips, variant):
                    yield replace(outcome, steps=(*opening, *outcome.steps))

    def _grasps_with(
        self, index: int, situation: Situation, grips: Grips, variant: Variant
    ) -> Iterator[Outcome]:
        """Grasps with one of a set of grips, for one variant of the later place."""
        action = self._skeleton[index]
        gripper, box = action.gripper, action.box
        foresight = self._foresight(index, situation, grips, variant)
        if foresight is None:
            return
        box_pose = situation.boxes(self._arms)[box]
        rotation, contact = grips.tools(box_pose[:3], rotation_matrix(box_pose[3:]))
        off = contact - APPROACH * rotation[:, :, 0]
        reach = self._reach(index, self._arms[gripper], rotation, contact, off)
        if not np.isfinite(reach.cost).any():
            self._trouble.note(index, 0, f"no inverse kinematics for a grasp of {box}")
            return
        approach, free = situation.still(gripper, [(gripper, box)]), situation.still(gripper)
        planned = np.zeros(len(grips), dtype=int)
        for choice in reach.order(foresight.cost)[:_CONFIGURATIONS]:
            grip, pan, side = choice
            if planned[grip] >= _ELBOWS:
                continue
            at, before = reach.q[grip, :, pan, side]
            blocked = self._mover.collision(approach, at[None])
            if blocked is not None:
                self._note(index, 1, "grasp collision", blocked)
                continue
            blocked = self._mover.collision(free, before[None])
            if blocked is not None:
                self._note(index, 2, "approach collision", blocked)
                continue
            if not foresight.possible(grip):
                continue
            planned[grip] += 1
            outcome = self._grasp(index, situation, reach, choice)
            if outcome is not None:
                planned[grip] = _ELBOWS
                yield outcome

    def _coarse_grip(self, index: int) -> Grips:
        """The coarse solution's own grip."""
        action, contact = self._skeleton[index], self._contacts[index]
        box = contact.boxes[action.box]
        arm = self._arms[action.gripper]
        rotation, position = arm.forward(contact.q[arm_slice(action.gripper)])
        frame = rotation_matrix(box[3:])
        return Grips((frame.T @ rotation)[None], ((position - box[:3]) @ frame)[None])

    def _grasp(
        self,
        index: int,
        situation: Situation,
        reach: _Reach,
        choice: tuple[int, int, int],
    ) -> Outcome | None:
        """Plan all motions of a grasp, straight lines first."""
        action, state = self._skeleton[index], situation.state
        gripper, box = action.gripper, action.box
        number, pan, side = choice
        start = situation.q[arm_slice(gripper)]
        angle = float(reach.pans[pan])
        tool = (reach.rotation[number], reach.contact[number])
        before = continuous_near(reach.q[number, 1, pan, side], start)
        line = self._mover.line(
            situation.still(gripper, [(gripper, box)]),
            tool,
            -APPROACH * tool[0][:, 0],
            (angle, angle),
            side,
        )
        if isinstance(line, str):
            self._trouble.note(index, 4, f"approach {line}")
            return None
        inward = wound(line[::-1], before)
        reached = self._after(situation, [Motion(gripper, inward)])
        riders = state.carried_by(box)
        closed = Fingers(gripper, finger_joint(min(self._boxes[box].size[:2])))
        attach = Attach((box, *riders), gripper)
        held = replace(self._after(reached, [closed, attach]), state=self._states[index + 1])
        support = state.support_of(box)
        assert support is not None
        rising = held.still(gripper, [(box, support)])
        for direction, shift in product(_lifts(tool[0][:, 0]), _PAN_SHIFTS):
            lift = self._mover.line(rising, tool, direction, (angle, angle + shift), side)
            if isinstance(lift, str):
                self._trouble.note(index, 5, f"lift {lift}")
                continue
            blocked = self._mover.collision(held.still(gripper), lift[-1:])
            if blocked is not None:
                self._note(index, 6, "lift collision", blocked)
                continue
            upward = wound(lift, inward[-1])
            come = self._transit(situation.still(gripper), start, before, level=False)
            if come is None:
                self._trouble.note(index, 7, f"no motion found to the grasp of {box}")
                return None
            go: list[Motion] | None = []
            if not riders:
                go = self._transit(held.still(gripper), upward[-1], HOME[gripper], level=False)
            if go is None:
                self._trouble.note(index, 8, f"no motion found from the grasp of {box}")
                continue
            steps: tuple[Step, ...] = (
                *come,
                Motion(gripper, inward),
                closed,
                attach,
                Motion(gripper, upward),
                *go,
            )
            final = self._after(held, steps[-1 - len(go) :])
            return Outcome(steps, final, reached.keyframe(self._arms))
        return None

    def _foresight(
        self, index: int, situation: Situation, grips: Grips, variant: Variant
    ) -> "_Foresight | None":
        """What a grasp must know about a variant of the later place of the box; None if there is
        no place and hence no further variant.
        """
        box = self._skeleton[index].box
        later = next(
            (j for j in range(index + 1, len(self._skeleton)) if self._skeleton[j].box == box), None
        )
        if later is None:
            first = variant == _VARIANTS[0]
            return _Foresight(np.zeros(len(grips)), lambda grip: True) if first else None
        action = self._skeleton[later]
        assert action.table is not None
        expected = self._expected(index, later, situation)
        support = self._top(action.table, self._contacts[later])
        reference = placement_of(support, self._contacts[later].boxes[box])
        targets, ways = self._variant(later, expected, support, reference, variant)
        tools = [grips.tools(target[:3], rotation_matrix(target[3:])) for target in targets]
        rotation = np.concatenate([tool[0] for tool in tools])
        contact = np.concatenate([tool[1] for tool in tools])
        above = contact + np.repeat(ways, len(grips), axis=0)
        reach = self._reach(later, self._arms[action.gripper], rotation, contact, above)
        cost = reach.cost.reshape(len(targets), len(grips), -1).min(axis=(0, 2))
        if not np.isfinite(cost).any():
            self._trouble.note(later, 0, f"no inverse kinematics to place {box}")
        known: dict[int, bool] = {}

        def possible(grip: int) -> bool:
            if grip not in known:
                known[grip] = self._place_possible(later, expected, targets, reach, grips, grip)
            return known[grip]

        return _Foresight(cost, possible)

    def _expected(self, index: int, later: int, situation: Situation) -> Situation:
        """The situation expected at a later place, its box and what stands on it left out."""
        action = self._skeleton[later]
        moved = {step.box for step in self._skeleton[index + 1 : later]}
        moved |= {rider for box in moved for s in self._states for rider in s.carried_by(box)}
        poses = situation.boxes(self._arms)
        contact = self._contacts[later]
        away = {action.box, *self._states[later].carried_by(action.box)}
        standing = {
            box: contact.boxes[box] if box in moved else poses[box]
            for box in self._boxes
            if box not in away
        }
        return Situation(self._states[later], contact.q, situation.fingers, standing, {})

    def _place_possible(
        self,
        later: int,
        expected: Situation,
        targets: Array,
        reach: _Reach,
        grips: Grips,
        grip: int,
    ) -> bool:
        """Whether the box, held so, can be put down somewhere without collisions."""
        action = self._skeleton[later]
        assert action.table is not None
        gripper, box = action.gripper, action.box
        arm = self._arms[gripper]
        count = len(grips)
        grasp = inverse(matrix_pose(grips.rotation[grip], grips.offset[grip]))
        box_pose = self._contacts[later].boxes[box]
        riders = {
            rider: (
                gripper,
                compose(grasp, compose(inverse(box_pose), self._contacts[later].boxes[rider])),
            )
            for rider in self._states[later].carried_by(box)
        }
        holding = replace(expected, carried={box: (gripper, grasp), **riders})
        cost = np.full_like(reach.cost, np.inf)
        cost[grip::count] = reach.cost[grip::count]
        still = holding.still(gripper, [(box, action.table)])
        for number, pan, side in replace(reach, cost=cost).order()[:_FORESEEN]:
            at, above = reach.q[number, :, pan, side]
            blocked = self._mover.collision(still, np.stack([at, above]))
            if blocked is not None:
                self._note(later, 1, "placing collision", blocked)
                continue
            standing = {**expected.standing, box: targets[number // count]}
            left = replace(
                self._opened(expected, gripper), standing=standing, state=self._states[later + 1]
            )
            tool = reach.rotation[number], reach.contact[number]
            ends = np.array([tool[1] + way for way in _retreats(tool[0][:, 0])])[:, None]
            back, valid = arm.inverse(tool[0], ends, reach.pans[pan] + np.array(_PAN_SHIFTS))
            if not valid[..., side].any():
                self._trouble.note(later, 2, "retreat out of reach")
            leaving = left.still(gripper)
            for end in back[..., side, :][valid[..., side]]:
                blocked = self._mover.collision(leaving, end[None])
                if blocked is None:
                    return True
                self._note(later, 3, "retreat collision", blocked)
        return False

    # -- Placements --------------------------------------------------------------------------

    def _places(self, index: int, situation: Situation) -> Iterator[Outcome]:
        action = self._skeleton[index]
        assert action.table is not None
        now = Keyframe(situation.q, situation.boxes(self._arms))
        reference = placement_of(
            self._top(action.table, self._contacts[index]), self._contacts[index].boxes[action.box]
        )
        support = self._top(action.table, now)
        for variant in _VARIANTS:
            targets, ways = self._variant(index, situation, support, reference, variant)
            yield from self._places_at(index, situation, targets, ways)

    def _variant(
        self, index: int, situation: Situation, support: Array, reference: Array, variant: Variant
    ) -> tuple[Array, Array]:
        """Poses (n, 7) of a box to be placed, and ways (n, 3) up from there (m)."""
        placements, ways = [reference], [LIFT * _UP]
        if variant == "sideways":
            ways = _SIDEWAYS
        elif variant == "elsewhere":
            placements = self._alternatives(index, situation, support, reference)
        half_height = self._boxes[self._skeleton[index].box].size[2] / 2
        pairs = list(product(placements, ways))
        targets = np.array([placed(support, placement, half_height) for placement, _ in pairs])
        return targets, np.array([way for _, way in pairs])

    def _places_at(
        self, index: int, situation: Situation, targets: Array, ways: Array
    ) -> Iterator[Outcome]:
        action = self._skeleton[index]
        assert action.table is not None
        gripper, box = action.gripper, action.box
        tools = compose(targets, inverse(situation.carried[box][1]))
        rotation, contact = rotation_matrix(tools[:, 3:]), tools[:, :3]
        reach = self._reach(index, self._arms[gripper], rotation, contact, contact + ways)
        if situation.state.carried_by(box):
            reach = self._level_reach(reach, gripper, situation)
        if not np.isfinite(reach.cost).any():
            self._trouble.note(index, 0, f"no inverse kinematics to place {box}")
            return
        down, free = situation.still(gripper, [(box, action.table)]), situation.still(gripper)
        planned = np.zeros(len(targets), dtype=int)
        for choice in reach.order()[:_CONFIGURATIONS]:
            number, pan, side = choice
            if planned[number] >= _ELBOWS:
                continue
            at, above = reach.q[number, :, pan, side]
            blocked = self._mover.collision(down, at[None])
            if blocked is not None:
                self._note(index, 1, "placing collision", blocked)
                continue
            blocked = self._mover.collision(free, above[None])
            if blocked is not None:
                self._note(index, 2, "descent collision", blocked)
                continue
            planned[number] += 1
            outcome = self._place(index, situation, reach, choice, ways[number])
            if outcome is not None:
                planned[number] = _ELBOWS
                yield outcome

    def _place(
        self,
        index: int,
        situation: Situation,
        reach: _Reach,
        choice: tuple[int, int, int],
        way: Array,
    ) -> Outcome | None:
        """Plan all motions of a place, straight lines first."""
        action, state = self._skeleton[index], situation.state
        assert action.table is not None
        gripper, box = action.gripper, action.box
        number, pan, side = choice
        start = situation.q[arm_slice(gripper)]
        angle = float(reach.pans[pan])
        tool = (reach.rotation[number], reach.contact[number])
        riders = state.carried_by(box)
        still = situation.still(gripper, [(box, action.table)])
        line = self._mover.line(still, tool, way, (angle, angle), side)
        if isinstance(line, str):
            self._trouble.note(index, 4, f"descent {line}")
            return None
        lowered = self._after(situation, [Motion(gripper, line[::-1])])
        opening, release = Fingers(gripper, FINGER_LIMITS[1]), Release((box, *riders))
        hand_over = self._hand_over(index, (box, *riders))
        left = self._after(lowered, [release, *hand_over, opening])
        left = replace(left, state=self._states[index + 1])
        leaving = left.still(gripper, [(gripper, box)])
        for direction, shift in product(_retreats(tool[0][:, 0]), _PAN_SHIFTS):
            back = self._mover.line(leaving, tool, direction, (angle, angle + shift), side)
            if isinstance(back, str):
                self._trouble.note(index, 5, f"retreat {back}")
                continue
            blocked = self._mover.collision(left.still(gripper), back[-1:])
            if blocked is not None:
                self._note(index, 6, "retreat collision", blocked)
                continue
            come = self._transit(
                situation.still(gripper), start, continuous_near(line[-1], start), bool(riders)
            )
            if come is None:
                self._trouble.note(index, 7, f"no motion found to place {box}")
                return None
            downward = wound(line[::-1], come[-1].path[-1])
            backward = wound(back, downward[-1])
            go = self._transit(left.still(gripper), backward[-1], HOME[gripper], level=False)
            if go is None:
                self._trouble.note(index, 8, f"no motion found from the place of {box}")
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
            final = self._after(left, steps[-1 - len(go) :])
            return Outcome(steps, final, lowered.keyframe(self._arms))
        return None

    def _hand_over(self, index: int, boxes: tuple[str, ...]) -> list[Step]:
        """Boxes placed on one that the other gripper carries move with that one from then on."""
        holder = self._root(index)[1]
        return [] if holder is None else [Attach(boxes, holder)]

    def _root(self, index: int) -> tuple[str | None, str | None]:
        """The lowest body below the place of an action, and who holds it, if anyone."""
        action, state = self._skeleton[index], self._states[index]
        root = action.table if action.instruction == "place" else state.support_of(action.box)
        while root is not None and state.support_of(root) is not None:
            root = state.support_of(root)
        return root, None if root is None else state.holder(root)

    def _alternatives(
        self, index: int, situation: Situation, support: Array, reference: Array
    ) -> list[Array]:
        action = self._skeleton[index]
        box, table = action.box, action.table
        assert table is not None
        on_table = table in self._tables
        poses = situation.boxes(self._arms)
        others = [
            (placement_of(support, poses[other]), self._half(other))
            for other in situation.state.standing_on(table)
        ]
        for j in range(index + 1, len(self._skeleton)):
            other = self._skeleton[j]
            if other.table == table and other.box != box:
                top = self._top(table, self._contacts[j])
                placement = placement_of(top, self._contacts[j].boxes[other.box])
                others.append((placement, self._half(other.box)))
        half = np.array(self._tables[table].half_extents) if on_table else self._half(table)
        return alternatives(
            reference,
            half,
            self._half(box),
            self._masses(index),
            others,
            _CLEARANCE if on_table else 0.0,
            on_table or situation.state.holder(table) is not None,
            self._rng,
            _SAMPLES,
        )

    def _masses(self, index: int) -> Array:
        """Centres of mass (n, 2), in its frame, of a placed box with what it will carry."""
        box = self._skeleton[index].box
        centres = [np.zeros(2)]
        for j in range(index, len(self._skeleton)):
            if j > index and self._skeleton[j].box == box:
                break
            bodies = (box, *self._states[j + 1].carried_by(box))
            poses = self._contacts[j].boxes
            weights = np.array([np.prod(self._boxes[body].size) for body in bodies])
            relative = compose(inverse(poses[box]), np.array([poses[body] for body in bodies]))
            centres.append(weights @ relative[:, :2] / weights.sum())
        return np.array(centres)

    # -- Shared ------------------------------------------------------------------------------

    def _reach(self, index: int, arm: Arm, rotation: Array, contact: Array, off: Array) -> _Reach:
        """Solve the inverse kinematics of N tool poses at the contact and off it."""
        q = self._contacts[index].q[arm_slice(arm.gripper)]
        pans = np.append(_PANS * arm.sign[0], q[0])
        positions = np.stack([contact, off], axis=1)[:, :, None]
        q, valid = arm.inverse(
            rotation[:, None, None], positions, np.broadcast_to(pans, (len(contact), 2, len(pans)))
        )
        distance = np.linalg.norm((q[:, 1] - arm.home) * REACH, axis=-1)
        cost = np.where(valid.all(axis=1), distance, np.inf)
        return _Reach(rotation, contact, q, pans, cost)

    def _level_reach(self, reach: _Reach, gripper: str, situation: Situation) -> _Reach:
        """What a level motion can reach: the elbow's side stays; the nearest first."""
        now = situation.q[arm_slice(gripper)]
        side = self._mover.side(gripper, now)
        distance = np.linalg.norm((continuous_near(reach.q[:, 1], now) - now) * REACH, axis=-1)
        cost = np.where(np.isfinite(reach.cost), distance, np.inf)
        cost[..., 1 - side] = np.inf
        return replace(reach, cost=cost)

    def _transit(self, still: Still, start: Array, goal: Array, level: bool) -> list[Motion] | None:
        plan = self._mover.level_transit if level else self._mover.transit
        paths = plan(still, start, goal, self._rng)
        free = Free(still, level)
        return None if paths is None else [Motion(still.mode.gripper, p, free) for p in paths]

    def _after(self, situation: Situation, steps: Sequence[Step]) -> Situation:
        for step in steps:
            situation = situation.after(step, self._arms)
        return situation

    def _opened(self, situation: Situation, gripper: str) -> Situation:
        return situation.after(Fingers(gripper, FINGER_LIMITS[1]), self._arms)

    def _top(self, table: str, keyframe: Keyframe) -> Array:
        """Pose (7,) of the top of a table or box."""
        if table in self._tables:
            return pose(self._tables[table].position, self._tables[table].yaw)
        return compose(keyframe.boxes[table], pose((0, 0, self._boxes[table].size[2] / 2)))

    def _half(self, box: str) -> Array:
        return np.array(self._boxes[box].size[:2]) / 2

    def _note(self, action: int, stage: int, what: str, pair: tuple[str, str]) -> None:
        self._trouble.note(action, stage, f"{what} {' '.join(pair)}")


def _upright(box: Array) -> Array:
    return pose(box[:3], float(yaw_of(box)))


def _lifts(approach: Array) -> list[Array]:
    """Directions (m) in which a held box leaves its support: up, up and back, a little up."""
    return [LIFT * _UP, LIFT * (0.8 * _UP - 0.6 * approach), 0.5 * LIFT * _UP]


def _retreats(approach: Array) -> list[Array]:
    """Directions (m) in which the open hand leaves a box: back, back and up, up."""
    return [-APPROACH * approach, APPROACH * (0.5 * _UP - approach), 0.11 * _UP]
