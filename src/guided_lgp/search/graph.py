"""Breadth-first search with duplicate detection: a rival of the guided search."""

from collections.abc import Iterator

from guided_lgp.logic import Objective, Skeleton
from guided_lgp.search.problem import Problem
from guided_lgp.search.result import Run, SearchResult
from guided_lgp.search.tree import StateSpace, distances


def plan(problem: Problem) -> SearchResult:
    """Breadth-first over distinct states, then all sequences through them in order of length.

    The first sequence may be geometrically infeasible, so the graph is kept with all its
    transitions and read off backwards: sequences of length 1, 2, ... that reach the objective for
    the first time at their end. What begins with an infeasible sequence is left out. Ends at
    ``limits.max_depth`` or ``limits.max_tree_size``; the tree size is the number of distinct states
    plus that of the nodes of the sequences read off.
    """
    run = Run(problem)
    limits = problem.limits
    space = StateSpace(problem.symbols, problem.scene.state)
    graph = _Graph(space, problem.objective, limits.max_tree_size)
    for length in range(1, limits.max_depth + 1):
        run.expansions += graph.expand_layer()
        for skeleton in graph.sequences(length):
            if run.solve(skeleton):
                return run.result(graph.size)
            if limit := run.limit_reached(graph.size):
                return run.result(graph.size, limit)
            graph.excluded.add(run.failed)
        if limit := run.limit_reached(graph.size):
            return run.result(graph.size, limit)
    return run.result(graph.size, "exhausted")


class _Graph:
    """The states within some number of actions of the start, all expanded."""

    def __init__(self, space: StateSpace, objective: Objective, max_size: int) -> None:
        self._space = space
        self._objective = objective
        self._goals = space.goal_states(objective)
        self._max_size = max_size
        self._expanded = 0
        self._goal_found = 0 in self._goals
        self._sequence_nodes = 0
        self.excluded: set[Skeleton] = set()

    @property
    def size(self) -> int:
        return len(self._space) + self._sequence_nodes

    def expand_layer(self) -> int:
        """Expand the states found last, up to the limit of the size; how many they were."""
        known, begun = len(self._space), self._expanded
        while self._expanded < known and self.size < self._max_size:
            self._space.targets(self._expanded)
            self._expanded += 1
        found = range(known, len(self._space))
        self._goal_found = self._goal_found or any(state in self._goals for state in found)
        return self._expanded - begun

    def sequences(self, length: int) -> Iterator[Skeleton]:
        """Sequences of one length to the objective that pass no excluded one."""
        if self._goal_found:
            to_go = distances(self._space, self._objective)
            yield from self._extend((), 0, length, to_go)

    def _extend(
        self, prefix: Skeleton, state: int, length: int, to_go: dict[int, int]
    ) -> Iterator[Skeleton]:
        if length == 0:
            yield prefix
            return
        for action, target in self._space.transitions(state):
            steps = to_go.get(target, length)
            if steps > length - 1 or (steps == 0 and length > 1):
                continue
            if prefix in self.excluded or self.size >= self._max_size:
                return
            self._sequence_nodes += 1
            child = (*prefix, action)
            if child not in self.excluded:
                yield from self._extend(child, target, length - 1, to_go)
