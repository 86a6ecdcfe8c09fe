"""How long plans take, as a share of those of the version that all are measured against.

Of the same actions, drawn at random: all arms may move at once now, which the older version does
not know. And for the same goals: the best of several plans now, which the older one does not
compare. Needs nothing that the pipeline makes: python benchmarks/duration.py [plans per row]
"""

import json
import sys
from collections.abc import Iterator
from statistics import median
from typing import Any

import numpy as np

from against import SCENES, Pair, both

LENGTHS = (4, 6, 8)
SEED = 20_005
"""Of the sequences; no stage of the pipeline uses it."""
HANDS = {"both_arms": 2, "one_arm": 1}
"""How many arms act."""
CANDIDATES = 8
SETUPS = ("a", "b", "c", "d", "e6", "e8", "e10")
"""In which the best of so many plans is looked for."""


def measure(count: int) -> dict[str, Any]:
    """Median and largest ratio over ``count`` sequences of setup a, by how many arms act, and over
    the best plans for as many pairs of goals in all setups.
    """
    with both() as pair:
        rows = {name: _row(list(_ratios(pair, hands, count))) for name, hands in HANDS.items()}
        return rows | {f"candidates_{CANDIDATES}": _row(list(best_ratios(pair, count)))}


def best_ratios(pair: Pair, count: int) -> Iterator[float]:
    """Of the durations of the best plan now and the older version's, where both find one."""
    rng = np.random.default_rng([SEED, CANDIDATES])
    for number in range(count):
        setup, scene = SETUPS[number % len(SETUPS)], number // len(SETUPS) % SCENES
        goals = pair.new.ask("open_goals", setup, scene)
        chosen = goals[rng.integers(len(goals))]
        yield from _ratio(pair.ask("best", setup, scene, chosen, CANDIDATES))


def _row(ratios: list[float]) -> dict[str, Any]:
    return {"plans": len(ratios), "median": median(ratios), "worst": max(ratios)}


def _ratios(pair: Pair, hands: int, count: int) -> Iterator[float]:
    """Of the durations by both versions, where both find a motion."""
    rng = np.random.default_rng([SEED, hands])
    for number in range(count):
        scene = number % SCENES
        words = _drawn(pair, scene, LENGTHS[number % len(LENGTHS)], hands, rng)
        yield from _ratio(pair.ask("duration", "a", scene, words))


def _ratio(found: dict[str, Any]) -> Iterator[float]:
    if found["old"]["feasible"] and found["new"]["feasible"]:
        yield found["new"]["duration_s"] / found["old"]["duration_s"]


def _drawn(pair: Pair, scene: int, length: int, hands: int, rng: np.random.Generator) -> list[str]:
    """A random sequence in which so many arms act, feasible for both versions."""
    words: list[str] = []
    while len(words) < length or len(_acting(words)) < hands:
        words = words if len(words) < length else []
        choices = pair.new.ask("choices", "a", scene, words)
        few = [word for word in choices if len(_acting([*words, word])) <= hands]
        words = [*words, few[rng.integers(len(few))]]
        verdicts = pair.ask("coarse", "a", scene, words)
        words = words if all(verdict["feasible"] for verdict in verdicts.values()) else []
    return words


def _acting(words: list[str]) -> set[str]:
    """The hands of some actions."""
    return {word.split()[1] for word in words}


if __name__ == "__main__":
    print(json.dumps(measure(int(sys.argv[1]) if len(sys.argv) > 1 else 30), indent=1))
