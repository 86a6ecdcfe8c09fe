"""Benchmark of the path bound: share of random sequences with a verified path, time, physics.

Needs nothing that the pipeline makes: python benchmarks/path.py [sequences per length]
"""

import json
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean, median
from typing import Any

import numpy as np

from guided_lgp import parallel
from guided_lgp.bounds.coarse import CoarseBound
from guided_lgp.bounds.execution import execute
from guided_lgp.bounds.path import PathBound
from guided_lgp.bounds.results import CoarseResult
from guided_lgp.logic import Goal, Skeleton, State, applicable_actions, progress, successor
from guided_lgp.params import load_params
from guided_lgp.paths import PARAMS
from guided_lgp.scene import Scene
from guided_lgp.scene.generate import generate

ROOT = Path(__file__).parents[1]
LENGTHS = (2, 4, 6, 8, 10)
SEED = 20_000
"""Of scenes and sequences; no stage of the pipeline uses it."""
CONFIGURATIONS = 10
EXECUTED = 30
"""Sequences per length whose plans are carried out: that takes longer than to find them."""


@dataclass(frozen=True)
class Sample:
    """What became of one random sequence; ``time_s`` of the path bound, verification included."""

    verified: bool
    time_s: float
    goals_hold: bool | None = None
    """None where the plan has not been carried out."""


def measure(count: int = 100) -> dict[str, Any]:
    """Figures per length K over ``count`` random coarse-feasible sequences of setup a.

    Every sequence has one core to itself.
    """
    scenes = generate("a", CONFIGURATIONS, SEED, "bench").scenes
    tasks = [
        Task(length, number, scene, len(range(number, count, CONFIGURATIONS)))
        for length in reversed(LENGTHS)  # the longest first
        for number, scene in enumerate(scenes)
    ]
    settings = load_params(ROOT / PARAMS).parallel
    parts = parallel.run(run_task, tasks, settings, "path bound and physics")
    samples: dict[int, list[Sample]] = {length: [] for length in LENGTHS}
    for task, part in zip(tasks, parts, strict=True):
        samples[task.length].extend(part)
    return {str(length): _figures(samples[length]) for length in LENGTHS}


@dataclass(frozen=True)
class Task:
    """Some random sequences of one length in one scene."""

    length: int
    number: int
    scene: Scene
    count: int


def run_task(task: Task) -> list[Sample]:
    """Plan and carry out the sequences of a task."""
    rng = np.random.default_rng([SEED, task.length, task.number])
    bounds = load_params(ROOT / PARAMS).bounds
    coarse = CoarseBound(task.scene, bounds.coarse_restarts)
    path = PathBound(task.scene, coarse, bounds.path_solutions)
    executed = range(task.number, EXECUTED, CONFIGURATIONS)
    return [
        _sample(task.length, task.scene, coarse, path, rng, number < len(executed))
        for number in range(task.count)
    ]


def _sample(
    length: int,
    scene: Scene,
    coarse: CoarseBound,
    path: PathBound,
    rng: np.random.Generator,
    executed: bool,
) -> Sample:
    start = feasible(length, scene, coarse, rng)
    began = time.perf_counter()
    result = path.solve(start)
    elapsed = time.perf_counter() - began
    if result.trajectory is None:
        print(f"K={length} {scene.name}: {result.failure}", file=sys.stderr)
        return Sample(verified=False, time_s=elapsed)
    if not executed:
        return Sample(verified=True, time_s=elapsed)
    goals = goals_after(scene.state, result.skeleton)
    report = execute(scene, goals, result.skeleton, result.trajectory)
    return Sample(verified=True, time_s=elapsed, goals_hold=report.success)


def _figures(samples: list[Sample]) -> dict[str, Any]:
    verified = [sample for sample in samples if sample.verified]
    held = [sample.goals_hold for sample in verified if sample.goals_hold is not None]
    times = [sample.time_s for sample in samples]
    return {
        "n": len(samples),
        "path_verified_share": len(verified) / len(samples),
        "path_median_s": median(times),
        "path_max_s": max(times),
        "physics_n": len(held),
        "physics_success_share": fmean(held),
    }


def feasible(
    length: int, scene: Scene, coarse: CoarseBound, rng: np.random.Generator
) -> CoarseResult:
    """A random sequence that the coarse bound says is feasible."""
    result: CoarseResult | None = None
    state = scene.state
    while result is None or len(result.skeleton) < length:
        actions = list(applicable_actions(state, scene.symbols))
        action = actions[int(rng.integers(len(actions)))]
        result = coarse.solve((*(result.skeleton if result else ()), action), result)
        state = successor(state, action)
        if not result.feasible:
            result, state = None, scene.state
    return result


def goals_after(state: State, skeleton: Skeleton) -> tuple[Goal, ...]:
    """Everything that should hold after a sequence."""
    state = progress(state, skeleton)
    held = (Goal("held", (box,)) for box, _ in state.held)
    return (*held, *(Goal("on", (box, table)) for box, table in state.support))


if __name__ == "__main__":
    print(json.dumps(measure(int(sys.argv[1]) if len(sys.argv) > 1 else 100), indent=1))
