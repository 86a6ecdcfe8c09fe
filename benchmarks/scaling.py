"""Benchmark of growth: the enumeration by configurations, boxes and depth, the data set by samples.

Times are those of one processor core. Writes ``reports/metrics/scaling.json`` and the tables of
``docs/scaling.md``:

    python benchmarks/scaling.py
"""

import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import pyarrow.parquet as pq

from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.documents import write_json, written_whole
from guided_lgp.experiments import enumerate_sequences
from guided_lgp.logic import Objective, two_goal_objectives
from guided_lgp.params import load_params
from guided_lgp.paths import DATASET, METRICS, PARAMS, PIPELINE
from guided_lgp.policy.paper.samples import build_dataset
from guided_lgp.report.cells import number
from guided_lgp.report.table import Table
from guided_lgp.scene import Scene, generate
from guided_lgp.search.enumerate import enumerate_sequences as enumerate_scene
from guided_lgp.search.tree import StateSpace

Result = TypeVar("Result")

ROOT = Path(__file__).parents[1]
PAGE = Path("docs/scaling.md")
BEGIN, END = "<!-- written by benchmarks/scaling.py -->", "<!-- end -->"
SEED = 20_003
"""Of the scenes; no stage of the pipeline uses it."""
CONFIGURATIONS, BOXES, DEPTHS = (4, 8, 16), (2, 3, 4, 5), (2, 3, 4)
SCENES_PER_SIZE = 2
DEPTH_BY_BOXES = 3
FAR = 1_000_000
"""Configurations that the page extrapolates to, in proportion to the largest measured."""
PARAMETERS = load_params(ROOT / PARAMS)


def configurations() -> list[dict[str, float]]:
    """The stages enumerate_sequences and build_dataset for more and more configurations."""
    section = PARAMETERS.parallel.model_copy(update={"workers": 1})
    params = PARAMETERS.model_copy(update={"parallel": section})
    rows = []
    for count in CONFIGURATIONS:
        with tempfile.TemporaryDirectory() as folder:
            root = Path(folder)
            for needed in (PIPELINE, Path("src")):
                (root / needed).symlink_to(ROOT / needed)
            training = generate("a", count, SEED, "training")
            training.save(root / "data" / "scenes" / "training.json")
            generate("a", 1, SEED + 1, "test").save(root / "data" / "scenes" / "test.json")
            data = root / "data" / "sequences"
            seconds, _ = _timed(partial(enumerate_sequences.run, params, root))
            written = data / "training.parquet", data / "training_shortest.parquet"
            objectives = two_goal_objectives(training.scenes[0].symbols)
            drawn = objectives[: params.build_dataset.training_objectives]
            build_s, dataset = _timed(partial(build_dataset, training.scenes, *written, drawn, 0))
            dataset.save(root / DATASET)
            samples = root / DATASET / "samples.safetensors"
            rows.append(
                {
                    "configurations": count,
                    "enumeration_s": seconds * count / (count + 1),
                    "verdicts": pq.read_metadata(written[0]).num_rows,
                    "table_bytes": sum(file.stat().st_size for file in written),
                    "memory_bytes": sum(pq.read_table(file).nbytes for file in written),
                    "scene_bytes": (root / "data" / "scenes" / "training.json").stat().st_size,
                    "build_s": build_s,
                    "samples": len(dataset),
                    "dataset_bytes": samples.stat().st_size,
                }
            )
    return rows


def boxes() -> list[dict[str, float]]:
    """All objectives of two goals, to a fixed depth, with more and more boxes."""
    scenes = generate("d", SCENES_PER_SIZE, SEED, "boxes").scenes
    return [
        {"boxes": count} | _enumerated([_with_boxes(s, count) for s in scenes], DEPTH_BY_BOXES)
        for count in BOXES
    ]


def depths() -> list[dict[str, float]]:
    """All objectives of two goals in setup a, to greater and greater depth."""
    scenes = generate("a", SCENES_PER_SIZE, SEED, "depth").scenes
    return [{"depth": depth} | _enumerated(scenes, depth) for depth in DEPTHS]


def _with_boxes(scene: Scene, count: int) -> Scene:
    return scene.model_copy(update={"boxes": scene.boxes[:count]})


def _enumerated(scenes: Sequence[Scene], depth: int) -> dict[str, float]:
    """Means per scene."""
    symbols = scenes[0].symbols
    objectives: Sequence[Objective] = two_goal_objectives(symbols)
    seconds = logic_s = verdicts = 0.0
    for scene in scenes:
        bounds = SceneBounds(scene, PARAMETERS.bounds)
        enumerated = partial(enumerate_scene, scene.state, symbols, objectives)
        elapsed, _ = _timed(partial(enumerated, bounds, 0))
        logic_s += elapsed
        elapsed, found = _timed(partial(enumerated, bounds, depth))
        seconds += elapsed
        verdicts += len(found.verdicts)
    space = StateSpace(symbols, scenes[0].state)
    space.explore()
    count = len(scenes)
    return {
        "objectives": len(objectives),
        "states": len(space),
        "verdicts": verdicts / count,
        "enumeration_s": seconds / count,
        "logic_s": logic_s / count,
    }


def _timed(action: Callable[[], Result]) -> tuple[float, Result]:
    start = time.process_time()
    result = action()
    return time.process_time() - start, result


def extrapolated(largest: Mapping[str, float]) -> dict[str, float]:
    """What :data:`FAR` configurations would take."""
    return {name: value * FAR / largest["configurations"] for name, value in largest.items()}


def tables(figures: Mapping[str, Any]) -> str:
    """The figures in Markdown."""
    far = extrapolated(figures["configurations"][-1])
    shown = (
        _table("configurations", "Configurations of setup a", figures),
        _table("boxes", f"Boxes, to depth {DEPTH_BY_BOXES}: means per configuration", figures),
        _table("depths", "Depth in setup a: means per configuration", figures),
    )
    return "\n".join(
        [
            *(table.markdown() for table in shown),
            f"**{FAR:,} configurations**, in proportion: enumeration "
            f"{far['enumeration_s'] / 3600:,.0f} core hours, "
            f"{far['verdicts'] / 1e6:,.0f} million verdicts; "
            f"scenes {far['scene_bytes'] / 1e9:.1f} GB; tables {far['table_bytes'] / 1e9:.0f} GB "
            f"on disk and {far['memory_bytes'] / 1e9:.0f} GB in memory; "
            f"{far['samples'] / 1e9:.1f}·10⁹ samples in {far['dataset_bytes'] / 1e9:.0f} GB, "
            f"{far['build_s'] / 3600:,.0f} core hours to build.\n",
        ]
    )


_COLUMNS = {
    "configurations": ("configurations", 1.0, 0),
    "boxes": ("boxes", 1.0, 0),
    "depth": ("depth", 1.0, 0),
    "objectives": ("objectives", 1.0, 0),
    "states": ("symbolic states", 1.0, 0),
    "verdicts": ("verdicts", 1.0, 0),
    "enumeration_s": ("enumeration (s)", 1.0, 2),
    "logic_s": ("of it without geometry (s)", 1.0, 3),
    "table_bytes": ("tables (kB)", 1e-3, 0),
    "memory_bytes": ("in memory (kB)", 1e-3, 0),
    "scene_bytes": ("scenes (kB)", 1e-3, 1),
    "build_s": ("data set (s)", 1.0, 2),
    "samples": ("samples", 1.0, 0),
    "dataset_bytes": ("data set (kB)", 1e-3, 1),
}
"""Heading, unit and decimals of each figure."""


def _table(name: str, title: str, figures: Mapping[str, Any]) -> Table:
    rows = figures[name]
    columns = {key: _COLUMNS[key] for key in rows[0]}
    return Table(
        name,
        title,
        tuple(heading for heading, _, _ in columns.values()),
        tuple(
            tuple(number(row[key] * unit, decimals) for key, (_, unit, decimals) in columns.items())
            for row in rows
        ),
    )


def main() -> None:
    figures = {"configurations": configurations(), "boxes": boxes(), "depths": depths()}
    write_json(ROOT / METRICS / "scaling.json", figures)
    before, begin, rest = (ROOT / PAGE).read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    with written_whole(ROOT / PAGE) as unfinished:
        text = f"{before}{begin}\n\n{tables(figures)}\n{end}{after}"
        unfinished.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
