"""When each arm does what: a short common schedule, by weighted A* over the ways of all arms.

A state is where every arm is: at rest, or some ticks into a motion. Arms wait at rest only. The
plan of one action after the other is a path in this graph; so is whatever is shorter.
"""

import math
from collections.abc import Iterator, Mapping
from heapq import heappop, heappush
from itertools import count, product

from guided_lgp.bounds.coordination.moments import Moment, Moments, Position, later
from guided_lgp.bounds.coordination.roads import Edge, Node, Road

_WAIT = 10
"""Ticks after which an arm that waits looks again."""
_HASTE, _CARE = 5.0, 2.0
"""Weights of the estimate: the heavier, the sooner a schedule is found. A second look with a
lighter one knows most collisions already."""
_STATES, _FEW = 250, 250
"""States that are expanded at most, for every action in haste, and with care in all. 8 to 20
actions took up to 190 for each, most often less than 50."""


def schedule(roads: Mapping[str, Road], moments: Moments) -> list[Moment] | None:
    """The moments of a short schedule, one per tick and the start before; None if there is none,
    or none is found in good time.
    """
    found: list[Moment] | None = None
    for weight, states in ((_HASTE, _STATES * moments.actions), (_CARE, _FEW)):
        below = math.inf if found is None else len(found) - 1
        found = _Search(roads, moments, weight, below).path(states) or found
    return found


class _Search:
    def __init__(
        self, roads: Mapping[str, Road], moments: Moments, weight: float, below: float
    ) -> None:
        """Prepare.

        Args:
            roads: of all arms, by gripper.
            moments: look for collisions.
            weight: of the estimate.
            below: ticks that a schedule may not take.
        """
        self._weight, self._below = weight, below
        self._roads = list(roads.values())
        self._grippers = list(roads)
        self._moments = moments
        self._parents: dict[Moment, tuple[Moment, Moment, int] | None] = {}
        """How each state was reached: from which, as which set out, and in how many ticks."""

    def path(self, expansions: int) -> list[Moment] | None:
        """The moments of a schedule, if one is found in so many expansions."""
        start: Moment = tuple((road.start, 0) for road in self._roads)
        if self._estimate(start)[0] >= self._below:
            return None
        order, costs = count(), {start: 0}
        self._parents[start] = None
        queue = [(*self._estimate(start), next(order), start)]
        expanded = set[Moment]()
        while queue and len(expanded) < expansions:
            *_, moment = heappop(queue)
            if moment in expanded:
                continue
            expanded.add(moment)
            if self._is_end(moment):
                return self._traced(moment)
            for leaving, ticks in self._choices(moment):
                reached = self._after(leaving, ticks)
                cost = costs[moment] + ticks
                if reached is None or cost >= costs.get(reached, cost + 1):
                    continue
                least, total = self._estimate(reached)
                if cost + least >= self._below or not self._moments.clear(leaving, ticks):
                    continue
                costs[reached], self._parents[reached] = cost, (moment, leaving, ticks)
                heappush(queue, (cost + self._weight * least, total, next(order), reached))
        return None

    def _choices(self, moment: Moment) -> Iterator[tuple[Moment, int]]:
        """Each way to go on: who sets out, and until when nothing is to be decided."""
        over = dict(zip(self._grippers, self._moments.over(moment), strict=True))
        options = [list(self._options(i, at, over)) for i, at in enumerate(moment)]
        for leaving in product(*options):
            moving = [(where, row) for where, row in leaving if isinstance(where, Edge)]
            if not moving:
                continue
            ticks = min(edge.ticks - row for edge, row in moving)
            waits = any(
                isinstance(at[0], Node) and len(choices) > 1
                for at, choices in zip(leaving, options, strict=True)
            )
            yield leaving, min(ticks, _WAIT) if waits else ticks

    def _options(self, arm: int, at: Position, over: Mapping[str, int]) -> Iterator[Position]:
        where, _ = at
        if isinstance(where, Node):
            for edge in self._roads[arm].edges(where):
                if _met(edge.needs, over):
                    yield edge, 0
        yield at

    def _after(self, leaving: Moment, ticks: int) -> Moment | None:
        """The state some ticks later; None if an arm would arrive too early."""
        over = dict(zip(self._grippers, self._moments.over(leaving), strict=True))
        reached: list[Position] = []
        for at in leaving:
            where, row = later(at, ticks)
            if isinstance(where, Edge) and row == where.ticks:
                if not _met(where.needs_at_end, over):
                    return None
                reached.append((where.end, 0))
            else:
                reached.append((where, row))
        return tuple(reached)

    def _estimate(self, moment: Moment) -> tuple[float, float]:
        """Ticks of the arm that needs longest, and of all arms, if none has to wait."""
        left = [
            road.remaining(where)
            if isinstance(where, Node)
            else where.ticks - row + road.remaining(where.end)
            for road, (where, row) in zip(self._roads, moment, strict=True)
        ]
        return max(left), sum(left)

    def _is_end(self, moment: Moment) -> bool:
        return all(
            isinstance(where, Node) and road.is_end(where)
            for road, (where, _) in zip(self._roads, moment, strict=True)
        )

    def _traced(self, moment: Moment) -> list[Moment]:
        moments: list[Moment] = []
        while (parent := self._parents[moment]) is not None:
            moment, leaving, ticks = parent
            moments += [tuple(later(at, t) for at in leaving) for t in range(ticks, 0, -1)]
        return [moment, *reversed(moments)]


def _met(needs: Mapping[str, int], over: Mapping[str, int]) -> bool:
    return all(over[gripper] >= stop for gripper, stop in needs.items())
