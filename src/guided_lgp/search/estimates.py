"""In which order a best-first search takes its nodes, and which of them it keeps at all."""

from collections import Counter
from typing import Protocol

from guided_lgp.logic import State, least_actions
from guided_lgp.logic.strips import facts, goal_facts, relaxed_operators
from guided_lgp.search.informed import ActionsNeeded, InformedLandmarks, Knowledge
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


NEEDED = 3.0
"""What an action that is still needed costs, when one that has been made costs 1.

Hand-made, like the count of the actions: with 1, other ways to as good a state come first.
"""

_MOVE = 2
"""Actions that it takes to move a body which no symbol tells to be misplaced."""


class Estimate(Protocol):
    """What a best-first search expects of a node."""

    def rank(self, node: Node) -> Rank:
        """The rank of a node; it may grow while the node waits."""
        ...

    def least_length(self, node: Node) -> float:
        """Lower bound on the number of actions of a plan through a node."""
        return len(node.skeleton)

    def expanded(self, node: Node) -> None:
        """Note that a node is being expanded."""
        return


class PolicyEstimate(Estimate):
    """The policy as a heuristic.

    A node costs its discrepancy, a detour's cost per action, made or still missing at least, and
    :data:`REVISIT`. Equal costs: deeper first.
    """

    def __init__(self, problem: Problem, detour: float = DETOUR) -> None:
        self._problem = problem
        self._objective, self._symbols = problem.objective, problem.symbols
        self._detour = detour
        self._visits: Counter[State] = Counter()

    def rank(self, node: Node) -> Rank:
        """See :class:`Estimate`."""
        depth = len(node.skeleton)
        length = depth + self._needed(node)
        length += _MOVE * len(self._problem.unsettled(node.skeleton))
        cost = -node.discrepancy + self._detour * length + REVISIT * self._visits[node.state]
        return cost, -depth

    def _needed(self, node: Node) -> float:
        return least_actions(node.state, self._objective, self._symbols)

    def expanded(self, node: Node) -> None:
        """See :class:`Estimate`."""
        self._visits[node.state] += 1


class LandmarkEstimate(Estimate):
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
        return self.least_length(node), self._to_go(node)

    def least_length(self, node: Node) -> float:
        """See :class:`Estimate`."""
        return len(node.skeleton) + self._to_go(node)

    def _to_go(self, node: Node) -> float:
        value = self._known.get(node.state)
        if value is None:
            holds = facts(node.state, self._symbols)
            value = self._known[node.state] = self._landmark_cut(holds)
        return value


class FactsEstimate(LandmarkEstimate):
    """The same with facts of the geometry."""

    def __init__(self, problem: Problem, knowledge: Knowledge) -> None:
        super().__init__(problem)
        self._informed = InformedLandmarks(problem, knowledge)

    def _to_go(self, node: Node) -> float:
        return self._informed(node)


class TunedEstimate(Estimate):
    """A hand-made count of the actions still needed, which may be too high.

    A node costs the actions made, :data:`NEEDED` for each that is needed, and :data:`REVISIT` for
    every node expanded before with the same symbolic state.
    """

    def __init__(self, problem: Problem, knowledge: Knowledge) -> None:
        self._needed = ActionsNeeded(problem, knowledge)
        self._visits: Counter[State] = Counter()

    def rank(self, node: Node) -> Rank:
        """See :class:`Estimate`."""
        needed = self._needed(node)
        visited = REVISIT * self._visits[node.state]
        return len(node.skeleton) + NEEDED * needed + visited, needed

    def expanded(self, node: Node) -> None:
        """See :class:`Estimate`."""
        self._visits[node.state] += 1


class InformedPolicyEstimate(PolicyEstimate):
    """The policy as a heuristic; only actions beyond those that geometry demands are a detour."""

    def __init__(self, problem: Problem, knowledge: Knowledge) -> None:
        super().__init__(problem)
        self._actions_needed = ActionsNeeded(problem, knowledge)

    def _needed(self, node: Node) -> float:
        return self._actions_needed(node)
