"""The same actions by other hands: who takes which body is a choice that a search makes early."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice, pairwise, product

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
from guided_lgp.search.result import Run, SearchResult, joined

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
