"""Whether all arms, each somewhere on its way, are clear of each other and of every body."""

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np
from numpy.typing import NDArray

from guided_lgp.bounds.collision import PlanningScene, checker_of
from guided_lgp.bounds.coordination.itinerary import Itinerary
from guided_lgp.bounds.coordination.roads import Edge, Node, Road
from guided_lgp.bounds.results import Array
from guided_lgp.scene import Scene

_COARSE = 12
"""Every so-many-th moment is looked at first: what collides is found soon."""
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
        self._roads = list(roads.values())
        self._plan = plan
        self._actions = [
            {number: stop.contact for number, stop in enumerate(stops) if stop.acts}
            for stops in plan.stops.values()
        ]
        self._clear: dict[Moment, bool] = {}
        self._scenes: dict[tuple[frozenset[int], frozenset[int]], PlanningScene] = {}

    def clear(self, start: Moment, ticks: int) -> bool:
        """Whether all arms go on from a moment for some ticks without a collision."""
        moments = [tuple(later(at, tick) for at in start) for tick in range(1, ticks + 1)]
        if not all(self._clear.get(moment, True) for moment in moments):
            return False
        unknown = [tick for tick, moment in enumerate(moments) if moment not in self._clear]
        first = unknown[::-_COARSE]
        rest = [tick for tick in unknown if tick not in first]
        return self._judge(moments, first) and self._judge(moments, rest)

    def block(self, moment: Moment) -> None:
        """Never come near a moment again: what collides there passes the rows beside it, too."""
        near = range(-_BESIDE, _BESIDE + 1)
        beside = [
            [at] if isinstance(at[0], Node) else [later(at, ticks) for ticks in near]
            for at in moment
        ]
        self._clear |= dict.fromkeys(product(*beside), False)

    def over(self, moment: Moment) -> list[int]:
        """The last stop of every arm that is over."""
        return [
            road.over(where) if isinstance(where, Node) else where.over
            for road, (where, _) in zip(self._roads, moment, strict=True)
        ]

    def _judge(self, moments: Sequence[Moment], some: Sequence[int]) -> bool:
        """Whether some of the moments are clear between which no action takes effect."""
        by_contacts: dict[frozenset[int], list[int]] = {}
        for tick in some:
            by_contacts.setdefault(self._contacts(moments[tick]), []).append(tick)
        done = self._done(moments[0])
        for contacts, ticks in by_contacts.items():
            self._checker.enter(self._scene(done, contacts))
            clear = self._checker.free(self._rows(moments[0], np.array(ticks)))
            self._clear |= zip((moments[tick] for tick in ticks), clear.tolist(), strict=True)
            if not clear.all():
                return False
        return True

    def _rows(self, moment: Moment, ticks: NDArray[np.int_]) -> Array:
        """All moving joints (m, joints), some ticks (m,) after a moment."""
        rows = np.empty((len(ticks), len(self._robot.moving_joints)))
        arms = self._robot.arms.values()
        for arm, road, (where, row) in zip(arms, self._roads, moment, strict=True):
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

    def _contacts(self, moment: Moment) -> frozenset[int]:
        """The actions in whose contacts hands are, or straight before or after them."""
        return frozenset(
            contact
            for road, (where, row) in zip(self._roads, moment, strict=True)
            for contact in (
                road.contacts(where) if isinstance(where, Node) else where.contacts(row)
            )
        )

    def _scene(self, done: frozenset[int], contacts: frozenset[int]) -> PlanningScene:
        """What is where, and what may touch."""
        if (done, contacts) not in self._scenes:
            self._scenes[done, contacts] = self._made(done, contacts)
        return self._scenes[done, contacts]

    def _made(self, done: frozenset[int], contacts: frozenset[int]) -> PlanningScene:
        bodies = self._plan.bodies(done)
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
