"""Best-first search: A*, and guided LGP with the policy as the heuristic of a complete search."""

from heapq import heappop, heappush

from guided_lgp.search.estimates import Estimate, LandmarkEstimate, PolicyEstimate, Rank
from guided_lgp.search.problem import Problem
from guided_lgp.search.result import SearchResult
from guided_lgp.search.skeleton_tree import Node, SkeletonTree


def plan(problem: Problem) -> SearchResult:
    """Guided LGP, best-first: the policy ranks the nodes (beyond the paper)."""
    return search(SkeletonTree(problem), PolicyEstimate(problem))


def plan_shortest(problem: Problem) -> SearchResult:
    """A*: landmark-cut ranks the nodes, and the first plan found is one of the shortest."""
    return search(SkeletonTree(problem), LandmarkEstimate(problem))


def search(tree: SkeletonTree, estimate: Estimate) -> SearchResult:
    """Take the node of the lowest rank from a frontier that keeps every child.

    Equal states are not merged: the first sequence to a state may be geometrically infeasible. A
    sequence whose coarse bound is infeasible is pruned when its turn comes, with all that begins
    with it. Complete up to ``limits.max_depth``: whatever has a feasible sequence is found, unless
    another limit ends the search before. Equal ranks: older first.
    """
    max_depth = tree.problem.limits.max_depth

    def entry(node: Node) -> tuple[Rank, int, Node]:
        return estimate.rank(node), node.number, node

    frontier = [entry(tree.root)]
    while frontier:
        if limit := tree.limit_reached():
            return tree.result(limit)
        known_rank, _, node = heappop(frontier)
        if estimate.rank(node) > known_rank:  # it has grown since
            heappush(frontier, entry(node))
            continue
        configuration = tree.configuration(node)
        if configuration is None:
            continue
        if tree.satisfied(node):
            if tree.run.solve(node.skeleton):
                return tree.result()
        elif len(node.skeleton) < max_depth:
            estimate.expanded(node)
            for child in tree.expand(node, configuration):
                if estimate.least_length(child) <= max_depth:
                    heappush(frontier, entry(child))
    return tree.result("exhausted")
