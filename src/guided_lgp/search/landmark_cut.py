"""The landmark-cut heuristic (Helmert and Domshlak, ICAPS 2009): admissible, domain-independent."""

import math
from collections.abc import Iterable, Iterator

from guided_lgp.logic.state import Fact
from guided_lgp.logic.strips import RelaxedOperator

_GOAL: Fact = ("goal",)
_UNREACHED = -1


class LandmarkCut:
    """A lower bound on the number of actions from a set of facts to the goals.

    Disjunctive action landmarks are found one by one as cuts of the justification graph of h_max,
    and each takes its least cost away from its actions, so that they add up admissibly. Facts and
    operators are numbers. Facts that no operator needs and no goal asks for are left out, and of
    the operators that then coincide one is kept, which changes no value.

    Args:
        goals: the facts to reach.
        operators: those of the task, without delete effects, each with a precondition.
    """

    def __init__(self, goals: frozenset[Fact], operators: Iterable[RelaxedOperator]) -> None:
        operators = list(operators)
        relevant = goals.union(*(operator.preconditions for operator in operators))
        rows = {(o.preconditions, o.additions & relevant): None for o in operators}
        rows[goals, frozenset({_GOAL})] = None
        self._number = {fact: number for number, fact in enumerate(sorted({*relevant, _GOAL}))}
        self._needs = [self._numbers(needs) for needs, _ in rows]
        self._adds = [self._numbers(adds) for _, adds in rows]
        self._goal = self._number[_GOAL]
        self._costs = [1] * (len(rows) - 1) + [0]
        self._needed_by = _inverse(self._needs, len(self._number))
        self._added_by = _inverse(self._adds, len(self._number))

    def _numbers(self, facts: Iterable[Fact]) -> list[int]:
        return sorted(self._number[fact] for fact in facts if fact in self._number)

    def __call__(self, facts: Iterable[Fact]) -> float:
        """The bound; infinity if the goals cannot be reached even without delete effects."""
        start = self._numbers(facts)
        costs = self._costs.copy()
        bound = 0
        while True:
            value, supporter = self._h_max(start, costs)
            if value == _UNREACHED:
                return math.inf
            if value == 0:
                return bound
            zone = self._goal_zone(supporter, costs)
            cut = set(self._cut(start, supporter, zone))
            least = min(costs[i] for i in cut)
            bound += least
            for i in cut:
                costs[i] -= least

    def _h_max(self, start: list[int], costs: list[int]) -> tuple[int, list[int]]:
        """h_max of the goal, and each operator's supporter: its dearest precondition.

        Facts are settled in the order of their value (Dijkstra), so that the last precondition
        to be settled is the dearest one.
        """
        value = [_UNREACHED] * len(self._number)
        settled = [False] * len(self._number)
        missing = [len(needs) for needs in self._needs]
        supporter = [_UNREACHED] * len(self._needs)
        for fact in start:
            value[fact] = 0
        layers = [list(start)]
        for depth, layer in enumerate(layers):  # both grow on the way
            for fact in layer:
                if settled[fact]:
                    continue
                settled[fact] = True
                for i in self._needed_by[fact]:
                    missing[i] -= 1
                    if missing[i]:
                        continue
                    supporter[i] = fact
                    reached = depth + costs[i]
                    for added in self._adds[i]:
                        if value[added] == _UNREACHED or reached < value[added]:
                            value[added] = reached
                            while len(layers) <= reached:
                                layers.append([])
                            layers[reached].append(added)
        return value[self._goal], supporter

    def _goal_zone(self, supporter: list[int], costs: list[int]) -> set[int]:
        """Facts from which the goal costs nothing in the justification graph."""
        zone = {self._goal}
        stack = [self._goal]
        while stack:
            for i in self._added_by[stack.pop()]:
                fact = supporter[i]
                if costs[i] == 0 and fact != _UNREACHED and fact not in zone:
                    zone.add(fact)
                    stack.append(fact)
        return zone

    def _cut(self, start: list[int], supporter: list[int], zone: set[int]) -> Iterator[int]:
        """Operators that lead from what is reachable outside the zone into it."""
        before = set(start)
        stack = list(start)
        while stack:
            fact = stack.pop()
            for i in self._needed_by[fact]:
                if supporter[i] != fact:
                    continue
                for added in self._adds[i]:
                    if added in zone:
                        yield i
                    elif added not in before:
                        before.add(added)
                        stack.append(added)


def _inverse(rows: list[list[int]], count: int) -> list[list[int]]:
    """For each number below ``count``, the rows that contain it."""
    inverse: list[list[int]] = [[] for _ in range(count)]
    for row, numbers in enumerate(rows):
        for number in numbers:
            inverse[number].append(row)
    return inverse
