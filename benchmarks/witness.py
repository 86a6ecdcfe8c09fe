"""Benchmark of "infeasible": random sequences that the coarse bound denies, searched by other code.

Keyframes are sampled and verified by ``witness_search.py``, which knows nothing of the coarse
bound's program, starts and solver; those that it finds are a witness against the verdict. Sequences
end at the action that is denied. How strong the search is, the same sequences without that action
tell, which are feasible:

    python benchmarks/witness.py [sequences]
"""

import json
import logging
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from guided_lgp import parallel
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.logic import Skeleton, applicable_actions, successor
from guided_lgp.params import load_params
from guided_lgp.paths import SOURCES
from guided_lgp.scene import Scene
from guided_lgp.scene.generate import generate
from witness_search import Search

logger = logging.getLogger("benchmarks")
PARAMETERS = load_params(SOURCES / "params.yaml")
SEED = 20_005
"""Of scenes, sequences and placements; no stage of the pipeline uses it."""
WANTED, PER_SCENE = 600, 10
"""How many denied sequences at least, and of each scene at most."""
WALKS = 300
"""Sequences drawn in a scene: in some, hardly any is denied."""
BATCH = 12
"""Scenes that are searched before it is asked whether these were enough."""
LONGEST = 3


def measure(wanted: int = WANTED) -> dict[str, Any]:
    """How many denied sequences were searched, and which of them have a witness."""
    scenes = generate("a", wanted, SEED, "witness").scenes
    tasks = [Task(scene, number) for number, scene in enumerate(scenes)]
    searched: list[Searched] = []
    while tasks and len(searched) < wanted:
        batch, tasks = tasks[:BATCH], tasks[BATCH:]
        for part in parallel.run(run_task, batch, PARAMETERS.parallel, "witnesses against no"):
            searched += part
        logger.info("%d of %d denied sequences searched", len(searched), wanted)
    found = [one.name for one in searched if one.witnessed]
    known = [one.prefix_found for one in searched if one.prefix_found is not None]
    return {
        "n": len(searched),
        "found": len(found),
        "witnesses": found,
        "feasible": len(known),
        "feasible_found": sum(known),
    }


@dataclass(frozen=True)
class Searched:
    """A denied sequence."""

    name: str
    witnessed: bool
    prefix_found: bool | None
    """Whether the search finds what comes before the denied action; None: nothing does."""


@dataclass(frozen=True)
class Task:
    """One scene, and its number among all."""

    scene: Scene
    number: int


def run_task(task: Task) -> list[Searched]:
    """Denied sequences of a scene, and whether there is a witness against each."""
    rng = np.random.default_rng([SEED, task.number])
    search = Search(task.scene, rng)
    return [
        Searched(
            f"{task.scene.name}: {' '.join(map(str, skeleton))}",
            search.finds(skeleton),
            search.finds(skeleton[:-1]) if len(skeleton) > 1 else None,
        )
        for skeleton in list(_denied(task.scene, rng))
    ]


def _denied(scene: Scene, rng: np.random.Generator) -> Iterator[Skeleton]:
    """Different random sequences whose last action is denied, and no earlier one."""
    bounds, seen = SceneBounds(scene, PARAMETERS.bounds), set()
    for _ in range(WALKS):
        state, skeleton = scene.state, Skeleton()
        while len(skeleton) < LONGEST:
            actions = list(applicable_actions(state, scene.symbols))
            skeleton = (*skeleton, actions[rng.integers(len(actions))])
            state = successor(state, skeleton[-1])
            if not bounds.coarse(skeleton).feasible:
                if skeleton not in seen:
                    seen.add(skeleton)
                    yield skeleton
                break
        if len(seen) == PER_SCENE:
            return


if __name__ == "__main__":
    print(json.dumps(measure(*map(int, sys.argv[1:])), indent=1))
