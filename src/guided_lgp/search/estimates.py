"""In which order a best-first search takes its nodes, and which of them it keeps at all."""

from collections import Counter
from typing import Protocol

from guided_lgp.logic import State, least_actions
from guided_lgp.logic.strips import facts, goal_facts, relaxed_operators
from guided_lgp.search.landmark_cut import LandmarkCut
from guided_lgp.search.problem import Problem
from guided_lgp.search.skeleton_tree import Node

Rank = tuple[float, float]
"""What a node costs, and what decides between nodes of equal cost; the lowest comes first."""

DETOUR = 2.0
"""Cost (nats) of every action that brings no goal nearer.

By the policy alone, short plans and few expansions exclude each other: the summed log p favours
short sequences, and on long tasks, where equally good actions split the probability, it expands
all that is shorter first; the discrepancy expands little and takes a few more actions now and then.
"""

REVISIT = 3.0
"""Cost (nats) for every node expanded before with the same symbolic state.

It postpones other orders of the same actions without excluding them: another way to the same
symbolic state may be the one that is geometrically feasible.
"""


class Estimate(Protocol):
    """What a best-first search expects of a node."""

    def rank(self, node: Node) -> Rank:
        """The rank of a node; it may grow while the node waits."""
        ...

    def least_length(self, node: Node) -> float:
        """Lower bound on the number of actions of a plan through a node."""
        ...

    def expanded(self, node: Node) -> None:
        """Note that a node is being expanded."""
        ...


class PolicyEstimate:
    """The policy as a heuristic.

    A node costs its discrepancy, :data:`DETOUR` per action, made or still missing at least, and
    :data:`REVISIT`. Equal costs: deeper first.
    """

    def __init__(self, problem: Problem) -> None:
        self._objective, self._symbols = problem.objective, problem.symbols
        self._visits: Counter[State] = Counter()

    def rank(self, node: Node) -> Rank:
        """See :class:`Estimate`."""
        depth = len(node.skeleton)
        length = depth + least_actions(node.state, self._objective, self._symbols)
        cost = -node.discrepancy + DETOUR * length + REVISIT * self._visits[node.state]
        return cost, -depth

    def least_length(self, node: Node) -> float:
        """See :class:`Estimate`."""
        return len(node.skeleton)

    def expanded(self, node: Node) -> None:
        """See :class:`Estimate`."""
        self._visits[node.state] += 1


class LandmarkEstimate:
    """Least number of actions by landmark-cut: the first plan found is one of the shortest.

    Equal estimates: nearer to the goal first.
    """

    def __init__(self, problem: Problem) -> None:
        self._symbols = problem.symbols
        operators = relaxed_operators(problem.symbols)
        self._landmark_cut = LandmarkCut(goal_facts(problem.objective, problem.symbols), operators)
        self._known: dict[State, float] = {}

    def rank(self, node: Node) -> Rank:
        """See :class:`Estimate`."""
        return self.least_length(node), self._to_go(node.state)

    def least_length(self, node: Node) -> float:
        """See :class:`Estimate`."""
        return len(node.skeleton) + self._to_go(node.state)

    def expanded(self, node: Node) -> None:
        """See :class:`Estimate`; what is expanded changes nothing here."""

    def _to_go(self, state: State) -> float:
        value = self._known.get(state)
        if value is None:
            value = self._known[state] = self._landmark_cut(facts(state, self._symbols))
        return value
