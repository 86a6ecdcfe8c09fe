"""Guided LGP, best-first: the policy as the heuristic of a complete search (beyond the paper)."""

from collections import Counter
from heapq import heappop, heappush

from guided_lgp.logic import Objective, State, Symbols, least_actions
from guided_lgp.params import SearchLimits
from guided_lgp.scene import Scene
from guided_lgp.search.bounds import Bounds
from guided_lgp.search.guided import GuidedTree, Node
from guided_lgp.search.policy import Policy
from guided_lgp.search.result import SearchResult

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


def plan(
    scene: Scene,
    objective: Objective,
    symbols: Symbols,
    bounds: Bounds,
    policy: Policy,
    limits: SearchLimits,
    adapt: bool = True,
) -> SearchResult:
    """Take the cheapest node of a frontier that keeps every child.

    A node costs its discrepancy, :data:`DETOUR` per action, made or still missing at least, and
    :data:`REVISIT`. A sequence whose coarse bound is infeasible is pruned with all that begins with
    it. Complete up to ``limits.max_depth``: whatever has a feasible sequence is found, unless
    another limit ends the search before. Equal costs: deeper first, then older first.

    Raises:
        InputError: the objective is contradictory, unknown or already satisfied.
    """
    tree = GuidedTree(scene, objective, symbols, bounds, policy, adapt)
    run = tree.run
    visits: Counter[State] = Counter()

    def entry(node: Node) -> tuple[float, int, int, Node]:
        depth = len(node.skeleton)
        length = depth + least_actions(node.state, objective)
        cost = -node.discrepancy + DETOUR * length + REVISIT * visits[node.state]
        return cost, -depth, node.number, node

    frontier = [entry(tree.root)]
    while frontier:
        if limit := run.limit_reached(tree.size, limits):
            return run.result(tree.size, limit)
        known_cost, *_, node = heappop(frontier)
        updated = entry(node)
        if updated[0] > known_cost:  # its state has been visited since
            heappush(frontier, updated)
            continue
        configuration = tree.configuration(node)
        if configuration is None:
            continue
        if tree.satisfied(node):
            if run.solve(node.skeleton):
                return run.result(tree.size)
        elif len(node.skeleton) < limits.max_depth:
            visits[node.state] += 1
            for child in tree.expand(node, configuration):
                heappush(frontier, entry(child))
    return run.result(tree.size, "exhausted")
