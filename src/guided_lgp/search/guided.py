"""Guided LGP: a policy chooses the next action (paper, Sec. II-C and Appendix)."""

from dataclasses import dataclass
from heapq import heappop, heappush

from guided_lgp.logic import (
    Objective,
    Skeleton,
    State,
    Symbols,
    applicable_actions,
    satisfied,
    successor,
    unsatisfied,
    validate_objective,
)
from guided_lgp.nlp.results import Keyframe
from guided_lgp.params import SearchLimits
from guided_lgp.scene import Scene
from guided_lgp.search.bounds import Bounds
from guided_lgp.search.observation import observe, start
from guided_lgp.search.policy import Policy
from guided_lgp.search.result import Cause, Run, SearchResult


@dataclass(frozen=True)
class Node:
    """A node of the guided tree: the sequence to it and the policy's log-probabilities."""

    number: int
    """Order of generation, which breaks ties."""
    skeleton: Skeleton
    state: State
    log_p: float = 0.0
    """Of the whole sequence."""
    discrepancy: float = 0.0
    """By how much the sequence falls short of the most probable choices, summed over its actions:
    log p - max log p of the siblings."""


class GuidedTree:
    """The nodes generated so far; a policy ranks the children of every expanded node.

    Raises:
        InputError: the objective is contradictory, unknown or already satisfied.
    """

    def __init__(
        self,
        scene: Scene,
        objective: Objective,
        symbols: Symbols,
        bounds: Bounds,
        policy: Policy,
        adapt: bool,
    ) -> None:
        validate_objective(objective, symbols, scene.state)
        self.run = Run(bounds, policy)
        self._scene = scene
        self._objective = objective
        self._symbols = symbols
        self._adapt = adapt
        self.root = Node(0, (), scene.state)
        self.size = 1

    def satisfied(self, node: Node) -> bool:
        """Whether the goals hold at a node."""
        return satisfied(node.state, self._objective)

    def configuration(self, node: Node) -> Keyframe | None:
        """x_k = P_coarse(a_1:k)|_k (paper, eq. 3), the arm retreated; None if infeasible."""
        if not node.skeleton:
            return start(self._scene)
        coarse = self.run.coarse(node.skeleton)
        return coarse.retreated[-1] if coarse.feasible else None

    def expand(self, node: Node, configuration: Keyframe) -> list[Node]:
        """Generate the children of a node, most probable first.

        Args:
            node: a node whose sequence is feasible.
            configuration: x_k, the configuration at the end of that sequence.
        """
        actions = list(applicable_actions(node.state, self._symbols))
        goals = unsatisfied(node.state, self._objective) if self._adapt else self._objective
        positions = observe(self._scene, configuration)
        scores = self.run.log_probabilities(goals, node.state, positions, actions).tolist()
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
        return sorted(children, key=lambda child: -child.log_p)


def plan(
    scene: Scene,
    objective: Objective,
    symbols: Symbols,
    bounds: Bounds,
    policy: Policy,
    limits: SearchLimits,
    adapt: bool = True,
) -> SearchResult:
    """Follow the most probable action; reattempt from the most probable unexplored node.

    An attempt ends when the NLP of its sequence is infeasible (coarse bound at every step, path
    bound when the goals hold) or at ``limits.max_depth``; ``limits.reattempts`` more follow.

    Args:
        adapt: objective adaptation: encode only the goals that do not hold yet (Sec. III-A).

    Raises:
        InputError: the objective is contradictory, unknown or already satisfied.
    """
    tree = GuidedTree(scene, objective, symbols, bounds, policy, adapt)
    run = tree.run
    unexplored: list[tuple[float, int, Node]] = []
    node = tree.root
    for _ in range(1 + limits.reattempts):
        cause = _attempt(node, tree, unexplored, limits.max_depth)
        if cause is None:
            return run.result(tree.size)
        run.attempt_failed(cause)
        if not unexplored:
            return run.result(tree.size, "exhausted")
        if limit := run.limit_reached(tree.size, limits):
            return run.result(tree.size, limit)
        node = heappop(unexplored)[-1]
    return run.result(tree.size, "attempts")


def _attempt(
    node: Node, tree: GuidedTree, unexplored: list[tuple[float, int, Node]], max_depth: int
) -> Cause | None:
    """Extend a node greedily; None if a verified path satisfies the objective."""
    while True:
        configuration = tree.configuration(node)
        if configuration is None:
            return "infeasible"
        if tree.satisfied(node):
            return None if tree.run.solve(node.skeleton) else "infeasible"
        if len(node.skeleton) >= max_depth:
            return "max_depth"
        node, *others = tree.expand(node, configuration)
        for other in others:
            heappush(unexplored, (-other.log_p, other.number, other))
