"""Best-first search: A*, and guided LGP with the policy as the heuristic of a complete search."""

from heapq import heappop, heappush

from guided_lgp.search.conflicts import Conflicts
from guided_lgp.search.estimates import (
    Estimate,
    FactsEstimate,
    InformedPolicyEstimate,
    LandmarkEstimate,
    PolicyEstimate,
    Rank,
    TunedEstimate,
)
from guided_lgp.search.informed import FactsOfPairs, Knowledge, NothingKnown
from guided_lgp.search.problem import Problem
from guided_lgp.search.result import SearchResult
from guided_lgp.search.skeleton_tree import Node, SkeletonTree


def plan(problem: Problem) -> SearchResult:
    """Guided LGP, best-first: the policy ranks the nodes (beyond the paper)."""
    return search(SkeletonTree(problem), PolicyEstimate(problem))


def plan_shortest(problem: Problem) -> SearchResult:
    """A*: landmark-cut ranks the nodes, and the first plan found is one of the shortest."""
    return search(SkeletonTree(problem), LandmarkEstimate(problem))


def plan_with_facts(problem: Problem) -> SearchResult:
    """A* with facts of the geometry: the first plan found is one of the shortest."""
    tree = SkeletonTree(problem)
    facts = FactsOfPairs(problem, tree.run)
    return search(tree, FactsEstimate(problem, facts), facts)


def plan_knowing(problem: Problem, facts: Knowledge) -> SearchResult:
    """The same with facts that are there already."""
    return search(SkeletonTree(problem), FactsEstimate(problem, facts), facts)


def plan_tuned(problem: Problem) -> SearchResult:
    """Best-first by a hand-made count of the actions that facts demand."""
    tree = SkeletonTree(problem)
    facts = FactsOfPairs(problem, tree.run)
    return search(tree, TunedEstimate(problem, facts), facts)


def plan_with_conflicts(problem: Problem) -> SearchResult:
    """Best-first by the same count, from the conflicts that the search itself has found."""
    tree = SkeletonTree(problem)
    conflicts = Conflicts(problem.scene, tree.run)
    return search(tree, TunedEstimate(problem, conflicts), conflicts)


def plan_by_discrepancy(problem: Problem) -> SearchResult:
    """Guided LGP, best-first, by the policy alone: what it thinks most probable is no detour.

    What is proved to be out of an arm's reach is not tried.
    """
    tree = SkeletonTree(problem)
    facts = FactsOfPairs(problem, tree.run)
    return search(tree, PolicyEstimate(problem, detour=0.0), facts)


def plan_informed(problem: Problem) -> SearchResult:
    """Guided LGP, best-first, with facts: only actions that they do not demand are a detour."""
    tree = SkeletonTree(problem)
    facts = FactsOfPairs(problem, tree.run)
    return search(tree, InformedPolicyEstimate(problem, facts), facts)


def search(
    tree: SkeletonTree, estimate: Estimate, knowledge: Knowledge | None = None
) -> SearchResult:
    """Take the node of the lowest rank from a frontier that keeps every child.

    Equal states are not merged: the first sequence to a state may be geometrically infeasible. A
    sequence whose coarse bound is infeasible is pruned when its turn comes, with all that begins
    with it. Complete up to ``limits.max_depth``: whatever has a feasible sequence is found, unless
    another limit ends the search before. Equal ranks: older first. What is known to be infeasible
    is not tried. Where several candidates are asked for, it goes on for others as short.
    """
    knowledge = knowledge or NothingKnown()

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
        if node.skeleton and knowledge.denied(node.skeleton):
            continue
        configuration = tree.configuration(node)
        if configuration is None:
            knowledge.learn(tree.run.failed)
            continue
        satisfied = tree.satisfied(node)
        if satisfied and tree.run.solve(node.skeleton):
            if tree.run.enough:
                return tree.result()
        elif tree.goes_on(satisfied) and len(node.skeleton) < tree.max_depth:
            estimate.expanded(node)
            for child in tree.expand(node, configuration):
                if estimate.least_length(child) <= tree.max_depth:
                    heappush(frontier, entry(child))
    return tree.result("exhausted")
