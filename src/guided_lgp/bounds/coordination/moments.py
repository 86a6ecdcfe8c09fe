"""Whether all arms, each somewhere on its way, are clear of each other and of every body."""

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from guided_lgp.bounds.collision import PADDING, PlanningScene, checker_of
from guided_lgp.bounds.coordination.itinerary import Bodies, Itinerary
from guided_lgp.bounds.coordination.roads import Edge, Node, Road
from guided_lgp.bounds.results import Array
from guided_lgp.scene import Scene

_COARSE = 12
"""Every so-many-th moment is looked at first: what collides is found soon."""
_UNKNOWN, _CLEAR, _HIT = range(3)
_BESIDE = 4
"""Ticks around a collision that verification has found between moments that are clear."""

Position = tuple[Edge | Node, int]
"""A row of a motion, or a place where an arm rests."""
Moment = tuple[Position, ...]
"""Where all arms are, in the order of the robot."""


def later(position: Position, ticks: int) -> Position:
    """Where an arm is some ticks after."""
    where, row = position
    return position if isinstance(where, Node) else (where, row + ticks)


class Moments:
    """Looks for collisions, once for each moment."""

    def __init__(self, scene: Scene, roads: Mapping[str, Road], plan: Itinerary) -> None:
        self._checker = checker_of(scene)
        self._robot = scene.robot.description
        self._roads = roads
        self._plan = plan
        self._actions = [
            {number: stop.contact for number, stop in enumerate(stops) if stop.acts}
            for stops in plan.stops.values()
        ]
        self._verdicts: dict[tuple[Edge | Node | int, ...], NDArray[np.int8]] = {}
        """Of all moments at which the same arms are as far apart on their ways, one after the
        other."""
        self._placed: dict[frozenset[int], Bodies] = {}
        self._scenes: dict[tuple[frozenset[int], frozenset[int]], PlanningScene] = {}

    @property
    def actions(self) -> int:
        """How many all arms have to carry out."""
        return len(self._plan.changes)

    def clear(self, start: Moment, ticks: int) -> bool:
        """Whether all arms go on from a moment for some ticks without a collision."""
        known, place = self._known(start)
        verdicts = known[place : place + ticks + 1]
        if np.any(verdicts[1:] == _HIT):
            return False
        unknown = 1 + np.flatnonzero(verdicts[1:] == _UNKNOWN)
        coarse = np.s_[::-_COARSE]
        order = np.concatenate([unknown[coarse], np.delete(unknown, coarse)])
        return self._judge(start, order, verdicts)

    def met(self, moments: Sequence[Moment], rows: Array) -> tuple[float, Moment | None]:
        """The smallest distance (m) of two arms halfway between the rows (T, joints) of a schedule,
        where they may pass each other, and the moment before which it is; None if far enough.
        """
        halfway, nearest, met = (rows[1:] + rows[:-1]) / 2, PADDING, None
        by_scene: dict[tuple[frozenset[int], frozenset[int]], list[int]] = {}
        for number, moment in enumerate(moments[1:]):
            if sum(isinstance(at, Edge) for at, _ in moment) > 1:
                done = self._done(moment)
                by_scene.setdefault((done, self._contacts(moment, done)), []).append(number)
        for scene, numbers in by_scene.items():
            self._checker.enter(self._scene(*scene))
            nearest, row = self._checker.narrowest(halfway[numbers], nearest, between_arms=True)
            met = met if row is None else moments[1 + numbers[row]]
        return nearest, met

    def block(self, moment: Moment) -> None:
        """Never come near a moment again: what collides there passes the rows beside it, too."""
        if all(isinstance(where, Node) for where, _ in moment):
            return
        near = range(-_BESIDE, _BESIDE + 1)
        beside = [
            [at] if isinstance(at[0], Node) else [later(at, ticks) for ticks in near]
            for at in moment
        ]
        for other in product(*beside):
            known, place = self._known(other)
            if 0 <= place < len(known):
                known[place] = _HIT

    def over(self, moment: Moment) -> list[int]:
        """The last stop of every arm that is over."""
        return [
            road.over(where) if isinstance(where, Node) else where.over
            for road, (where, _) in zip(self._roads.values(), moment, strict=True)
        ]

    def _known(self, moment: Moment) -> tuple[NDArray[np.int8], int]:
        """What is known of all moments before and after one, up to which the same arms move on; and
        its place among them.
        """
        moving = [(where, row) for where, row in moment if isinstance(where, Edge)]
        (edge, place), *_ = moving
        key = (*(where for where, _ in moment), *(row - place for _, row in moving))
        if key not in self._verdicts:
            self._verdicts[key] = np.full(edge.ticks + 1, _UNKNOWN, dtype=np.int8)
        return self._verdicts[key], place

    def _judge(self, start: Moment, ticks: NDArray[np.intp], verdicts: NDArray[np.int8]) -> bool:
        """Whether moments some ticks (m,) after one, between which no action takes effect, are all
        clear; they are looked at up to the first that is not.
        """
        done = self._done(start)
        phases = self._phases(start, ticks)
        for phase in dict.fromkeys(phases.tolist()):
            those = ticks[phases == phase]
            contacts = self._contacts(tuple(later(at, int(those[0])) for at in start), done)
            self._checker.enter(self._scene(done, contacts))
            hit = self._checker.collisions(self._rows(start, those))
            first = next((row for row, _ in hit), len(those))
            verdicts[those[:first]] = _CLEAR
            if first < len(those):
                verdicts[those[first]] = _HIT
                return False
        return True

    def _phases(self, start: Moment, ticks: NDArray[np.intp]) -> NDArray[np.intp]:
        """Equal numbers (m,) some ticks after a moment for the same contacts of hands."""
        phases = np.zeros_like(ticks)
        for where, row in start:
            if isinstance(where, Edge):
                rows = row + ticks
                phases = 4 * phases + 2 * (rows < where.left) + (rows > where.coming)
        return phases

    def _rows(self, moment: Moment, ticks: NDArray[np.intp]) -> Array:
        """All moving joints (m, joints), some ticks (m,) after a moment."""
        rows = np.empty((len(ticks), len(self._robot.moving_joints)))
        arms = self._robot.arms.values()
        for arm, road, (where, row) in zip(arms, self._roads.values(), moment, strict=True):
            if isinstance(where, Node):
                q, fingers = road.rest(where)
                values = fingers * arm.fingers.ratios
            else:
                q, values = where.q[row + ticks], where.fingers[row + ticks, None]
                values = values * arm.fingers.ratios
            rows[:, arm.slice], rows[:, arm.fingers.slice] = q, values
        return rows

    def _done(self, moment: Moment) -> frozenset[int]:
        """The actions that have taken effect."""
        return frozenset(
            action
            for actions, over in zip(self._actions, self.over(moment), strict=True)
            for number, action in actions.items()
            if number <= over and action is not None
        )

    def _contacts(self, moment: Moment, done: frozenset[int]) -> frozenset[int]:
        """The actions in whose contacts hands are, or straight before or after them; not of a hand
        at a body with which another one is still, or already, on its way.
        """
        at = {
            gripper: road.contacts(where) if isinstance(where, Node) else where.contacts(row)
            for (gripper, road), (where, row) in zip(self._roads.items(), moment, strict=True)
        }
        carried, found = self._bodies(done).carried, set[int]()
        for gripper, contact in ((g, c) for g, contacts in at.items() for c in contacts):
            change = self._plan.changes[contact]
            carrier, _ = carried.get(change.body, (gripper, None))
            if contact in at[carrier] or gripper not in change.contacts:
                found.add(contact)
        return frozenset(found)

    def _bodies(self, done: frozenset[int]) -> Bodies:
        """Where all bodies are."""
        if done not in self._placed:
            self._placed[done] = self._plan.bodies(done)
        return self._placed[done]

    def _scene(self, done: frozenset[int], contacts: frozenset[int]) -> PlanningScene:
        """What is where, and what may touch."""
        if (done, contacts) not in self._scenes:
            self._scenes[done, contacts] = self._made(done, contacts)
        return self._scenes[done, contacts]

    def _made(self, done: frozenset[int], contacts: frozenset[int]) -> PlanningScene:
        bodies = self._bodies(done)
        held = {frozenset((box, hand)) for box, hand in bodies.holders.items() if hand is not None}
        at_contact = {
            frozenset((change.body, other))
            for change in (self._plan.changes[number] for number in contacts)
            for other in change.contacts
            if bodies.holders.get(change.body) in (None, *change.contacts)
        }
        first, *others = self._robot.grippers
        return PlanningScene(
            first,
            bodies.standing,
            bodies.carried,
            frozenset(held | at_contact),
            frozenset(others),
        )
