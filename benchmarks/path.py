"""Benchmark of the path bound: share of random sequences with a verified path, time, physics.

Needs nothing that the pipeline makes: python benchmarks/path.py [sequences per length]
"""

import json
import sys
import time
from statistics import median
from typing import Any

import numpy as np

from guided_lgp.logic import Goal, Skeleton, State, applicable_actions, successor
from guided_lgp.nlp.coarse import CoarseBound
from guided_lgp.nlp.path import PathBound
from guided_lgp.nlp.physics import execute
from guided_lgp.nlp.results import CoarseResult
from guided_lgp.scene import Scene
from guided_lgp.scene.generate import generate

LENGTHS = (2, 4, 6, 8, 10)
SEED = 20_000
"""Of scenes and sequences; no stage of the pipeline uses it."""
CONFIGURATIONS = 10
TRIES, SOLUTIONS = 9, 8


def measure(count: int = 100, physics: bool = True) -> dict[str, Any]:
    """Figures per length K over ``count`` random coarse-feasible sequences of setup a."""
    scenes = generate("a", CONFIGURATIONS, SEED, "bench").scenes
    coarse = [CoarseBound(scene, TRIES) for scene in scenes]
    paths = [PathBound(s, c, SOLUTIONS) for s, c in zip(scenes, coarse, strict=True)]
    return {
        str(length): _length(length, count, scenes, coarse, paths, physics) for length in LENGTHS
    }


def _length(
    length: int,
    count: int,
    scenes: tuple[Scene, ...],
    coarse: list[CoarseBound],
    paths: list[PathBound],
    physics: bool,
) -> dict[str, Any]:
    rng = np.random.default_rng([SEED, length])
    verified, successes, times = 0, 0, []
    for number in range(count):
        index = number % len(scenes)
        start = _feasible(length, scenes[index], coarse[index], rng)
        began = time.perf_counter()
        result = paths[index].solve(start)
        times.append(time.perf_counter() - began)
        if result.trajectory is None:
            print(f"K={length} {scenes[index].name}: {result.failure}", file=sys.stderr)
            continue
        verified += 1
        if physics:
            goals = _goals(scenes[index].state, result.skeleton)
            report = execute(scenes[index], goals, result.skeleton, result.trajectory)
            successes += report.success
    figures = {
        "n": count,
        "path_verified_share": verified / count,
        "path_median_s": median(times),
        "path_max_s": max(times),
    }
    return figures | ({"physics_success_share": successes / verified} if physics else {})


def _feasible(
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


def _goals(state: State, skeleton: Skeleton) -> tuple[Goal, ...]:
    """Everything that should hold after a sequence."""
    for action in skeleton:
        state = successor(state, action)
    held = (Goal("held", box) for box, _ in state.held)
    return (*held, *(Goal("on", box, table) for box, table in state.support))


if __name__ == "__main__":
    print(json.dumps(measure(int(sys.argv[1]) if len(sys.argv) > 1 else 100), indent=1))
