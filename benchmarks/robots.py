"""Benchmark of other robots: random sequences that are coarse-feasible, planned and carried out.

Needs nothing that the pipeline makes: python benchmarks/robots.py ROBOT [K] [sequences]
"""

import json
import sys
import time
from collections import Counter
from dataclasses import dataclass
from itertools import combinations
from statistics import median
from typing import Any

import numpy as np

from guided_lgp.bounds.execution import execute
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.logic import Skeleton, applicable_actions, successor
from guided_lgp.params import load_params
from guided_lgp.paths import SOURCES
from guided_lgp.scene import Box, PlacedRobot, Scene, Table
from guided_lgp.scene.footprints import footprint, gap, inset
from path import goals_after

SEED = 20_000
PER_SCENE = 5
"""Sequences per scene."""


@dataclass(frozen=True)
class Family:
    """Where boxes stand before a robot: anywhere on two tables, at any yaw."""

    tables: tuple[Table, ...]
    box_size: tuple[float, float, float]
    boxes: tuple[str, ...] = ("red", "green", "blue")
    clearance: float = 0.06
    """Free space (m) that the open fingers need beside a box."""


FAMILIES = {
    "baxter": Family(
        (
            Table(name="tab1", position=(0.68, 0.30, -0.10), half_extents=(0.15, 0.20)),
            Table(name="tab2", position=(0.68, -0.30, -0.10), half_extents=(0.15, 0.20)),
        ),
        (0.12, 0.04, 0.08),
    ),
    "panda": Family(
        (
            Table(name="tab1", position=(0.50, 0.27, 0.15), half_extents=(0.15, 0.20)),
            Table(name="tab2", position=(0.50, -0.27, 0.15), half_extents=(0.15, 0.20)),
        ),
        (0.12, 0.06, 0.08),
    ),
    "ur5": Family(
        (
            Table(name="tab1", position=(0.50, 0.27, 0.15), half_extents=(0.15, 0.20)),
            Table(name="tab2", position=(0.50, -0.27, 0.15), half_extents=(0.15, 0.20)),
        ),
        (0.12, 0.05, 0.08),
    ),
}


def draw(robot: str, index: int) -> Scene:
    """The scene of a number: the same for everyone."""
    family, rng = FAMILIES[robot], np.random.default_rng([SEED, index])
    while True:
        boxes = tuple(_box(family, name, rng) for name in family.boxes)
        prints = [footprint(box) for box in boxes]
        apart = all(gap(a, b) >= family.clearance for a, b in combinations(prints, 2))
        tables = {table.name: footprint(table) for table in family.tables}
        if apart and all(np.min(inset(tables[b.on], footprint(b))) >= 0 for b in boxes):
            return Scene(
                name=f"{robot}-{index:03d}",
                robot=PlacedRobot(model=robot),
                tables=family.tables,
                boxes=boxes,
            )


def _box(family: Family, name: str, rng: np.random.Generator) -> Box:
    table = family.tables[int(rng.integers(len(family.tables)))]
    x, y = np.array(table.position[:2]) + rng.uniform(-1, 1, 2) * table.half_extents
    position = (float(x), float(y), table.position[2] + family.box_size[2] / 2)
    yaw = float(rng.uniform(-np.pi / 2, np.pi / 2))
    return Box(name=name, size=family.box_size, position=position, yaw=yaw, on=table.name)


def measure(robot: str, length: int, count: int) -> dict[str, Any]:
    """What becomes of random sequences of one length."""
    outcomes: Counter[str] = Counter()
    times: list[float] = []
    for index in range(-(-count // PER_SCENE)):
        scene = draw(robot, index)
        bounds = SceneBounds(scene, load_params(SOURCES / "params.yaml").bounds)
        rng = np.random.default_rng([SEED, length, index])
        for _ in range(min(PER_SCENE, count - index * PER_SCENE)):
            skeleton = _random(scene, length, rng)
            began = time.perf_counter()
            outcome = _outcome(scene, bounds, skeleton)
            times.append(time.perf_counter() - began)
            outcomes.update(outcome)
    feasible, verified = outcomes["feasible"], outcomes["verified"]
    return {
        "robot": robot,
        "length": length,
        "n": count,
        "coarse_feasible_share": feasible / count,
        "path_verified_share": verified / max(feasible, 1),
        "physics_success_share": outcomes["executed"] / max(verified, 1),
        "median_s": median(times),
    }


def _outcome(scene: Scene, bounds: SceneBounds, skeleton: Skeleton) -> list[str]:
    coarse = bounds.coarse(skeleton)
    if not coarse.feasible:
        return []
    result = bounds.path(skeleton)
    if result.trajectory is None:
        print(f"{scene.name} {' '.join(map(str, skeleton))}: {result.failure}", file=sys.stderr)
        return ["feasible"]
    goals = goals_after(scene.state, skeleton)
    report = execute(scene, goals, skeleton, result.trajectory)
    if not report.success:
        print(f"{scene.name} {' '.join(map(str, skeleton))}: {report}", file=sys.stderr)
    return ["feasible", "verified", *(["executed"] if report.success else [])]


def _random(scene: Scene, length: int, rng: np.random.Generator) -> Skeleton:
    state, skeleton = scene.state, ()
    for _ in range(length):
        actions = list(applicable_actions(state, scene.symbols))
        skeleton = (*skeleton, actions[int(rng.integers(len(actions)))])
        state = successor(state, skeleton[-1])
    return skeleton


if __name__ == "__main__":
    name, lengths = sys.argv[1], [int(sys.argv[2])] if len(sys.argv) > 2 else [2, 4]
    number = int(sys.argv[3]) if len(sys.argv) > 3 else 100
    print(json.dumps([measure(name, length, number) for length in lengths], indent=1))
