"""How far other robots and the hand-over get: random sequences, planned and carried out.

Writes ``reports/metrics/reach.json``, after every part, and needs nothing that the pipeline makes:

    python benchmarks/robots.py [PART ...]

With parts named, the figures of the others stay.
"""

import logging
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from itertools import combinations, count
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np

from guided_lgp.bounds.execution import execute
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.documents import read_json, write_json
from guided_lgp.logic import Skeleton, applicable_actions, format_skeleton, successor
from guided_lgp.params import load_params
from guided_lgp.paths import METRICS, SOURCES
from guided_lgp.scene import Box, PlacedRobot, Scene, Table, generate
from guided_lgp.scene.footprints import footprint, gap, inset
from path import goals_after

SEED = 20_000
PER_SCENE = 5
"""Sequences per scene."""
FILE = Path(__file__).parents[1] / METRICS / "reach.json"
NO_PATH, FAILS, HOLDS = "no path", "goals do not hold", "goals hold"
"""What may become of a coarse-feasible sequence: the last one after its execution in physics."""

logger = logging.getLogger("reach")


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
    return draw_of(FAMILIES[robot], robot, index)


def draw_of(family: Family, robot: str, index: int) -> Scene:
    """The scene of a number, of any family."""
    rng = np.random.default_rng([SEED, index])
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


@dataclass(frozen=True)
class Part:
    """Random sequences of a kind."""

    scene: Callable[[int], Scene]
    """By number."""
    wanted: int
    """How many that are coarse-feasible."""
    length: int = 2
    instructions: tuple[str, ...] = ()
    """Of their actions, if not any."""

    def sequences(self) -> Iterator[tuple[SceneBounds, Skeleton]]:
        """The sequences, in their order: the same for everyone."""
        for index in count():
            scene = self.scene(index)
            bounds = SceneBounds(scene, load_params(SOURCES / "params.yaml").bounds)
            rng = np.random.default_rng([SEED, self.length, index])
            for _ in range(PER_SCENE):
                yield bounds, self._drawn(scene, rng)

    def _drawn(self, scene: Scene, rng: np.random.Generator) -> Skeleton:
        state, skeleton = scene.state, ()
        for step in range(self.length):
            wanted = self.instructions[step : step + 1]
            actions = [
                action
                for action in applicable_actions(state, scene.symbols)
                if not wanted or action.instruction in wanted
            ]
            skeleton = (*skeleton, actions[int(rng.integers(len(actions)))])
            state = successor(state, skeleton[-1])
        return skeleton


def handed_over(index: int) -> Scene:
    """A scene of setup a for hand-overs."""
    (scene,) = generate("a", 1, SEED + index, f"handover-{index:03d}").scenes
    return scene.model_copy(update={"domain": "handover"})


PARTS: Mapping[str, Part] = {
    "panda_2": Part(partial(draw, "panda"), 100),
    "panda_4": Part(partial(draw, "panda"), 100, length=4),
    "ur5_2": Part(partial(draw, "ur5"), 50),
    "baxter_2": Part(partial(draw, "baxter"), 25),
    "handover": Part(handed_over, 40, length=3, instructions=("grasp", "take", "place")),
}


def measure(part: Part) -> dict[str, Any]:
    """What becomes of the first coarse-feasible sequences."""
    rows: list[tuple[str, str, str]] = []
    times: list[float] = []
    tried = 0
    for bounds, skeleton in part.sequences():
        if len(rows) == part.wanted:
            break
        tried += 1
        if bounds.coarse(skeleton).feasible:
            began = time.perf_counter()
            rows.append((bounds.scene.name, format_skeleton(skeleton), outcome(bounds, skeleton)))
            times.append(time.perf_counter() - began)
    outcomes = [row[-1] for row in rows]
    return {
        "tried": tried,
        "coarse_feasible": len(rows),
        "verified": len(rows) - outcomes.count(NO_PATH),
        "goals_hold": outcomes.count(HOLDS),
        "path_and_physics_median_s": round(median(times), 2),
        "rows": rows,
    }


def outcome(bounds: SceneBounds, skeleton: Skeleton) -> str:
    """What becomes of a coarse-feasible sequence."""
    result = bounds.path(skeleton)
    if result.trajectory is None:
        logger.info("%s %s: %s", bounds.scene.name, format_skeleton(skeleton), result.failure)
        return NO_PATH
    goals = goals_after(bounds.scene.state, skeleton)
    report = execute(bounds.scene, goals, skeleton, result.trajectory)
    return HOLDS if report.success else FAILS


def main(names: list[str]) -> None:
    """Measure some parts, or all."""
    figures = read_json(FILE, "an earlier run of all parts") if names else {}
    for name in names or PARTS:
        figures[name] = measure(PARTS[name])
        logger.info("%s: %s", name, {k: v for k, v in figures[name].items() if k != "rows"})
        write_json(FILE, figures)


if __name__ == "__main__":
    logging.basicConfig(format="%(message)s", level=logging.INFO)
    main(sys.argv[1:])
