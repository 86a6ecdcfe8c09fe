"""What a family declares, and how its problems are drawn."""

import zlib
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict

from guided_lgp.errors import InputError
from guided_lgp.logic import Objective
from guided_lgp.scene.model import Scene

MAX_DRAWS = 10_000
"""Draws after which a family gives up: the least likely one that is in use needs some hundred."""


class Layout(BaseModel):
    """The numbers of a family: sizes and distances (m), shares."""

    model_config = ConfigDict(extra="forbid", frozen=True)


@dataclass(frozen=True)
class Drawn:
    """A problem: a scene, and what is wanted there."""

    scene: Scene
    objective: Objective


Rule = Callable[[Any, Drawn], bool]
"""Whether a problem is accepted; the first argument is the layout."""


@dataclass(frozen=True)
class Family:
    """Random problems of any size."""

    name: str
    summary: str
    """What is difficult about it, in one line."""
    layout: type[Layout]
    """Its numbers, with the usual ones as defaults."""
    draw: Callable[[Any, int, str, np.random.Generator], Drawn]
    """From layout, number of boxes, name of the scene, and random numbers."""
    rules: Mapping[str, Rule]
    """What is asked of a draw, by what it says; in the order in which they are asked."""
    training_objectives: Callable[[Scene, np.random.Generator], list[Objective]]
    """What is wanted in a scene of the training set."""


def draw_problems(
    family: Family, layout: Layout, size: int, count: int, seed: int, prefix: str
) -> list[Drawn]:
    """Draw problems until so many are accepted.

    Each has a random stream of its own, so that asking for more leaves the earlier ones as they
    were.

    Args:
        family: whose.
        layout: the family's numbers.
        size: number of boxes.
        count: how many.
        seed: of the random streams.
        prefix: of the scenes' names, ``prefix-000`` onwards.

    Raises:
        InputError: nothing acceptable in :data:`MAX_DRAWS` draws; the message has the rule that
            rejected most of them.
    """
    entropy = (seed, size, zlib.crc32(prefix.encode()))
    streams = np.random.SeedSequence(entropy).spawn(count)
    return [
        _accepted(family, layout, size, f"{prefix}-{index:03d}", np.random.default_rng(stream))
        for index, stream in enumerate(streams)
    ]


def _accepted(
    family: Family, layout: Layout, size: int, name: str, rng: np.random.Generator
) -> Drawn:
    rejected: Counter[str] = Counter()
    for _ in range(MAX_DRAWS):
        drawn = family.draw(layout, size, name, rng)
        broken = next((text for text, rule in family.rules.items() if not rule(layout, drawn)), "")
        if not broken:
            return drawn
        rejected[broken] += 1
    rule, times = rejected.most_common(1)[0]
    fault = f"no acceptable scene of {size} boxes in {MAX_DRAWS} draws"
    raise InputError(f"family {family.name}", fault, f"{rule}: rejected {times} of them")
