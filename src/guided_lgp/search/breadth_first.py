"""Breadth-first LGP: the baseline (paper, Sec. III-B, "original work")."""

from guided_lgp.search.problem import Problem
from guided_lgp.search.result import Run, SearchResult
from guided_lgp.search.tree import LogicTree


def plan(problem: Problem) -> SearchResult:
    """Expand the logic tree in order until a sequence that satisfies the objective is feasible.

    Equal states are not merged, and an infeasible sequence is expanded like any other: this is
    the plain tree of the original LGP. It has no maximum depth.
    """
    run = Run(problem)
    tree = LogicTree(problem.symbols, problem.scene.state)
    goals = tree.space.goal_states(problem.objective)
    node = 0
    while node < len(tree):
        if limit := run.limit_reached(len(tree)):
            return run.result(len(tree), limit)
        run.expansions += 1
        for child in tree.expand(node):
            if tree.state[child] in goals and run.solve(tree.skeleton(child)):
                return run.result(len(tree))
        node += 1
    return run.result(len(tree), "exhausted")
