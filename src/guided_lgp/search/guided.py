"""Guided LGP: a policy chooses the next action (paper, Sec. II-C and Appendix)."""

from collections import Counter
from collections.abc import Set as AbstractSet

from guided_lgp.logic import Action, State
from guided_lgp.search.problem import Problem
from guided_lgp.search.result import Cause, SearchResult
from guided_lgp.search.skeleton_tree import Node, SkeletonTree


def plan(problem: Problem) -> SearchResult:
    """Follow the most probable action; reattempt from the most probable unexplored node.

    An attempt ends when the NLP of its sequence is infeasible (coarse bound at every step, path
    bound when the goals hold) or at ``limits.max_depth``; ``limits.reattempts`` more follow. What
    failed is excluded: sequences that are infeasible, and the symbolic states of an attempt that
    ran to the maximum depth, where the policy would go in the same circles again. From then on
    neither they nor states passed in the attempt itself are entered, unless nothing else is left.
    """
    return search(SkeletonTree(problem), problem.limits.max_depth)


def plan_with_doubts(problem: Problem) -> SearchResult:
    """The same, but what has failed is thought less probable wherever it may come next.

    What keeps a hand from a box does so, as a rule, wherever other boxes have been put meanwhile.
    """
    return search(SkeletonTree(problem), problem.limits.max_depth, DOUBT)


DOUBT = 3.0
"""Cost (nats) of an action for each verdict against it: it gets twenty times less probable."""


def search(tree: SkeletonTree, max_depth: int, doubt: float = 0.0) -> SearchResult:
    """See :func:`plan`; attempts end at a depth of their own, and failures cost some nats."""
    return _Search(tree, max_depth, doubt).result()


class _Search:
    def __init__(self, tree: SkeletonTree, max_depth: int, doubt: float) -> None:
        self._tree, self._max_depth, self._doubt = tree, max_depth, doubt
        self._unexplored = [tree.root]
        self._excluded: set[State] = set()
        self._failures: Counter[Action] = Counter()

    def result(self) -> SearchResult:
        tree = self._tree
        for _ in range(1 + tree.problem.limits.reattempts):
            if not self._unexplored:
                return tree.result("exhausted")
            if limit := tree.limit_reached():
                return tree.result(limit)
            cause = self._attempt(self._take_most_probable(self._unexplored, self._excluded))
            if tree.run.enough:
                return tree.result()
            if cause is not None:
                tree.run.attempt_failed(cause)
        return tree.result("attempts" if self._unexplored else "exhausted")

    def _attempt(self, node: Node) -> Cause | None:
        """Extend a node greedily; None if a verified path satisfies the objective."""
        tree, excluded = self._tree, self._excluded
        passed: set[State] = set()
        while True:
            configuration = tree.configuration(node)
            if configuration is None:
                self._failures[tree.run.failed[-1]] += 1
                return "infeasible"
            if tree.satisfied(node):
                return None if tree.run.solve(node.skeleton) else "infeasible"
            passed.add(node.state)
            if tree.run.expired:
                return "max_seconds"
            if len(node.skeleton) >= self._max_depth:
                excluded |= passed
                return "max_depth"
            children = tree.expand(node, configuration)
            node = self._take_most_probable(children, excluded | passed if excluded else excluded)
            self._unexplored += children

    def _take_most_probable(self, nodes: list[Node], excluded: AbstractSet[State]) -> Node:
        """Remove the most probable node, of an excluded state only if all are; ties: the older."""
        chosen = min(
            nodes, key=lambda node: (node.state in excluded, self._cost(node), node.number)
        )
        nodes.remove(chosen)
        return chosen

    def _cost(self, node: Node) -> float:
        """What speaks against a node (nats)."""
        failures = self._failures[node.skeleton[-1]] if node.skeleton else 0
        return self._doubt * failures - node.log_p
