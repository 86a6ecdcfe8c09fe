"""The search for users: guided first, then best-first."""

from guided_lgp.logic import least_actions
from guided_lgp.search import best_first, guided
from guided_lgp.search.estimates import PolicyEstimate
from guided_lgp.search.problem import Problem
from guided_lgp.search.result import SearchResult, joined
from guided_lgp.search.skeleton_tree import SkeletonTree


def plan(problem: Problem) -> SearchResult:
    """Follow the policy greedily; where that fails, search best-first with what is known by then.

    An attempt of the policy that takes twice the least number of actions goes in circles and ends.
    Where a goal needs further instructions, the second search has them.
    Complete up to ``limits.max_depth``, unless another limit ends the search before.
    """
    tree = SkeletonTree(problem)
    least = least_actions(tree.root.state, problem.objective, problem.symbols)
    depth = min(len(problem.prefix) + 2 * least + 2, problem.limits.max_depth)
    result = guided.search(tree, int(depth))
    if tree.run.enough or result.reason not in (None, "attempts", "exhausted"):
        return result  # what is exhausted is so within the depth of an attempt
    if not result.solved and (wider := problem.widened()) is not None:
        return joined(result, best_first.plan(wider))
    return best_first.search(tree, PolicyEstimate(problem))
