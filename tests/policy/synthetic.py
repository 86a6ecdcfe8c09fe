"""A world without geometry: sequences of the logic, with positions that follow from simple rules.

Boxes start at random places; a held box is at its gripper, a placed one above its support. Some
sequences are declared infeasible at random, with all that begin with them.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa

from guided_lgp.bounds.results import Array
from guided_lgp.logic import (
    Objective,
    Skeleton,
    State,
    applicable_actions,
    format_objective,
    format_skeleton,
    progress,
    satisfied,
    successor,
    two_goal_objectives,
)
from guided_lgp.scene import Box, Scene, Table
from guided_lgp.tables import write_table

TABLES = {"tab1": (0.54, 0.33, 0.60), "tab2": (0.54, -0.33, 0.60)}
GRIPPERS = {"pr2L": (0.3, 0.7, 0.8), "pr2R": (0.3, -0.7, 0.8)}
MAX_LENGTH = 3


def make_scene(name: str, rng: np.random.Generator) -> Scene:
    boxes = []
    for box in ("red", "green", "blue"):
        on = str(rng.choice(list(TABLES)))
        x, y = rng.uniform(-0.1, 0.1, 2) + TABLES[on][:2]
        boxes.append(Box(name=box, size=(0.15, 0.07, 0.1), position=(x, y, 0.65), on=on))
    tables = tuple(
        Table(name=table, position=at, half_extents=(0.17, 0.2)) for table, at in TABLES.items()
    )
    return Scene(name=name, tables=tables, boxes=tuple(boxes))


def positions_along(scene: Scene, skeleton: Skeleton) -> list[dict[str, Array]]:
    """Positions of all symbols at x_0 to x_K."""
    boxes = {box.name: np.array(box.position) for box in scene.boxes}
    fixed = {name: np.array(at) for name, at in (GRIPPERS | TABLES).items()}
    state = scene.state
    frames = []
    for action in (None, *skeleton):
        if action is not None:
            state = successor(state, action)
            _, placed, *support = action.symbols
            if support:
                below = boxes.get(support[0], fixed.get(support[0]))
                above = 0.1 if support[0] in boxes else 0.05
                boxes[placed] = np.add(below, (0, 0, above))
            for box, gripper in state.held:
                boxes[box] = np.add(fixed[gripper], (0.1, 0, 0))
        grippers, tables = ({name: fixed[name] for name in part} for part in (GRIPPERS, TABLES))
        frames.append(grippers | dict(boxes) | tables)
    return frames


def write_frame(path: Path, frame: pd.DataFrame) -> None:
    write_table(path, pa.Table.from_pandas(frame, preserve_index=False))


@dataclass(frozen=True)
class Enumeration:
    scenes: list[Scene]
    sequences: Path
    shortest: Path
    feasible: dict[str, dict[Skeleton, State]]
    """Feasible sequences and the state they lead to, by configuration."""

    def shortest_length(self, scene: Scene, objective: Objective) -> int | None:
        found = self.feasible[scene.name].items()
        return min(
            (len(path) for path, state in found if satisfied(state, objective)), default=None
        )


def enumerate_world(folder: Path, configurations: int, seed: int) -> Enumeration:
    rng = np.random.default_rng(seed)
    scenes = [make_scene(f"train-{index:03}", rng) for index in range(configurations)]
    rows = []
    feasible: dict[str, dict[Skeleton, State]] = {}
    for scene in scenes:
        level: list[Skeleton] = [()]
        feasible[scene.name] = {(): scene.state}
        for _ in range(MAX_LENGTH):
            level = [
                (*path, action)
                for path in level
                for action in applicable_actions(progress(scene.state, path), scene.symbols)
            ]
            verdicts = rng.random(len(level)) > 0.15
            for path, verdict in zip(level, verdicts, strict=True):
                flat = None
                if verdict:
                    frames = positions_along(scene, path)
                    flat = np.concatenate([list(frame.values()) for frame in frames]).ravel()
                    feasible[scene.name][path] = progress(scene.state, path)
                rows.append((scene.name, format_skeleton(path), len(path), bool(verdict), flat))
            level = [path for path, verdict in zip(level, verdicts, strict=True) if verdict]
    names = ["configuration", "skeleton", "length", "feasible", "states"]
    world = Enumeration(scenes, folder / "training.parquet", folder / "shortest.parquet", feasible)
    write_frame(world.sequences, pd.DataFrame(rows, columns=names))
    lengths = [
        (scene.name, format_objective(goals), world.shortest_length(scene, goals))
        for scene in scenes
        for goals in two_goal_objectives(scene.symbols)
    ]
    table = pd.DataFrame(lengths, columns=["configuration", "objective", "length"])
    write_frame(world.shortest, table.astype({"length": "Int64"}))
    return world
