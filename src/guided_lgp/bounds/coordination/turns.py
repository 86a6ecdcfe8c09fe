"""By which of their full turns joints come to each stop.

A joint that can turn about itself more than once need not unwind before the end: where another
joint has the longer way, it does so at no cost in time.
"""

from collections.abc import Collection, Sequence
from itertools import pairwise, product

import numpy as np

from guided_lgp.bounds.coordination.itinerary import Stop
from guided_lgp.bounds.results import Array
from guided_lgp.robots import Arm, PlacedArm

_TURN = 2 * np.pi
_IDLE = 0.01
"""What a joint's own time costs that is not the slowest: of ways equally long the shortest."""


def best_turns(arm: PlacedArm, stops: Sequence[Stop], kept: Collection[int]) -> list[Array]:
    """Full turns (n,) by which to wind the joints at every stop so that the arm is soonest done.

    At the start, and where the arm stays in the end, it is as the path bound had it. This is
    Viterbi's recursion over the stops, with the time that the slowest joint needs at least.

    Args:
        arm: whose joints they are.
        stops: of the arm.
        kept: numbers of the ways on which joints keep their turns.
    """
    options = [np.zeros((1, len(stops[0].q)))]
    costs, chosen = np.zeros(1), []
    for number, (before, stop) in enumerate(pairwise(stops)):
        left = before.q if stop.way_out is None else stop.way_out[-1]
        path = stop.q[None] if stop.way_in is None else stop.way_in
        known = options[-1][:, None]
        options.append(options[0] if stop is stops[-1] else _within(arm, path))
        times = stop.slower * _least_times(arm.arm, path[0] + options[-1] - left - known)
        if number in kept:
            times[np.any(options[-1] != known, axis=-1)] = np.inf
        totals = costs[:, None] + times
        chosen.append(totals.argmin(axis=0))
        costs = totals.min(axis=0)
    last = 0
    turns = [options[-1][last]]
    for choices, found in zip(reversed(chosen), reversed(options[:-1]), strict=True):
        last = int(choices[last])
        turns.insert(0, found[last])
    return turns


def _within(arm: PlacedArm, path: Array) -> Array:
    """The full turns (m, n) of joints that leave a path (k, n) within their limits."""
    limits, lowest, highest = arm.arm.limits, path.min(axis=0), path.max(axis=0)
    each = [
        [
            turn
            for turn in ((0.0, -_TURN, _TURN) if joint in arm.turning else (0.0,))
            if turn == 0.0
            or limits[joint, 0] <= lowest[joint] + turn <= highest[joint] + turn <= limits[joint, 1]
        ]
        for joint in range(len(limits))
    ]
    return np.array(list(product(*each)))


def _least_times(arm: Arm, moves: Array) -> Array:
    """Time (...) that joints need for moves (..., n) from rest to rest, at least."""
    ways, top, gain = np.abs(moves), arm.velocity_limits, arm.acceleration_limits
    times = np.where(ways > top**2 / gain, ways / top + top / gain, 2 * np.sqrt(ways / gain))
    return np.asarray(times.max(axis=-1) + _IDLE * times.sum(axis=-1))
