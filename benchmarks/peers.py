"""Peers on the same problems: the keyframes of KOMO; and VAMP, as it is published.

A problem is a scene with a Panda, three boxes and two tables, and a skeleton of grasps and places.
KOMO runs in an environment of its own, ``.cache/peers``, made by the target ``bench-peers`` of the
Makefile; VAMP downloads sources when it is built, so its figures are quoted:

    python benchmarks/run.py peers
"""

import json
import os
import subprocess
import time
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import limits
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.documents import read_json, write_json
from guided_lgp.logic import Skeleton
from guided_lgp.params import load_params
from guided_lgp.paths import PARAMS, SOURCES
from guided_lgp.scene import Scene
from guided_lgp.scene.bodies import TABLE_THICKNESS, Box, Table
from robots import FAMILIES, PER_SCENE, Part, draw_of

PYTHON = SOURCES / ".cache" / "peers" / "bin" / "python"
PACKAGE = Path(__file__).with_name("peers_package.py")
BOUNDS = load_params(SOURCES / PARAMS).bounds
LENGTHS, SCENES = (2, 4), 40
"""Actions per skeleton, and scenes per family and length, one skeleton each."""
_FAR = tuple(
    Table(name=name, position=(0.68, y, 0.15), half_extents=(0.20, 0.25))
    for name, y in (("tab1", 0.30), ("tab2", -0.30))
)
TABLES = {"near": FAMILIES["panda"].tables, "far": _FAR}
"""Of the scenes of ``robots.py``, within reach; and such that not all that stands on them is."""
TIMES = ("komo_scene", "komo", "ours_scene", "ours", "ours_last_action")
PUBLISHED = (
    {
        "what": "VAMP, RRT-Connect: a problem of MotionBenchMaker with the Panda, median",
        "figure": "35 µs",
        "source": "W. Thomason, Z. Kingston, L. E. Kavraki: Motions in Microseconds via Vectorized "
        "Sampling-Based Planning, ICRA 2024, doi 10.1109/ICRA57147.2024.10611190; figure of "
        "github.com/KavrakiLab/vamp, README of 2026-07-01: one core of a desktop",
    },
    {
        "what": "VAMP-MR: a check of a random configuration of two Pandas, mean",
        "figure": "8.60 µs (FCL: 100.99 µs)",
        "source": "P. Huang, C. Gao, J. Li, vamp-mr.github.io/vamp-mr, Table 1, Panda Two Rod",
    },
)
"""Figures of others, on their machines."""


def measure() -> dict[str, Any]:
    """Figures by family and length, of a check and a path (ms), and those that are published."""
    asked = {
        family: {str(length): rows(problems(tables, length)) for length in LENGTHS}
        for family, tables in TABLES.items()
    }
    near = problems(TABLES["near"], LENGTHS[0])
    return {
        "komo": {
            family: {length: figures(found) for length, found in parts.items()}
            for family, parts in asked.items()
        },
        "unsolved": unsolved(
            [row for parts in asked.values() for p in parts.values() for row in p]
        ),
        "checks_per_s": limits.checks(near[0][0])["per_s"],
        "path_ms_per_action": median(_path_seconds(*problem) for problem in near) * 1e3,
        "published": list(PUBLISHED),
    }


Problem = tuple[Scene, Skeleton]
Row = dict[str, Any]
"""What both say of a problem, and the CPU seconds that it takes them."""


def problems(tables: tuple[Table, ...], length: int, count: int = SCENES) -> list[Problem]:
    """Scenes with a random skeleton of grasps and places."""
    family = replace(FAMILIES["panda"], tables=tables)
    instructions = ("grasp", "place") * (length // 2)
    part = Part(partial(draw_of, family, "panda"), count, length, instructions)
    drawn = islice(part.sequences(), 0, count * PER_SCENE, PER_SCENE)
    return [(bounds.scene, skeleton) for bounds, skeleton in drawn]


def rows(drawn: list[Problem]) -> list[Row]:
    """What both say of the same problems."""
    theirs = keyframes(drawn)
    return [answer | _verdict(*problem) for answer, problem in zip(theirs, drawn, strict=True)]


def figures(found: list[Row]) -> dict[str, Any]:
    """Counts; and medians (ms) of the times of what both solve."""
    both = [row for row in found if row["komo"] and row["ours"]]
    return {
        "n": len(found),
        **{name: sum(row[name] for row in found) for name in ("komo_first_start", "komo", "ours")},
        "only_komo": sum(row["komo"] and not row["ours"] for row in found),
        "only_ours": sum(row["ours"] and not row["komo"] for row in found),
        "komo_errors_max": max(row["komo_errors"] for row in both),
        **{f"{name}_ms": _median_ms(both, f"{name}_s") for name in TIMES},
    }


def unsolved(found: list[Row]) -> dict[str, Any]:
    """How many skeletons either does not solve, and what that takes (ms, medians)."""
    left = {name: [row for row in found if not row[name]] for name in ("komo", "ours")}
    return {
        **{f"{name}_n": len(part) for name, part in left.items()},
        **{f"{name}_ms": _median_ms(part, f"{name}_s") for name, part in left.items()},
    }


def keyframes(drawn: list[Problem]) -> list[Row]:
    """KOMO's answers, by one thread; see ``peers_package.py``."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        write_json(folder / "problems.json", [_document(*problem) for problem in drawn])
        command = [str(PYTHON), str(PACKAGE), name]
        alone = os.environ | {"OMP_NUM_THREADS": "1"}
        subprocess.run(command, check=True, cwd=folder, env=alone)  # it logs where it runs
        found: list[Row] = read_json(folder / "answers.json")
    return found


def _document(scene: Scene, skeleton: Skeleton) -> dict[str, Any]:
    return {
        "joints": scene.robot.start.tolist(),
        "tables": [_slab(table) for table in scene.tables],
        "boxes": [_body(box) for box in scene.boxes],
        # the Panda's one arm, the first symbol, goes without saying
        "skeleton": [[action.instruction, *action.symbols[1:]] for action in skeleton],
    }


def _slab(table: Table) -> dict[str, Any]:
    x, y, z = table.position
    size = [*(2 * half for half in table.half_extents), TABLE_THICKNESS]
    place = [x, y, z - TABLE_THICKNESS / 2]
    return {"name": table.name, "on": "", "size": size, "position": place, "yaw": table.yaw}


def _body(box: Box) -> dict[str, Any]:
    return box.model_dump(include={"name", "on", "size", "position", "yaw"}, mode="json")


def _verdict(scene: Scene, skeleton: Skeleton) -> Row:
    """The coarse bound's, action by action, in a new scene."""
    began = time.process_time()
    bounds = SceneBounds(scene, BOUNDS)
    made = time.process_time()
    bounds.coarse(skeleton[:-1])
    known = time.process_time()
    feasible = bounds.coarse(skeleton).feasible
    ended = time.process_time()
    return {
        "ours": feasible,
        "ours_scene_s": made - began,
        "ours_s": ended - made,
        "ours_last_action_s": ended - known,
    }


def _path_seconds(scene: Scene, skeleton: Skeleton) -> float:
    """CPU seconds per action of the path bound, the keyframes known."""
    bounds = SceneBounds(scene, BOUNDS)
    bounds.coarse(skeleton)
    began = time.process_time()
    bounds.path(skeleton)
    return (time.process_time() - began) / len(skeleton)


def _median_ms(found: list[Row], name: str) -> float | None:
    return median(row[name] for row in found) * 1e3 if found else None


if __name__ == "__main__":
    print(json.dumps(measure(), indent=1))
