"""How much sooner plans are done in which all arms move, at equal actions, and what that costs.

Needs nothing that the pipeline makes: python benchmarks/duration.py [sequences per length]
"""

import json
import sys
import time
from collections.abc import Iterable
from dataclasses import dataclass
from statistics import median
from typing import Any

import numpy as np

from guided_lgp.bounds.coarse import CoarseBound
from guided_lgp.bounds.coordination import Coordinator
from guided_lgp.bounds.path import PathBound
from guided_lgp.bounds.results import Trajectory
from guided_lgp.params import load_planning
from guided_lgp.robots import Robot
from guided_lgp.scene.generate import generate
from path import feasible

LENGTHS = (2, 4, 6)
SEED = 20_005
"""Of scenes and sequences; no stage of the pipeline uses it."""


@dataclass(frozen=True)
class Sample:
    """One random sequence, by one arm at a time and by all at once."""

    arms: int
    """How many act."""
    durations: tuple[float, float]
    """s, before and after."""
    waiting: float
    """Share of the time in which no arm moves, after."""
    seconds: tuple[float, float]
    """What the path bound took, and what coordination took."""


def measure(count: int) -> dict[str, Any]:
    """Figures over ``count`` random feasible sequences per length of setup a."""
    samples = [
        sample
        for length in LENGTHS
        for number in range(count)
        if (sample := _sample(length, number)) is not None
    ]
    both, one = ([s for s in samples if (s.arms > 1) == more] for more in (True, False))
    return {
        "plans": len(samples),
        "duration_ratio": {"both_arms": _ratios(both), "one_arm": _ratios(one)},
        "waiting_share": round(float(np.mean([s.waiting for s in samples])), 3),
        "path_median_s": round(median(s.seconds[0] for s in samples), 3),
        "coordination_median_s": round(median(s.seconds[1] for s in samples), 3),
        "coordination_max_s": round(max(s.seconds[1] for s in samples), 3),
    }


def _sample(length: int, number: int) -> Sample | None:
    """A random sequence in a scene of its own; None if it has no path."""
    (scene,) = generate("a", 1, SEED + number, f"duration-{number:03d}").scenes
    bounds = load_planning().bounds
    coarse = CoarseBound(scene, bounds.coarse_restarts)
    start = feasible(length, scene, coarse, np.random.default_rng([SEED, length, number]))
    result = PathBound(scene, coarse, bounds.path_solutions).solve(start)
    if result.trajectory is None:
        return None
    began = time.perf_counter()
    shorter = Coordinator(scene).shorten(result)
    elapsed = time.perf_counter() - began
    assert shorter.trajectory is not None
    return Sample(
        len({action.symbols[0] for action in result.skeleton}),
        (float(result.trajectory.times[-1]), float(shorter.trajectory.times[-1])),
        _waiting(scene.robot.description, shorter.trajectory),
        (result.time_s, elapsed),
    )


def _waiting(robot: Robot, trajectory: Trajectory) -> float:
    still = ~np.any(np.diff(trajectory.joints(robot.joint_names), axis=0), axis=1)
    return float(np.diff(trajectory.times)[still].sum() / trajectory.times[-1])


def _ratios(samples: Iterable[Sample]) -> dict[str, Any]:
    """Median and largest of the durations after over those before."""
    ratios = [after / before for before, after in (sample.durations for sample in samples)]
    if not ratios:
        return {"plans": 0}
    return {
        "plans": len(ratios),
        "median": round(median(ratios), 3),
        "worst": round(max(ratios), 3),
        "as_before": sum(ratio == 1.0 for ratio in ratios),
    }


if __name__ == "__main__":
    print(json.dumps(measure(int(sys.argv[1]) if len(sys.argv) > 1 else 12), indent=1))
