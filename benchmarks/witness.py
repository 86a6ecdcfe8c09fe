"""Benchmark of "infeasible": random sequences that the coarse bound denies, searched by other code.

Placements are drawn anywhere on their supports; the path bound, which samples grips and postures
and knows nothing of the coarse bound's program and solver, looks for the whole verified motion. One
that it finds is a witness against the verdict. Sequences end at the action that is denied:

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
from guided_lgp.bounds.coarse import CoarseBound
from guided_lgp.bounds.path import PathBound
from guided_lgp.bounds.results import Array, CoarseResult, Keyframe
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.logic import Skeleton, applicable_actions, successor
from guided_lgp.params import load_params
from guided_lgp.paths import SOURCES
from guided_lgp.poses import compose, inverse, pose
from guided_lgp.scene import Scene
from guided_lgp.scene.generate import generate
from guided_lgp.scene.world import initial_poses

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
DRAWS = 1
"""Of all placements per sequence."""
INSET = 0.01
"""Distance (m) of a box's centre from the edge of its support."""


def measure(wanted: int = WANTED) -> dict[str, Any]:
    """How many denied sequences were searched, and which of them have a witness."""
    scenes = generate("a", wanted, SEED, "witness").scenes
    tasks = [Task(scene, number) for number, scene in enumerate(scenes)]
    searched: list[tuple[str, bool]] = []
    while tasks and len(searched) < wanted:
        batch, tasks = tasks[:BATCH], tasks[BATCH:]
        for part in parallel.run(run_task, batch, PARAMETERS.parallel, "witnesses against no"):
            searched += part
        logger.info("%d of %d denied sequences searched", len(searched), wanted)
    found = [name for name, witnessed in searched if witnessed]
    return {"n": len(searched), "found": len(found), "witnesses": found}


@dataclass(frozen=True)
class Task:
    """One scene, and its number among all."""

    scene: Scene
    number: int


def run_task(task: Task) -> list[tuple[str, bool]]:
    """Denied sequences of a scene, and whether there is a witness against each."""
    rng = np.random.default_rng([SEED, task.number])
    path = PathBound(task.scene, CoarseBound(task.scene, 1), solutions=1)
    return [
        (
            f"{task.scene.name}: {' '.join(map(str, skeleton))}",
            any(path.solve(_drawn(task.scene, skeleton, rng)).feasible for _ in range(DRAWS)),
        )
        for skeleton in _denied(task.scene, rng)
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


def _drawn(scene: Scene, skeleton: Skeleton, rng: np.random.Generator) -> CoarseResult:
    """The sequence with placements anywhere on their supports, and all arms at their side."""
    state, boxes = scene.state, initial_poses(scene)
    keyframes = []
    for action in skeleton:
        ground = scene.symbols.domain.bind(action)
        if not ground.into_hand:
            placed = _on(scene, boxes, ground.body, ground.parent, rng)
            moved = compose(placed, inverse(boxes[ground.body]))
            riders = state.carried_by(ground.body)
            boxes |= {rider: compose(moved, boxes[rider]) for rider in riders}
            boxes[ground.body] = placed
        keyframes.append(Keyframe(scene.robot.description.home, dict(boxes)))
        state = successor(state, action)
    return CoarseResult(skeleton, feasible=True, at_switch=tuple(keyframes))


def _on(
    scene: Scene, boxes: dict[str, Array], box: str, support: str, rng: np.random.Generator
) -> Array:
    """A level pose (7,) of a box on a support."""
    sizes = {body.name: np.array(body.size) for body in scene.boxes}
    if support in sizes:
        top = compose(boxes[support], pose((0.0, 0.0, sizes[support][2] / 2)))
        half = sizes[support][:2] / 2
    else:
        table = next(table for table in scene.tables if table.name == support)
        top, half = pose(table.position, table.yaw), np.array(table.half_extents)
    x, y = rng.uniform(-1, 1, 2) * (half - INSET)
    return compose(top, pose((x, y, sizes[box][2] / 2), rng.uniform(-np.pi, np.pi)))


if __name__ == "__main__":
    print(json.dumps(measure(*map(int, sys.argv[1:])), indent=1))
