"""Benchmark against the machine's limits: how near a check and a verdict come to them.

A limit is what one core of this processor does at most, measured here too, or what the compiled
code in a verdict takes alone: python benchmarks/limits.py
"""

import json
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from statistics import median
from typing import Any
from unittest.mock import patch

import numpy as np

from guided_lgp.bounds.coarse.solver import Compiled
from guided_lgp.bounds.collision.checker import PlanningScene, checker_of
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.logic import Skeleton, applicable_actions, successor
from guided_lgp.params import load_params
from guided_lgp.paths import SOURCES
from guided_lgp.scene import Scene
from guided_lgp.scene.bullet import pybullet
from guided_lgp.scene.generate import generate
from guided_lgp.scene.world import initial_poses

PARAMETERS = load_params(SOURCES / "params.yaml")
SEED = 20_006
"""Of scenes, configurations and sequences; no stage of the pipeline uses it."""
SCENES, TRIED = 10, 10
"""Actions tried per scene, one after the other."""
CHECKS = 16_384
SIZE = 1_024
"""Rows of the matrices that are multiplied, to see what the processor can do."""
REPEATS = 5
JOINT, BODY, PAIR = 105, 63, 9
"""Operations of a check, if spheres settle every pair: the pose of a joint, that of a body, and two
spheres; see ``certificate.c``."""
NATIVE = (
    *("resetJointStatesMultiDof", "resetBasePositionAndOrientation", "getLinkStates"),
    *("performCollisionDetection", "getContactPoints", "getClosestPoints"),
)
"""What a verification asks of PyBullet."""


def measure() -> dict[str, Any]:
    """Figures of collision checks (per s) and of feasible coarse verdicts (ms); CPU time."""
    scenes = generate("a", SCENES, SEED, "limits").scenes
    return {"checks": checks(scenes[0]), "coarse_feasible": verdicts(scenes)}


def checks(scene: Scene) -> dict[str, float]:
    """Certified checks of random configurations per second, and the most that is possible."""
    checker, robot = checker_of(scene), scene.robot.description
    checker.enter(PlanningScene(robot.grippers[0], initial_poses(scene)))
    rng = np.random.default_rng(SEED)
    low, high = np.clip(robot.position_limits.T, -np.pi, np.pi)
    moving = checker.moving_joints(rng.uniform(low, high, (CHECKS, len(low))), {})
    seconds = _best(lambda: checker.certified(moving))
    joints, bodies, pairs = moving.shape[1], len(checker._names), len(checker._apart)
    operations = JOINT * joints + BODY * bodies + PAIR * pairs
    values = 3 * joints  # with their sines and cosines
    return {
        "per_s": CHECKS / seconds,
        "at_operations_per_s": _operations_per_s() / operations,
        "at_memory_per_s": _bytes_per_s() / (4 * values),
    }


def _operations_per_s() -> float:
    """Of one core, in single precision: a product of matrices."""
    matrix = np.random.default_rng(SEED).random((SIZE, SIZE), dtype=np.float32)
    return float(2 * SIZE**3 / _best(lambda: matrix @ matrix))


def _bytes_per_s() -> float:
    """That one core reads: a sum of more than fits into its caches."""
    values = np.ones(2**26, dtype=np.float32)
    return float(values.nbytes / _best(values.sum))


def _best(run: Callable[[], object]) -> float:
    """CPU seconds of the fastest of a few runs."""
    seconds = []
    for _ in range(REPEATS):
        began = time.process_time()
        run()
        seconds.append(time.process_time() - began)
    return min(seconds)


def verdicts(scenes: tuple[Scene, ...]) -> dict[str, float]:
    """Feasible coarse verdicts of known prefixes: all their time, and that in compiled code."""
    rng, rows = np.random.default_rng(SEED), list[tuple[float, float]]()
    for scene in scenes:
        bounds, state, skeleton = SceneBounds(scene, PARAMETERS.bounds), scene.state, Skeleton()
        bounds.coarse((applicable_actions(state, scene.symbols)[0],))  # all that is made once
        for _ in range(TRIED):
            actions = applicable_actions(state, scene.symbols)
            action = actions[rng.integers(len(actions))]
            with _compiled_seconds() as inside:
                began = time.process_time()
                feasible = bounds.coarse((*skeleton, action)).feasible
                seconds = time.process_time() - began
            if feasible:
                rows.append((seconds, sum(inside)))
                skeleton, state = (*skeleton, action), successor(state, action)
    whole, floor = (median(column) * 1e3 for column in zip(*rows, strict=True))
    return {"n": len(rows), "median_ms": whole, "floor_ms": floor}


@contextmanager
def _compiled_seconds() -> Iterator[list[float]]:
    """CPU seconds of every call of compiled code: solver, inverse kinematics and PyBullet."""
    seconds: list[float] = []

    def timed(call: Callable[..., Any]) -> Callable[..., Any]:
        def run(*arguments: Any, **options: Any) -> Any:
            began = time.process_time()
            try:
                return call(*arguments, **options)
            finally:
                seconds.append(time.process_time() - began)

        return run

    owners = [(Compiled, name) for name in ("solve", "hold", "least_costs")]
    with ExitStack() as patches:
        for owner, name in [*owners, *((pybullet, name) for name in NATIVE)]:
            patches.enter_context(patch.object(owner, name, timed(getattr(owner, name))))
        yield seconds


if __name__ == "__main__":
    print(json.dumps(measure(), indent=1))
