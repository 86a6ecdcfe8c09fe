"""Tables of an enumeration, as if one action were feasible in each scene: a grasp, but of blue."""

from collections.abc import Iterable
from pathlib import Path

import pyarrow as pa

from guided_lgp.logic import Objective, format_objective
from guided_lgp.scene import Scene
from guided_lgp.sequences import SHORTEST, VERDICTS
from guided_lgp.tables import write_table


def write_enumeration(
    folder: Path, scenes: Iterable[Scene], objectives: Iterable[Objective]
) -> tuple[Path, Path]:
    """Write both tables; returns that of the verdicts and that of the shortest sequences."""
    scenes, objectives = tuple(scenes), tuple(objectives)
    rows = [_verdict(scene, box.name) for scene in scenes for box in scene.boxes]
    shortest = [
        {"configuration": scene.name, "objective": format_objective(goals), "length": 1}
        for scene in scenes
        for goals in objectives
    ]
    files = folder / "verdicts.parquet", folder / "shortest.parquet"
    write_table(files[0], pa.Table.from_pylist(rows, schema=VERDICTS))
    write_table(files[1], pa.Table.from_pylist(shortest, schema=SHORTEST))
    return files


def _verdict(scene: Scene, box: str) -> dict[str, object]:
    return {
        "configuration": scene.name,
        "skeleton": f"(grasp pr2L {box})",
        "length": 1,
        "feasible": box != "blue",
        "failure_constraint": "reach" if box == "blue" else None,
        "states": [0.1 * step for step in range(42)] if box != "blue" else None,
    }
