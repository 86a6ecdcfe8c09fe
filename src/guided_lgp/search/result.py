"""What a planner returns, and the bookkeeping that all planners share."""

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import astuple, dataclass, replace
from functools import partial
from typing import Literal, TypeVar

from guided_lgp.bounds.deadline import OutOfTimeError
from guided_lgp.bounds.results import Array, CoarseResult, Failure, PathResult
from guided_lgp.logic import (
    Action,
    Objective,
    Skeleton,
    State,
    Symbols,
    format_skeleton,
    progress,
    satisfied,
)
from guided_lgp.search.policy import Policy
from guided_lgp.search.problem import Problem

Verdict = TypeVar("Verdict", CoarseResult, PathResult)

Cause = Literal["infeasible", "max_depth", "max_seconds"]
"""Why an attempt of the guided search ended; the first two as in the paper (Table I)."""

Limit = Literal["max_tree_size", "max_sequences", "max_paths", "max_seconds"]
"""The limits that end a search, by their names in the parameters."""

Reason = Limit | Literal["exhausted", "attempts", "impossible", "given"]
"""Why a search ended without a plan: a limit, nothing left to expand, no reattempt left, a goal
that was known to be out of reach before any search, or a sequence given that is infeasible."""

REASONS: Mapping[Reason, str] = {
    "max_tree_size": "stopped at the limit of the tree size",
    "max_sequences": "stopped at the limit of sequences for the coarse bound",
    "max_paths": "stopped at the limit of sequences without a path",
    "max_seconds": "stopped at the limit of time",
    "exhausted": "every sequence within the depth limit is infeasible",
    "attempts": "the last allowed attempt failed",
    "impossible": "a goal is out of reach",
    "given": "the given sequence of actions is infeasible",
}
"""In words."""


@dataclass(frozen=True)
class Times:
    """Where the time of a search went (s).

    A verdict that another search has already computed counts with the time it took then.
    """

    symbolic: float
    policy: float
    coarse: float
    path: float

    @property
    def total(self) -> float:
        """Sum of all parts."""
        return self.symbolic + self.policy + self.coarse + self.path


@dataclass(frozen=True)
class SearchResult:
    """The plan found, or why there is none, and what the search cost."""

    coarse: CoarseResult | None
    path: PathResult | None
    tree_size: int
    """Nodes generated, root included, over all attempts."""
    expansions: int
    policy_calls: int
    coarse_calls: int
    infeasible_calls: int
    """Of the coarse calls, those with a verdict against the sequence ..."""
    part_calls: int
    """... and those with some of the boxes alone, for what follows for the whole scene."""
    path_calls: int
    failed_candidates: int
    """Sequences that reach the goals and that a bound has refused."""
    causes: tuple[Cause, ...]
    """Why each failed attempt ended, in order; empty for searches without attempts."""
    reattempts: Mapping[Cause, int]
    """How many attempts followed a failed one, by the cause of that failure."""
    times: Times
    reason: Reason | None = None
    failure: Failure | None = None
    """The last verdict of the NLP against a sequence, if there was one ..."""
    failed: Skeleton = ()
    """... and that sequence."""

    @property
    def solved(self) -> bool:
        """Whether a verified path was found."""
        return self.path is not None

    @property
    def skeleton(self) -> Skeleton | None:
        """The plan's sequence of actions."""
        return self.path.skeleton if self.path is not None else None

    @property
    def explanation(self) -> str:
        """One line: why there is no plan; empty if there is one."""
        if self.reason is None:
            return ""
        line = f"{REASONS[self.reason]} ({self.tree_size} nodes)"
        if self.failure is None:
            return line
        return f"{line}; last sequence tried: {format_skeleton(self.failed)}: {self.failure}"


def joined(first: SearchResult, second: SearchResult) -> SearchResult:
    """The second of two searches for one task, at the cost of both."""
    times = (a + b for a, b in zip(astuple(first.times), astuple(second.times), strict=True))
    both = {name: getattr(first, name) + getattr(second, name) for name in _COUNTS}
    both["reattempts"] = Counter(first.reattempts) + Counter(second.reattempts)
    return replace(second, **both, times=Times(*times))


_COUNTS = (
    *("tree_size", "expansions", "policy_calls", "coarse_calls", "infeasible_calls"),
    *("part_calls", "path_calls", "failed_candidates", "causes"),
)


Call = Skeleton | tuple[frozenset[str], Skeleton]
"""What the coarse bound is asked: a sequence, with all boxes or with some alone."""


class Run:
    """One run of a planner: the bounds and the policy as it sees them, with their cost."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        self._bounds = problem.bounds
        self._part = problem.parts.part
        self._limits = problem.limits
        self._deadline = problem.deadline
        self._cut_off = False
        self._start = time.perf_counter()
        self._waited = 0.0
        self._policy_s = self._coarse_s = self._path_s = 0.0
        self._asked: dict[Call, CoarseResult] = {}
        self._path_calls = self._policy_calls = 0
        self._failure: Failure | None = None
        self._refused: set[Skeleton] = set()
        self.failed: Skeleton = ()
        """The sequence of the last verdict against one; no feasible sequence begins with it."""
        self._causes: list[Cause] = []
        self.expansions = 0
        self._found: dict[Skeleton, tuple[CoarseResult, PathResult]] = {}

    def coarse(self, skeleton: Skeleton) -> CoarseResult:
        """P_coarse of a sequence, its prefixes first: they warm-start it.

        Returns:
            The verdict on ``skeleton``; if a prefix is already infeasible, the verdict on the
            shortest such prefix, which excludes everything that begins with it.
        """
        for length in range(1, len(skeleton) + 1):
            result = self._verdict(skeleton[:length])
            if not result.feasible:
                if not self._cut_off:
                    self._failure, self.failed = result.failure, result.skeleton
                    self._refused.add(skeleton)
                break
        return result

    def part(self, boxes: frozenset[str], skeleton: Skeleton) -> CoarseResult:
        """P_coarse of a sequence with some boxes alone, its prefixes first: calls as any other."""
        for length in range(1, len(skeleton) + 1):
            prefix = skeleton[:length]
            result = self._counted((boxes, prefix), partial(self._part, boxes), prefix)
            if not result.feasible:
                break
        return result

    def _verdict(self, skeleton: Skeleton) -> CoarseResult:
        return self._counted(skeleton, self._bounds.coarse, skeleton)

    def _counted(
        self, call: Call, bound: Callable[[Skeleton], CoarseResult], skeleton: Skeleton
    ) -> CoarseResult:
        result = self._asked.get(call)
        if result is None:
            start = time.perf_counter()
            none = CoarseResult(skeleton, feasible=False, restarts=0)
            result = self._asked[call] = self._in_time(bound, none)
            self._waited += time.perf_counter() - start
            self._coarse_s += result.time_s
        return result

    def solve(self, skeleton: Skeleton) -> bool:
        """Coarse, then path bound of a sequence that satisfies the objective."""
        if skeleton in self._found:
            return True
        if not self._problem.misplaced.keys() <= self._problem.moved(skeleton):
            return False
        coarse = self.coarse(skeleton)
        if not coarse.feasible:
            return False
        start = time.perf_counter()
        path = self._in_time(self._bounds.path, PathResult(skeleton, feasible=False))
        self._waited += time.perf_counter() - start
        self._path_s += path.time_s
        self._path_calls += 1
        if path.feasible:
            self._found[skeleton] = coarse, path
        elif not self._cut_off:
            self._failure, self.failed = path.failure, skeleton
            self._refused.add(skeleton)
        return path.feasible

    @property
    def enough(self) -> bool:
        """Whether as many plans have been found as there shall be candidates."""
        return len(self._found) >= self._problem.candidates

    @property
    def solution(self) -> tuple[CoarseResult, PathResult] | None:
        """The plan of the fewest actions found, of several the one of the least cost."""
        return min(self._found.values(), key=lambda found: cost(found[1]), default=None)

    def _in_time(self, bound: Callable[[Skeleton], Verdict], otherwise: Verdict) -> Verdict:
        """The verdict of a bound, or another one where the time is up."""
        try:
            return bound(otherwise.skeleton)
        except OutOfTimeError:
            self._cut_off = True
            return otherwise

    def log_probabilities(
        self,
        policy: Policy,
        objective: Objective,
        state: State,
        symbols: Symbols,
        positions: Mapping[str, Array],
        actions: Sequence[Action],
    ) -> Array:
        """A policy's scores of the actions; see :class:`~guided_lgp.search.policy.Policy`."""
        start = time.perf_counter()
        scores = policy.log_probabilities(objective, state, symbols, positions, actions)
        elapsed = time.perf_counter() - start
        self._policy_s += elapsed
        self._waited += elapsed
        self._policy_calls += 1
        return scores

    @property
    def expired(self) -> bool:
        """Whether the time is up."""
        return self._cut_off or self._deadline.passed

    def limit_reached(self, tree_size: int) -> Limit | None:
        """The limit that ends the search, if one is reached."""
        limits = self._limits
        if self._path_calls >= limits.max_paths:
            return "max_paths"
        if len(self._asked) >= limits.max_sequences:
            return "max_sequences"
        if self.expired:
            return "max_seconds"
        return "max_tree_size" if tree_size >= limits.max_tree_size else None

    def attempt_failed(self, cause: Cause) -> None:
        """Note the end of an attempt."""
        self._causes.append(cause)

    def result(self, tree_size: int, reason: Reason | None = None) -> SearchResult:
        """The result of the run: solved, or ended for a reason."""
        if self._found:
            reason = None
        elif reason is not None and self._cut_off:
            reason = "max_seconds"
        followed = self._causes if reason is None else self._causes[:-1]
        causes: tuple[Cause, ...] = ("infeasible", "max_depth")
        coarse, path = self.solution or (None, None)
        symbolic = time.perf_counter() - self._start - self._waited
        return SearchResult(
            coarse=coarse,
            path=path,
            tree_size=tree_size,
            expansions=self.expansions,
            policy_calls=self._policy_calls,
            coarse_calls=len(self._asked),
            infeasible_calls=sum(not verdict.feasible for verdict in self._asked.values()),
            part_calls=sum(isinstance(call[0], frozenset) for call in self._asked),
            path_calls=self._path_calls,
            failed_candidates=sum(map(self._reaches_goals, self._refused)),
            causes=tuple(self._causes),
            reattempts={cause: followed.count(cause) for cause in causes},
            times=Times(symbolic, self._policy_s, self._coarse_s, self._path_s),
            reason=reason,
            failure=None if reason is None else self._failure,
            failed=() if reason is None else self.failed,
        )

    def _reaches_goals(self, skeleton: Skeleton) -> bool:
        end = progress(self._problem.scene.state, skeleton)
        return satisfied(end, self._problem.objective)


_LIGHTER = 0.001
"""Share of its duration that a plan may take longer for every N with which hands may press less: up
to a twentieth for half of what the fingers of a PR2 can."""


def cost(path: PathResult) -> tuple[int, float]:
    """Actions, and duration (s) where the path has one, longer where grips are loaded more."""
    duration = 0.0 if path.trajectory is None else float(path.trajectory.times[-1])
    return len(path.skeleton), duration * (1 + _LIGHTER * path.load)
