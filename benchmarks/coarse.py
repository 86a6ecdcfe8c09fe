"""Benchmark of the coarse bound: time per solve, reliability, IPOPT on the same programs.

Needs nothing that the pipeline makes: python benchmarks/coarse.py [sequences per length]
"""

import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import ceil
from pathlib import Path
from statistics import fmean, median
from typing import Any

import numpy as np

from guided_lgp import parallel
from guided_lgp.bounds.coarse import CoarseBound
from guided_lgp.bounds.coarse.formulation import Formulator
from guided_lgp.bounds.coarse.ipopt import Ipopt
from guided_lgp.bounds.coarse.solver import Settings, Solution, default_solver
from guided_lgp.bounds.coarse.starts import Starts
from guided_lgp.bounds.program.arrays import Program
from guided_lgp.bounds.program.geometry import Margins, SceneGeometry
from guided_lgp.bounds.results import Array, CoarseResult
from guided_lgp.logic import Skeleton, applicable_actions, successor
from guided_lgp.params import load_params
from guided_lgp.paths import PARAMS
from guided_lgp.scene import Scene
from guided_lgp.scene.generate import generate

ROOT = Path(__file__).parents[1]
PARAMETERS = load_params(ROOT / PARAMS)
LENGTHS = (2, 4, 6, 8, 10)
SEED = 20_001
"""Of scenes and sequences; no stage of the pipeline uses it."""
CONFIGURATIONS = 20
MANY_TRIES = 40
PROGRAMS_FOR_IPOPT = {2: 30, 4: 30, 6: 20, 8: 15, 10: 12}
"""Programs that IPOPT gets at most, by length: it takes seconds to build and to solve one."""


@dataclass(frozen=True)
class Sequence:
    """A random sequence with what the bound says of it."""

    scene: Scene
    result: CoarseResult
    prefix: CoarseResult | None
    """Of the longest proper prefix that was asked."""
    with_many_tries: bool


def measure(count: int = 100, setup: str = "a") -> dict[str, Any]:
    """Figures per length K over ``count`` random sequences; CPU times in ms on one core."""
    tasks = [Task(length, count, setup) for length in LENGTHS]
    settings = PARAMETERS.parallel
    figures = parallel.run(run_task, tasks, settings, "coarse bound and IPOPT")
    return dict(zip(map(str, LENGTHS), figures, strict=True))


@dataclass(frozen=True)
class Task:
    """``count`` random sequences of one length."""

    length: int
    count: int
    setup: str


def run_task(task: Task) -> dict[str, Any]:
    """Figures of one length."""
    length, count = task.length, task.count
    scenes = generate(task.setup, CONFIGURATIONS, SEED, "bench").scenes
    rng = np.random.default_rng([SEED, length])
    sequences: list[Sequence] = []
    for index, scene in enumerate(scenes):
        usual = CoarseBound(scene, PARAMETERS.bounds.coarse_restarts)
        patient = CoarseBound(scene, MANY_TRIES)
        for _ in range(index, count, len(scenes)):
            sequences.append(_judge(_random(scene, length, rng), scene, usual, patient))
    solved = [sequence for sequence in sequences if sequence.result.feasible]
    times = [_one_start(sequence) for sequence in solved]
    possible = sum(sequence.with_many_tries for sequence in sequences)
    return {
        "n": count,
        "coarse_median_ms": median(times) * 1e3,
        "coarse_verified_median_ms": median(s.result.time_s for s in solved) * 1e3,
        "coarse_first_try": fmean(sequence.result.restarts == 1 for sequence in solved),
        "false_infeasible": 1 - len(solved) / possible,
        "infeasible_share": 1 - len(solved) / count,
        "ipopt": _against_ipopt(solved[:: ceil(len(solved) / PROGRAMS_FOR_IPOPT[length])]),
    }


def _random(scene: Scene, length: int, rng: np.random.Generator) -> Skeleton:
    state, skeleton = scene.state, []
    for _ in range(length):
        actions = list(applicable_actions(state, scene.symbols))
        skeleton.append(actions[rng.integers(len(actions))])
        state = successor(state, skeleton[-1])
    return tuple(skeleton)


def _judge(skeleton: Skeleton, scene: Scene, usual: CoarseBound, patient: CoarseBound) -> Sequence:
    prefix: CoarseResult | None = None
    result = usual.solve(skeleton[:1])
    while result.feasible and len(result.skeleton) < len(skeleton):
        prefix = result
        result = usual.solve(skeleton[: len(prefix.skeleton) + 1], prefix)
    second = result if result.feasible else patient.solve(result.skeleton, prefix)
    while second.feasible and len(second.skeleton) < len(skeleton):
        second = patient.solve(skeleton[: len(second.skeleton) + 1], second)
    return Sequence(scene, result, prefix, second.feasible)


def _one_start(sequence: Sequence) -> float:
    """Seconds from skeleton and prefix to the end of the first start, without verification."""
    geometry = SceneGeometry(sequence.scene)
    solver = default_solver(sequence.scene.robot.description)
    starts = Starts(geometry, solver)
    began = time.process_time()
    formulation = Formulator(geometry, Margins()).build(sequence.result.skeleton)
    warm_start = getattr(sequence.prefix, "values", None)
    start = starts.draw(formulation, _random, 0.0, warm_start)
    solver.solve(formulation.program, start, Settings())
    return time.process_time() - began


def _random() -> np.random.Generator:
    return np.random.default_rng(0)


def _against_ipopt(sequences: list[Sequence]) -> dict[str, Any]:
    """Both solvers on the same programs, from the same starts, that know no prefix.

    Our solver stops at the first feasible point, as the bound needs no more. IPOPT is run twice,
    with the same tolerance and slack: without the cost, to a feasible point, which compares like
    with like; and with it, to a local optimum. The time to build IPOPT's programs is left out.
    """
    solver = default_solver(sequences[0].scene.robot.description)
    programs: list[tuple[Program, Array]] = []
    for sequence in sequences:
        geometry = SceneGeometry(sequence.scene)
        formulation = Formulator(geometry, Margins()).build(sequence.result.skeleton)
        start = Starts(geometry, solver).draw(formulation, _random, noise=0.0)
        programs.append((formulation.program, start))
    # before IPOPT, whose building leaves a memory in which the first solve is slow
    ours = [
        _timed(partial(solver.solve, program, start, Settings())) for program, start in programs
    ]
    feasible, optimal = [], []
    for program, start in programs:
        oracle = Ipopt(sequences[0].scene.robot.description, program, start, Settings())
        feasible.append(_timed(partial(oracle.solve, start, optimal=False)))
        optimal.append(_timed(partial(oracle.solve, start)))
    figures: dict[str, Any] = {
        "n": len(programs),
        "start_feasible": fmean(solution.steps == 0 for _, solution in ours),
    }
    runs = {"solver": ours, "ipopt_feasible": feasible, "ipopt_optimum": optimal}
    for name, results in runs.items():
        figures[f"{name}_median_ms"] = median(seconds for seconds, _ in results) * 1e3
        figures[f"{name}_converged"] = fmean(s.converged(Settings()) for _, s in results)
    for name in ("ipopt_feasible", "ipopt_optimum"):
        ratios = [their / our for (our, _), (their, _) in zip(ours, runs[name], strict=True)]
        figures[f"times_faster_than_{name}"] = median(ratios)
    return figures


def _timed(solve: Callable[[], Solution]) -> tuple[float, Solution]:
    """CPU seconds, and the solution."""
    began = time.process_time()
    solution = solve()
    return time.process_time() - began, solution


if __name__ == "__main__":
    print(json.dumps(measure(*map(int, sys.argv[1:2])), indent=2))
