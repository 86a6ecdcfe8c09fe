"""The same actions by other hands, or at other places: choices that a search makes early."""

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice, pairwise, product

from guided_lgp.bounds.deadline import OutOfTimeError
from guided_lgp.bounds.results import PathResult
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.logic import (
    Action,
    Skeleton,
    State,
    Symbols,
    are_applicable,
    progress,
    satisfied,
    successor,
)
from guided_lgp.search.problem import Problem
from guided_lgp.search.result import Run, SearchResult, cost, joined

_MOST = 4096
"""Choices of hands that are looked through at most; where there are more, none is made."""
_LOOKS = 3
"""Sequences that are judged for every plan that there shall be: an arm may not reach a body."""


@dataclass(frozen=True)
class _Hold:
    """A hand has a body, from the action that puts it there to the one that takes it away."""

    gripper: str
    first: int
    last: int


def faster(problem: Problem, found: SearchResult, candidates: int, by_hands: int) -> SearchResult:
    """The plan that a search has found, or a faster one of the same actions.

    Args:
        problem: what it is a plan for.
        found: a result with a plan.
        candidates: how many plans to compare at most; those that the search has found count.
        by_hands: how many of these by other hands; the rest is at other places.
    """
    again = 0
    if by_hands:
        found, again = faster_by_other_hands(problem, found, by_hands), 1
    assert found.coarse is not None
    assert isinstance(problem.parts, SceneBounds)
    rest = max(candidates + again - found.path_calls, 0)
    return faster_at_other_places(found, problem.parts.other_paths(found.coarse.skeleton, rest))


def faster_by_other_hands(problem: Problem, found: SearchResult, count: int) -> SearchResult:
    """The plan that a search has found, or a faster one of the same actions by other hands.

    Args:
        problem: what it is a plan for.
        found: a result with a plan.
        count: how many more plans to compare at most.
    """
    assert found.coarse is not None
    given, state = found.coarse.skeleton, problem.scene.state
    run = Run(replace(problem, candidates=1 + count))
    run.solve(given)
    others = with_other_hands(given, state, problem.symbols)
    reaching = (s for s in others if satisfied(progress(state, s), problem.objective))
    for skeleton in islice(reaching, _LOOKS * count):
        if run.enough or run.limit_reached(0):
            break
        run.solve(skeleton)
    return joined(found, run.result(0))


def faster_at_other_places(found: SearchResult, paths: Iterator[PathResult]) -> SearchResult:
    """The plan that a search has found, or the fastest of its actions at other places.

    Args:
        found: a result with a plan.
        paths: further motions of it, at other places and by other grips.
    """
    assert found.path is not None
    began, best = time.perf_counter(), found.path
    with suppress(OutOfTimeError):
        for path in paths:
            best = min(best, path, key=cost)
    spent = time.perf_counter() - began
    times = replace(found.times, path=found.times.path + spent)
    return replace(found, path=best, times=times)


def with_other_hands(skeleton: Skeleton, state: State, symbols: Symbols) -> Iterator[Skeleton]:
    """The same actions by other hands, where these are free.

    First those in which the busiest hand has least to do, of these those in which hands take turns
    most often: they leave most to do at once.

    Args:
        skeleton: applicable actions.
        state: before them.
        symbols: whose grippers the hands are.
    """
    holds = _holds(skeleton, state)
    if len(symbols.grippers) ** len(holds) > _MOST:
        return
    choices = list(product(symbols.grippers, repeat=len(holds)))
    choices.sort(key=lambda hands: (max(Counter(hands).values(), default=0), -_turns(hands)))
    for hands in choices:
        changed = _renamed(skeleton, holds, hands)
        if changed != skeleton and are_applicable(changed, state, symbols):
            yield changed


def _holds(skeleton: Skeleton, state: State) -> list[_Hold]:
    """All holds that begin in a sequence, in order."""
    since: dict[tuple[str, str], int] = {}
    found = []
    for number, action in enumerate(skeleton):
        before, state = state, successor(state, action)
        for body, gripper in sorted(set(before.held) - set(state.held)):
            first = since.pop((body, gripper), None)
            found += [] if first is None else [_Hold(gripper, first, number)]
        since |= dict.fromkeys(sorted(set(state.held) - set(before.held)), number)
    found += [_Hold(gripper, first, len(skeleton)) for (_, gripper), first in since.items()]
    return sorted(found, key=lambda hold: hold.first)


def _turns(hands: Sequence[str]) -> int:
    """How often another hand is next."""
    return sum(one != other for one, other in pairwise(hands))


def _renamed(skeleton: Skeleton, holds: Sequence[_Hold], hands: Sequence[str]) -> Skeleton:
    """The actions with other hands in the holds."""
    names = {
        (number, hold.gripper): hand
        for hold, hand in zip(holds, hands, strict=True)
        for number in range(hold.first, min(hold.last + 1, len(skeleton)))
    }
    return tuple(
        Action(a.instruction, tuple(names.get((number, symbol), symbol) for symbol in a.symbols))
        for number, a in enumerate(skeleton)
    )
