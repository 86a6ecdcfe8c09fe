"""Guided LGP: a policy chooses the next action (paper, Sec. II-C and Appendix)."""

from guided_lgp.logic import State
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


def search(tree: SkeletonTree, max_depth: int) -> SearchResult:
    """See :func:`plan`; attempts end at a depth of their own."""
    unexplored = [tree.root]
    excluded: set[State] = set()
    for _ in range(1 + tree.problem.limits.reattempts):
        if not unexplored:
            return tree.result("exhausted")
        if limit := tree.limit_reached():
            return tree.result(limit)
        node = _take_most_probable(unexplored, excluded)
        cause = _attempt(node, tree, unexplored, excluded, max_depth)
        if tree.run.enough:
            return tree.result()
        if cause is not None:
            tree.run.attempt_failed(cause)
    return tree.result("attempts" if unexplored else "exhausted")


def _attempt(
    node: Node, tree: SkeletonTree, unexplored: list[Node], excluded: set[State], max_depth: int
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
        if tree.run.expired:
            return "max_seconds"
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
