"""Guided LGP, best-first: the policy as the heuristic of a complete search (beyond the paper)."""

from collections import Counter
from heapq import heappop, heappush
from typing import Literal

from guided_lgp.logic import Objective, State, Symbols, validate_objective
from guided_lgp.params import SearchLimits
from guided_lgp.scene import Scene
from guided_lgp.search.bounds import Bounds
from guided_lgp.search.guided import GuidedTree, Node
from guided_lgp.search.observation import start
from guided_lgp.search.policy import Policy
from guided_lgp.search.result import Run, SearchResult

Ordering = Literal["cumulative", "discrepancy"]
"""Cumulative log p, or log p - max log p of the siblings, summed along the sequence.

The first favours short sequences. On long tasks equally good actions split the probability, and it
expands all that is shorter first; the second takes a few more actions now and then, and its
expansions stay near their number."""

REVISIT = 3.0
"""Cost (nats) for every node expanded before with the same symbolic state.

It postpones detours and other orders of the same actions without excluding them: another way to
the same symbolic state may be the one that is geometrically feasible. Without it, a policy that
goes in circles makes the search explore all circles first, up to the maximum depth.
"""


def plan(
    scene: Scene,
    objective: Objective,
    symbols: Symbols,
    bounds: Bounds,
    policy: Policy,
    limits: SearchLimits,
    adapt: bool = True,
    ordering: Ordering = "discrepancy",
) -> SearchResult:
    """Take the best node of a frontier that keeps every child.

    A node costs what the ordering says, plus :data:`REVISIT`. A sequence whose coarse bound is
    infeasible is pruned with all that begins with it. Complete up to ``limits.max_depth``: whatever
    has a feasible sequence is found, unless ``limits.max_tree_size`` ends the search before. Equal
    costs: deeper first, then older first.

    Raises:
        InputError: the objective is contradictory, unknown or already satisfied.
    """
    validate_objective(objective, symbols, scene.state)
    run = Run(bounds, policy)
    tree = GuidedTree(scene, objective, symbols, run, adapt)
    visits: Counter[State] = Counter()

    def entry(node: Node) -> tuple[float, int, int, Node]:
        cost = -node.log_p if ordering == "cumulative" else -node.discrepancy
        return cost + REVISIT * visits[node.state], -len(node.skeleton), node.number, node

    frontier = [entry(tree.root)]
    while frontier:
        if limit := run.limit_reached(tree.size, limits):
            return run.result(tree.size, limit)
        known_cost, *_, node = heappop(frontier)
        updated = entry(node)
        if updated[0] > known_cost:  # its state has been visited since
            heappush(frontier, updated)
            continue
        configuration = start(scene)
        if node.skeleton:
            coarse = run.coarse(node.skeleton)
            if not coarse.feasible:
                continue
            configuration = coarse.retreated[-1]
        if tree.satisfied(node):
            if run.solve(node.skeleton):
                return run.result(tree.size)
            continue
        if len(node.skeleton) >= limits.max_depth:
            continue
        visits[node.state] += 1
        for child in tree.expand(node, configuration):
            heappush(frontier, entry(child))
    return run.result(tree.size, "exhausted")
