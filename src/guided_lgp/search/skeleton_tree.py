"""The tree of sequences behind the searches that ask the coarse bound before they go on."""

from collections.abc import Sequence
from dataclasses import dataclass

from guided_lgp.bounds.results import Keyframe
from guided_lgp.logic import (
    Action,
    Skeleton,
    State,
    applicable_actions,
    progress,
    satisfied,
    successor,
    unsatisfied,
)
from guided_lgp.logic.objectives import asks_for_places, encodable
from guided_lgp.search.observation import observe, shapes, start
from guided_lgp.search.policy import SeeingPolicy
from guided_lgp.search.problem import Problem
from guided_lgp.search.result import Limit, Reason, Run, SearchResult


@dataclass(frozen=True)
class Node:
    """A sequence of actions, and the policy's log-probabilities of it."""

    number: int
    """Order of generation, which breaks ties."""
    skeleton: Skeleton
    state: State
    log_p: float = 0.0
    """Of the whole sequence."""
    discrepancy: float = 0.0
    """By how much the sequence falls short of the most probable choices, summed over its actions:
    log p - max log p of the siblings."""


class SkeletonTree:
    """The nodes generated so far, from a sequence that is given, as a rule the empty one.

    A policy, if there is one, scores the children of each.
    """

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.run = Run(problem)
        prefix = problem.prefix
        self.root = Node(0, prefix, progress(problem.scene.state, prefix))
        self.size = 1

    def satisfied(self, node: Node) -> bool:
        """Whether the goals hold at a node."""
        return satisfied(node.state, self.problem.objective)

    def goes_on(self, satisfied: bool) -> bool:
        """Whether what begins with a node may be a plan, when the node is none.

        Where the goals hold, only if they ask for places: another sequence may end elsewhere.
        """
        return not satisfied or asks_for_places(self.problem.objective, self.problem.symbols)

    def configuration(self, node: Node) -> Keyframe | None:
        """x_k = P_coarse(a_1:k)|_k (paper, eq. 3), the arm retreated; None if infeasible."""
        if not node.skeleton:
            return start(self.problem.scene)
        coarse = self.run.coarse(node.skeleton)
        return coarse.after_action[-1] if coarse.feasible else None

    def expand(self, node: Node, configuration: Keyframe) -> list[Node]:
        """Generate the children of a node, in the fixed order of the logic.

        Args:
            node: a node whose sequence is feasible.
            configuration: x_k, the configuration at the end of that sequence.
        """
        actions = list(applicable_actions(node.state, self.problem.symbols))
        scores = self._scores(node, configuration, actions)
        best = max(scores)
        children = [
            Node(
                number,
                (*node.skeleton, action),
                successor(node.state, action),
                node.log_p + score,
                node.discrepancy + score - best,
            )
            for number, (action, score) in enumerate(zip(actions, scores, strict=True), self.size)
        ]
        self.run.expansions += 1
        self.size += len(children)
        return children

    def _scores(
        self, node: Node, configuration: Keyframe, actions: Sequence[Action]
    ) -> Sequence[float]:
        problem, policy = self.problem, self.problem.policy
        if policy is None:
            return [0.0] * len(actions)
        if isinstance(policy, SeeingPolicy):
            policy = policy.given(shapes(problem.scene, configuration))
        goals = unsatisfied(node.state, problem.objective) if problem.adapt else problem.objective
        goals = encodable(goals, problem.symbols)
        if not goals:
            return [0.0] * len(actions)
        positions = observe(problem.scene, configuration)
        scores: list[float] = self.run.log_probabilities(
            policy, goals, node.state, problem.scene.symbols, positions, actions
        ).tolist()
        return scores

    @property
    def max_depth(self) -> int:
        """How long sequences may be: at the limit, or as long as the shortest plan known."""
        known = self.run.solution
        limit = self.problem.limits.max_depth
        return limit if known is None else min(limit, len(known[1].skeleton))

    def limit_reached(self) -> Limit | None:
        """The limit that ends the search, if one is reached."""
        return self.run.limit_reached(self.size)

    def result(self, reason: Reason | None = None) -> SearchResult:
        """The result of the search: solved, or ended for a reason."""
        return self.run.result(self.size, reason)
