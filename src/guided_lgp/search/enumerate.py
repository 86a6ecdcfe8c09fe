"""Exhaustive enumeration of the feasible sequences of one scene, for many objectives at once."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from guided_lgp.bounds.results import CoarseResult
from guided_lgp.logic import Objective, Skeleton, State, Symbols
from guided_lgp.search.bounds import Bounds
from guided_lgp.search.tree import StateSpace, distances


@dataclass(frozen=True)
class Enumeration:
    """Verdicts of the coarse bound, and what follows from them for each objective."""

    verdicts: tuple[CoarseResult, ...]
    """Every sequence that was tried, in order; none has an infeasible prefix."""
    shortest: Mapping[Objective, int | None]
    """Length of the shortest feasible sequences; 0: holds at the start; None: none found."""
    symbolic: Mapping[Objective, int | None]
    """Length of the shortest sequences by the logic alone; None: there is none at all."""


def enumerate_sequences(
    start: State,
    symbols: Symbols,
    objectives: Sequence[Objective],
    bounds: Bounds,
    max_length: int,
    slack: int = 0,
) -> Enumeration:
    """All feasible sequences of the shortest feasible length of each objective.

    Length by length; a verdict is shared by all objectives. An objective is open until a
    feasible sequence has been found, and for ``slack`` lengths more. Only sequences that end in
    a state of an open objective are tried, with their prefixes; what begins with an infeasible
    sequence is left out. Both are exact: no feasible sequence of a shortest length is missed.
    """
    space = StateSpace(symbols, start)
    space.explore()
    to_go = {objective: distances(space, objective) for objective in objectives}
    shortest = {objective: 0 for objective in objectives if to_go[objective].get(0) == 0}
    verdicts: dict[Skeleton, CoarseResult] = {}
    for length in range(1, max_length + 1):
        unsatisfied = [objective for objective in objectives if shortest.get(objective) != 0]
        open_ = [o for o in unsatisfied if length <= shortest.get(o, length) + slack]
        nearest = _nearest([to_go[objective] for objective in open_])
        for state in _feasible_ends(space, nearest, bounds, verdicts, (), 0, length):
            for objective in open_:
                if to_go[objective].get(state) == 0:
                    shortest.setdefault(objective, length)
    return Enumeration(
        tuple(verdicts.values()),
        {objective: shortest.get(objective) for objective in objectives},
        {objective: to_go[objective].get(0) for objective in objectives},
    )


def _nearest(distances: Sequence[Mapping[int, int]]) -> dict[int, int]:
    """Least number of actions from each state to the nearest of several objectives."""
    nearest: dict[int, int] = {}
    for distance in distances:
        for state, steps in distance.items():
            if steps < nearest.get(state, steps + 1):
                nearest[state] = steps
    return nearest


def _feasible_ends(
    space: StateSpace,
    nearest: Mapping[int, int],
    bounds: Bounds,
    verdicts: dict[Skeleton, CoarseResult],
    prefix: Skeleton,
    state: int,
    length: int,
) -> Iterator[int]:
    """Last states of the feasible sequences of one length that may end in an open objective."""
    if length == 0:
        yield state
        return
    for action, target in space.transitions(state):
        if nearest.get(target, length) > length - 1:
            continue
        skeleton = (*prefix, action)
        verdict = verdicts.get(skeleton)
        if verdict is None:
            verdict = verdicts[skeleton] = bounds.coarse(skeleton)
        if verdict.feasible:
            yield from _feasible_ends(
                space, nearest, bounds, verdicts, skeleton, target, length - 1
            )
