"""Guided LGP: a policy chooses the next action (paper, Sec. II-C and Appendix)."""

from dataclasses import dataclass

from guided_lgp.bounds.results import Keyframe
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
        return coarse.after_action[-1] if coarse.feasible else None

    def expand(self, node: Node, configuration: Keyframe) -> list[Node]:
        """Generate the children of a node, in the fixed order of the logic.

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
        return children


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
    bound when the goals hold) or at ``limits.max_depth``; ``limits.reattempts`` more follow. What
    failed is excluded: sequences that are infeasible, and the symbolic states of an attempt that
    ran to the maximum depth, where the policy would go in the same circles again. From then on
    neither they nor states passed in the attempt itself are entered, unless nothing else is left.

    Args:
        adapt: objective adaptation: encode only the goals that do not hold yet (Sec. III-A).

    Raises:
        InputError: the objective is contradictory, unknown or already satisfied.
    """
    tree = GuidedTree(scene, objective, symbols, bounds, policy, adapt)
    run = tree.run
    unexplored = [tree.root]
    excluded: set[State] = set()
    for _ in range(1 + limits.reattempts):
        if not unexplored:
            return run.result(tree.size, "exhausted")
        if limit := run.limit_reached(tree.size, limits):
            return run.result(tree.size, limit)
        node = _take_most_probable(unexplored, excluded)
        cause = _attempt(node, tree, unexplored, excluded, limits.max_depth)
        if cause is None:
            return run.result(tree.size)
        run.attempt_failed(cause)
    return run.result(tree.size, "attempts" if unexplored else "exhausted")


def _attempt(
    node: Node, tree: GuidedTree, unexplored: list[Node], excluded: set[State], max_depth: int
) -> Cause | None:
    """Extend a node greedily; None if a verified path satisfies the objective."""
    passed: set[State] = set()
    while True:
        configuration = tree.configuration(node)
        if configuration is None:
            return "infeasible"
        if tree.satisfied(node):
            return None if tree.run.solve(node.skeleton) else "infeasible"
        passed.add(node.state)
        if len(node.skeleton) >= max_depth:
            excluded |= passed
            return "max_depth"
        children = tree.expand(node, configuration)
        node = _take_most_probable(children, excluded | passed if excluded else excluded)
        unexplored += children


def _take_most_probable(nodes: list[Node], excluded: set[State]) -> Node:
    """Remove the most probable node, of an excluded state only if all are; ties: the older."""
    chosen = min(nodes, key=lambda node: (node.state in excluded, -node.log_p, node.number))
    nodes.remove(chosen)
    return chosen
