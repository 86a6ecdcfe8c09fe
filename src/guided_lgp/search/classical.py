"""A* with a classical heuristic: a rival of the guided search."""

from heapq import heappop, heappush

from guided_lgp.logic import Objective, Symbols, validate_objective
from guided_lgp.logic.strips import facts, goal_facts, relaxed_operators
from guided_lgp.params import SearchLimits
from guided_lgp.scene import Scene
from guided_lgp.search.bounds import Bounds
from guided_lgp.search.landmark_cut import LandmarkCut
from guided_lgp.search.result import Run, SearchResult
from guided_lgp.search.tree import GoalStates, LogicTree


def plan(
    scene: Scene, objective: Objective, symbols: Symbols, bounds: Bounds, limits: SearchLimits
) -> SearchResult:
    """A* over the logic tree: the first sequence found feasible is one of the shortest.

    The heuristic is landmark-cut, computed once per symbolic state. Equal states are not merged,
    because the first sequence to a state may be geometrically infeasible; in exchange, a sequence
    whose coarse bound is infeasible is pruned when its turn comes, with all that begins with it.
    Equal estimates: nearer to the goal first, then older first.

    Raises:
        InputError: the objective is contradictory, unknown or already satisfied.
    """
    validate_objective(objective, symbols, scene.state)
    run = Run(bounds)
    tree = LogicTree(symbols, scene.state)
    goals = GoalStates(tree.space, objective)
    estimate = _Heuristic(tree, symbols, objective)
    frontier = [(estimate(0), estimate(0), 0, 0)]
    while frontier:
        if limit := run.limit_reached(len(tree), limits):
            return run.result(len(tree), limit)
        _, _, node, depth = heappop(frontier)
        skeleton = tree.skeleton(node)
        if skeleton and not run.coarse(skeleton).feasible:
            continue
        if tree.state[node] in goals:
            if run.solve(skeleton):
                return run.result(len(tree))
            continue
        run.expansions += 1
        for child in tree.expand(node):
            to_go = estimate(tree.state[child])
            if depth + 1 + to_go <= limits.max_depth:
                heappush(frontier, (depth + 1 + to_go, to_go, child, depth + 1))
    return run.result(len(tree), "exhausted")


class _Heuristic:
    """Landmark-cut of the states of a tree, each computed once."""

    def __init__(self, tree: LogicTree, symbols: Symbols, objective: Objective) -> None:
        self._states = tree.space.states
        self._symbols = symbols
        self._landmark_cut = LandmarkCut(goal_facts(objective), relaxed_operators(symbols))
        self._known: dict[int, float] = {}

    def __call__(self, state: int) -> float:
        value = self._known.get(state)
        if value is None:
            start = facts(self._states[state], self._symbols)
            value = self._known[state] = self._landmark_cut(start)
        return value
