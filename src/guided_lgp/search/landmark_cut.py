"""The landmark-cut heuristic (Helmert and Domshlak, ICAPS 2009): admissible, domain-independent."""

import math
from collections.abc import Iterable

from guided_lgp.logic.strips import Fact, RelaxedOperator

_GOAL: Fact = ("goal",)


def landmark_cut(
    facts: frozenset[Fact], goals: frozenset[Fact], operators: Iterable[RelaxedOperator]
) -> float:
    """A lower bound on the number of actions from a set of facts to the goals.

    Disjunctive action landmarks are found one by one as cuts of the justification graph of h_max,
    and each takes its least cost away from its actions, so that they add up admissibly.

    Returns:
        The bound; infinity if the goals cannot be reached even without delete effects.
    """
    needs = [operator.preconditions for operator in operators] + [goals]
    adds = [operator.additions for operator in operators] + [frozenset({_GOAL})]
    costs = [1] * (len(needs) - 1) + [0]
    bound = 0
    while True:
        values = _h_max(facts, needs, adds, costs)
        if values.get(_GOAL, math.inf) == 0:
            return bound
        if _GOAL not in values:
            return math.inf
        reachable = [i for i, need in enumerate(needs) if all(fact in values for fact in need)]
        supporter = {i: max(needs[i], key=lambda fact: (values[fact], fact)) for i in reachable}
        zone = _goal_zone(supporter, adds, costs)
        cut = _cut(facts, supporter, adds, zone)
        least = min(costs[i] for i in cut)
        bound += least
        for i in cut:
            costs[i] -= least


def _h_max(
    facts: frozenset[Fact],
    needs: list[frozenset[Fact]],
    adds: list[frozenset[Fact]],
    costs: list[int],
) -> dict[Fact, int]:
    """Cost of the dearest precondition, recursively, of every reachable fact."""
    values = dict.fromkeys(facts, 0)
    changed = True
    while changed:
        changed = False
        for need, added, cost in zip(needs, adds, costs, strict=True):
            if not all(fact in values for fact in need):
                continue
            value = cost + max(values[fact] for fact in need)
            for fact in added:
                if value < values.get(fact, math.inf):
                    values[fact] = value
                    changed = True
    return values


def _goal_zone(
    supporter: dict[int, Fact], adds: list[frozenset[Fact]], costs: list[int]
) -> set[Fact]:
    """Facts from which the goal costs nothing in the justification graph."""
    zone = {_GOAL}
    changed = True
    while changed:
        changed = False
        for i, fact in supporter.items():
            if costs[i] == 0 and fact not in zone and not zone.isdisjoint(adds[i]):
                zone.add(fact)
                changed = True
    return zone


def _cut(
    facts: frozenset[Fact],
    supporter: dict[int, Fact],
    adds: list[frozenset[Fact]],
    zone: set[Fact],
) -> list[int]:
    """Operators that lead from what is reachable outside the zone into it."""
    before = set(facts)
    changed = True
    while changed:
        changed = False
        for i, fact in supporter.items():
            if fact in before and not adds[i] <= before | zone:
                before |= adds[i] - zone
                changed = True
    return [i for i, fact in supporter.items() if fact in before and not zone.isdisjoint(adds[i])]
