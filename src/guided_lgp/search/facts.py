"""Facts of a task: what single arms and supports allow, and what that says about its goals.

The facts before a search are proofs and take milliseconds. Those after one that has failed ask the
coarse bound about small parts of the scene.
"""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cached_property
from itertools import combinations

from guided_lgp.bounds.coarse.pairs import Pairs
from guided_lgp.bounds.coarse.parts import Boxes, stacked_with
from guided_lgp.bounds.deadline import NEVER, Deadline
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.bounds.terms.level import CARRY_ANGLE
from guided_lgp.bounds.terms.stand import tilt
from guided_lgp.domains import extensions, load_domain
from guided_lgp.logic import (
    Action,
    Objective,
    Skeleton,
    State,
    applicable_actions,
    format_skeleton,
    successor,
    unsatisfied,
)
from guided_lgp.logic.domain import GroundInstruction
from guided_lgp.logic.grounding import ground_instructions
from guided_lgp.logic.objectives import parents_wanted_by
from guided_lgp.robots import Robot
from guided_lgp.scene.bodies import Box, Table
from guided_lgp.scene.footprints import footprint, gap
from guided_lgp.scene.grasps import is_held_flat
from guided_lgp.scene.world import initial_poses
from guided_lgp.search.conflicts import Conflicts
from guided_lgp.search.finding import Finding
from guided_lgp.search.lengths import too_far
from guided_lgp.search.room import cover, crowded, is_wide_for, untouchable
from guided_lgp.search.surroundings import barriers
from guided_lgp.search.ways import ways_onto

_FINGERS = 0.03
"""Gap (m) between boxes into which no finger fits."""


class TaskFacts:
    """The facts of one objective in one scene, each found when it is first asked for."""

    def __init__(
        self,
        bounds: SceneBounds,
        objective: Objective,
        misplaced: Iterable[str] = (),
        deadline: Deadline = NEVER,
    ) -> None:
        """Begin with none.

        Args:
            bounds: of the scene.
            objective: the goals.
            misplaced: bodies that the goals want elsewhere on what they stand on.
            deadline: that of the bounds.
        """
        self.scene = bounds.scene
        self._misplaced = sorted(misplaced)
        self._deadline = deadline
        self._bounds = bounds
        self._objective = objective
        self._symbols, self._state = self.scene.symbols, self.scene.state
        self._boxes = {box.name: box for box in self.scene.movable}

    def before_search(self) -> Finding | None:
        """What rules a plan out whatever is tried; None if nothing is known to."""
        return next(self._proofs(), None)

    def after_search(self) -> Finding | None:
        """What small parts of the scene say when a search has found nothing.

        Raises:
            OutOfTimeError: the deadline of the bounds has passed.
        """
        return next(self._suspicions(), None)

    def about(self, skeleton: Skeleton) -> Finding | None:
        """The smallest part of an infeasible sequence that is infeasible alone, if not all of it.

        Raises:
            OutOfTimeError: the deadline of the bounds has passed.
        """
        conflicts = Conflicts(self.scene, self._bounds)
        conflicts.learn(skeleton)
        (found,) = conflicts.found
        if found.boxes >= set(self._boxes):
            return None
        names = " and ".join(name for name in self._boxes if name in found.boxes)
        actions = format_skeleton(found.actions)
        text = f"{actions} cannot be done, even with {names} alone in the scene"
        several = len(found.boxes) > 1
        what = "space between them" if several else f"move {names} or the robot"
        return Finding("part", text, f"{what}, or take another way")

    # before

    def _proofs(self) -> Iterator[Finding]:
        for body, parents in self._moves():
            still = self._state.support_of(body) in self._symbols.surfaces
            if still or self._state.parent_of(body) not in parents:  # else others may carry it
                yield from self._ungraspable(body)
            if still:
                yield from self._stuck(body)
            if self._denied(body, parents):
                yield self._out_of_reach(" and ".join(sorted(parents)))
            yield from self._too_low(body, parents)
        yield from self._tilted()
        for support in self._symbols.tables:
            boxes = [self._boxes[name] for name in self._wanted_on(support)]
            spare = len(self._boxes) - len(boxes) - (support in self._boxes)
            yield from crowded(self._body(support), boxes, counterweights=spare > 0)

    def _moves(self) -> Iterator[tuple[str, frozenset[str]]]:
        """The bodies that goals want elsewhere, and the parents that they leave to them."""
        for goal in unsatisfied(self._state, self._objective):
            for body, parents in parents_wanted_by(goal, self._symbols).items():
                if self._state.parent_of(body) not in parents:
                    yield body, parents
        for body in self._misplaced:
            yield body, frozenset({self._state.parent_of(body)})

    def _ungraspable(self, body: str) -> Iterator[Finding]:
        """Why no hand closes on a body, unless one holds it already."""
        if self._state.holder(body) is not None:
            return
        narrowest, widest = min(self._boxes[body].grasp_widths), self._widest
        flat = any(
            is_held_flat(self._boxes[body], self.scene.bodies, arm.fingers.grasp_width)
            for arm in self._robot.arms.values()
        )
        if narrowest > widest and not flat:
            yield Finding(
                "width",
                f"{body} is too wide for the fingers: {narrowest:.3f} m at its narrowest side",
                f"a side of at most {widest:.3f} m",
            )
        else:
            yield from untouchable(self._boxes[body], widest)

    def _stuck(self, body: str) -> Iterator[Finding]:
        """Why no arm can move a body from the furniture that it stands on."""
        takings = self._takings(body)
        if takings and all(map(self._cannot_take, takings)):
            yield self._out_of_reach(body)

    def _tilted(self) -> Iterator[Finding]:
        """Bodies in hands that goals want level all the time, and are not so at the start."""
        for goal in self._objective:
            for term in self._symbols.domain.lasting_terms(goal):
                body, poses = term.symbols[0], initial_poses(self.scene)
                if term.name == "upright" and tilt(poses[body].tolist()) > CARRY_ANGLE:
                    angle, holder = tilt(poses[body].tolist()), self._state.holder(body)
                    text = f"{body} is to stay level, and {holder} holds it tilted by {angle:.2f}"
                    what = "another grasp or posture at the start"
                    yield Finding("tilted", f"{text} rad at the start", what)

    def _cannot_take(self, taking: Action) -> bool:
        """Whether it is proved that an arm does not reach a box at its start."""
        ground = self._symbols.domain.bind(taking)
        short = too_far(self.scene, ground.parent, self._boxes[ground.body])
        return short or self._bounds.out_of_reach((taking,))

    def _denied(self, body: str, parents: frozenset[str]) -> bool:
        """Whether all parents are furniture on which no arm can put a body."""
        ways = [
            one
            for one in ground_instructions(self._symbols)
            if one.body == body and one.parent in parents
        ]
        surfaces = set(self._symbols.surfaces)
        return parents <= surfaces and all(map(self._cannot_put, ways))

    def _cannot_put(self, ground: GroundInstruction) -> bool:
        """Whether it is proved that an arm cannot put a body on furniture."""
        support = next(one for one in self.scene.supports if one.name == ground.parent)
        short = too_far(self.scene, ground.actor, self._boxes[ground.body], support)
        return short or self._bounds.facts.never(ground)

    def _out_of_reach(self, names: str) -> Finding:
        text = f"{names} is out of reach of {self._every_arm}"
        return Finding("reach", text, f"move {names} or the robot")

    def _too_low(self, body: str, parents: frozenset[str]) -> Iterator[Finding]:
        """Furniture where a body cannot stand, since something covers it that is too low.

        Where a body is put down, the centre of mass of all that hangs on it is above the support
        and inside the body: above that point, body and cover would meet.
        """
        box = self._boxes[body]
        supports = {one.name: one for one in self.scene.supports if one.name in parents}
        covers = {name: cover(self.scene, one, box) for name, one in supports.items()}
        if len(supports) < len(parents):
            return
        for name, above in covers.items():
            if above is None:
                return
            room = above.placement[2] - above.convex.half[2] - supports[name].top[2]
            yield Finding(
                "room",
                f"no room on {name} for {body}: it is {box.size[2]:.3f} m high, and {above.name} "
                f"covers all of {name} {room:.3f} m above it",
                f"a higher {above.name}, or a lower {body}",
            )

    def _wanted_on(self, support: str) -> list[str]:
        """The boxes that goals want on a support."""
        wanted = [parents_wanted_by(goal, self._symbols) for goal in self._objective]
        found = {body for one in wanted for body, parents in one.items() if parents == {support}}
        return sorted(found)

    def _body(self, support: str) -> Table | Box:
        bodies = {body.name: body for body in (*self.scene.supports, *self.scene.movable)}
        return bodies[support]

    # after

    def _suspicions(self) -> Iterator[Finding]:
        moves = list(self._moves())
        for body, _ in moves:
            if not self.graspable_by(body) and self._takings(body):
                yield self._kept_from(body)
            yield from self._deadlock(body)
        for body, parents in moves:
            if parents <= set(self._symbols.surfaces):
                yield from self._no_way(body, parents)
        for support in self._symbols.tables:
            for one, other in combinations(self._wanted_on(support), 2):
                yield from self._too_tight(one, other, support)

    def _kept_from(self, body: str) -> Finding:
        """Why no arm takes a body that is alone with what stands still."""
        fixed = barriers(body, self._takings(body), self.scene, self._deadline)
        if not fixed:
            text = f"{self._every_arm} fail to grasp {body} there, {self._even_alone(body)}"
            flat = min(self._boxes[body].grasp_widths) > self._widest
            what = "let it jut out farther" if flat else f"a smaller {body}"
            return Finding("reach", text, f"move {body} or the robot, or {what}")
        several = ", ".join(fixed)
        text = f"{several} around {body}: {self._every_arm} fail to grasp it, even as the only box"
        return Finding("blocked", text, f"space between {body} and {several}")

    def graspable_by(self, body: str) -> tuple[str, ...]:
        """The grippers that can take a body where it is at the start, alone with its stack.

        Of a body in a hand, that one.
        """
        held = self._held(body)
        return tuple(gripper for gripper, taking, _ in held if not taking or self._done(taking))

    def reachable_by(self, body: str, support: str) -> tuple[str, ...]:
        """The grippers that can take a body and put it on a support, alone with its stack."""
        found = []
        for gripper, taking, after in self._held(body):
            for action in applicable_actions(after, self._symbols):
                one = self._symbols.domain.bind(action)
                if (one.body, one.parent, one.actor) == (body, support, gripper):
                    found += [gripper] if self._done((*taking, action)) else []
        return tuple(found)

    def _held(self, body: str) -> Iterator[tuple[str, Skeleton, State]]:
        """Grippers that hold a body, what has been done for that, and the state then."""
        holder = self._state.holder(body)
        if holder is not None:
            held = sorted({*self._hands_empty.held, (body, holder)})
            yield holder, (), replace(self._state, held=tuple(held))
        for taking in self._takings(body):
            yield taking.symbols[0], (taking,), successor(self._hands_empty, taking)

    def _no_way(self, body: str, parents: Iterable[str]) -> Iterator[Finding]:
        """No single arm brings a body to any of some supports."""
        supports = sorted(parents)
        if any(self.reachable_by(body, support) for support in supports):
            return
        names, arms = " or ".join(supports), " and ".join(self.graspable_by(body))
        takes = self._further_instructions()
        yield Finding(
            "way",
            f"{body} can be taken by {arms}, which cannot put it on {names}, "
            f"{self._even_alone(body)}",
            f"furniture between, which both arms reach{takes}; or move {names} or the robot",
        )

    def _too_tight(self, one: str, other: str, support: str) -> Iterator[Finding]:
        """Two boxes that no arm puts onto a support together, where it is not much wider."""
        wide = is_wide_for(self._body(support), self._boxes[one], self._boxes[other])
        ways = ways_onto(support, {one, other}, self._state, self._symbols)
        if not wide and not any(map(self._done, ways)):
            text = f"no arm puts {one} and {other} on {support} together, even with nothing else"
            yield Finding("room", f"{text} there", f"a larger {support}, or a smaller {one}")

    def _done(self, skeleton: Skeleton) -> bool:
        """Whether a sequence can be done with what it moves alone in the scene."""
        bodies = {self._symbols.domain.bind(action).body for action in skeleton}
        boxes = Boxes().union(*(stacked_with(skeleton, self.scene, body) for body in bodies))
        return self._feasible(boxes, skeleton)

    def _feasible(self, boxes: Boxes, skeleton: Skeleton) -> bool:
        prefixes = (skeleton[:length] for length in range(1, len(skeleton) + 1))
        return all(self._bounds.part(boxes, prefix).feasible for prefix in prefixes)

    def _even_alone(self, body: str) -> str:
        """What is left in the scene where a body is looked at, in words."""
        above = sorted(self._state.carried_by(body))
        several = f"with {' and '.join([body, *above])} " if above else ""
        return f"even {several}alone in the scene"

    def _further_instructions(self) -> str:
        """What a domain that extends that of the scene would add, in words."""
        own = {instruction.name for instruction in self._symbols.domain.instructions}
        wider = extensions(self.scene.domain)
        added = {
            name: [one.name for one in load_domain(name).instructions if one.name not in own]
            for name in wider
        }
        return "".join(f"; --domain {name} ({', '.join(new)})" for name, new in added.items())

    def _deadlock(self, body: str) -> Iterator[Finding]:
        """Boxes, beginning with one, none of which can be taken while the others are there."""
        found = [body]
        for name in found:  # it grows on the way
            blockers = self._blockers(name)
            if blockers is None or self._state.support_of(name) not in self._symbols.surfaces:
                return
            found += sorted(blockers - set(found))
        if len(found) > 1:
            names = [name for name in self._boxes if name in found]
            several = ", ".join(names)
            yield Finding(
                "blocked",
                f"the {self._hand(names)} do not fit between {several}: none of them can be taken "
                "while the others stand there",
                f"space between {several}",
            )

    def _blockers(self, body: str) -> Boxes | None:
        """What keeps from a body the arms that could take it alone; None if one of them can."""
        found = Boxes()
        for action in self._takings(body):
            blockers = self._pairs.blockers(action)
            if not blockers:
                return None
            if Boxes() not in blockers:
                found = found.union(*blockers)
        return found

    def _hand(self, names: list[str]) -> str:
        """What does not fit: fingers, or hands where there is more space."""
        places = [footprint(self._boxes[name]) for name in names]
        nearest = [min(gap(a, b) for b in places if b is not a) for a in places]
        return "fingers" if max(nearest) < _FINGERS else "hands"

    def _takings(self, body: str) -> list[Action]:
        """The ways to take a body at the start, by a hand that may be full until then, too."""
        bind = self._symbols.domain.bind
        if self._state.holder(body) is not None:
            return []
        every = applicable_actions(self._hands_empty, self._symbols)
        return [a for a in every if bind(a).body == body and bind(a).into_hand]

    @cached_property
    def _hands_empty(self) -> State:
        """The state at the start without what is in a hand, alone."""
        loaded = self.scene.loaded.items()
        return replace(self._state, held=tuple(h for h in self._state.held if h in loaded))

    @cached_property
    def _pairs(self) -> Pairs:
        return Pairs(self.scene, self._bounds.coarse, self._bounds.part)

    @property
    def _widest(self) -> float:
        """The widest side (m) that one of the hands can take."""
        return max(arm.fingers.grasp_width for arm in self._robot.arms.values())

    @property
    def _robot(self) -> Robot:
        return self.scene.robot.description

    @property
    def _every_arm(self) -> str:
        count = len(self._symbols.grippers)
        return {1: "the arm", 2: "both arms"}.get(count, f"all {count} arms")
