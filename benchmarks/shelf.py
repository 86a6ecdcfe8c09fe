"""The shelf task of ``guided-tamp-benchmark`` with its Panda, judged by that package.

Three demonstrations with one, two and three bodies of the YCB set, each with the ten base poses
that the package has. A problem is a base pose at which the package's own check accepts the start
and the end, and the robot's base is not inside furniture. The default planner plans; the package
judges the plans (``path_is_successful``). Its environment is in ``.cache/shelf``, see the target
``shelf`` of the Makefile. Writes ``reports/metrics/shelf.json`` and the table of ``docs/shelf.md``:

    python benchmarks/shelf.py [NAME ...]
"""

import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from guided_lgp.documents import read_json, write_json, written_whole
from guided_lgp.errors import InputError
from guided_lgp.paths import METRICS, SOURCES
from guided_lgp.planning import PlanningResult, plan
from shelf_scenes import Task, objective_of, samples, scene_of

PYTHON = SOURCES / ".cache" / "shelf" / "bin" / "python"
PACKAGE = Path(__file__).with_name("shelf_package.py")
FILE, PAGE = "shelf.json", Path("docs/shelf.md")
BEGIN, END = "<!-- written by benchmarks/shelf.py -->", "<!-- end -->"
TIMEOUT = 60.0
"""Seconds that a planner has in the package's benchmark."""


def tasks(folder: Path, *names: str) -> list[Task]:
    """The tasks of the package, in order; or those that are named."""
    subprocess.run([str(PYTHON), str(PACKAGE), "tasks", str(folder), *names], check=True)
    found: list[Task] = [read_json(file) for file in folder.glob("shelf_*.json")]
    return sorted(found, key=lambda task: (task["demonstration"], task["base"]))


def answer(task: Task, motion: Path) -> dict[str, Any]:
    """The row of a task; its motion goes to a file."""
    row = {
        "demonstration": task["demonstration"],
        "base": task["base"],
        "bodies": len(task["bodies"]),
        "problem": task["accepted"],
    }
    if not task["accepted"]:
        return row | {"verdict": "start or end in collision", "actions": 0, "seconds": None}
    began = time.perf_counter()
    try:
        scene = scene_of(task)
        goals = objective_of(task, scene)
        result = plan(scene, goals, timeout=TIMEOUT, coordinate=False)  # there is one arm
    except InputError as error:
        return row | {"problem": False, "verdict": str(error), "actions": 0, "seconds": None}
    elapsed = round(time.perf_counter() - began, 2)
    if result.path is not None and result.path.trajectory is not None:
        joints, poses = samples(task, scene, result.path.trajectory)
        np.savez(motion, joints=joints, poses=poses)
    actions = len(result.skeleton or ())
    return row | {"verdict": _verdict(result), "actions": actions, "seconds": elapsed}


def _verdict(result: PlanningResult) -> str:
    if result.solved:
        return "plan"
    return "stopped" if result.reason == "max_seconds" else "no plan"


def judged(name: str, row: dict[str, Any], folder: Path) -> dict[str, Any]:
    """The row of a task, with what the package says of its plan."""
    if row["verdict"] != "plan":
        return row | {"check": ""}
    write_json(folder / "answers.json", {name: f"{name}.npz"})
    subprocess.run([str(PYTHON), str(PACKAGE), "judge", str(folder)], check=True)
    return row | {"check": read_json(folder / "verdicts.json")[name]["says"]}


def summary(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The whole document."""
    demonstrations = sorted({row["demonstration"] for row in rows})
    parts = {
        str(number): figures([row for row in rows if row["demonstration"] == number])
        for number in demonstrations
    }
    return {**figures(rows), "seeds": [0], "demonstrations": parts, "rows": list(rows)}


def figures(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The figures of some tasks; ``median_s`` is that of the plans."""
    planned = [row for row in rows if row["verdict"] == "plan"]
    right = [row for row in planned if row["check"] == "path is successful"]
    seconds = [row["seconds"] for row in planned]
    return {
        "problems": sum(row["problem"] for row in rows),
        "solved": len(right),
        "rejected_by_its_check": len(planned) - len(right),
        "median_s": round(median(seconds), 2) if seconds else None,
    }


def table(document: Mapping[str, Any]) -> str:
    """The figures in Markdown."""
    heads = ["demonstration", "problems", "solved", "rejected by its check", "median s"]
    lines = [heads, ["---"] * len(heads)]
    for name, part in (*document["demonstrations"].items(), ("all", document)):
        keys = ("problems", "solved", "rejected_by_its_check", "median_s")
        lines.append([name, *(str(part[key]) for key in keys)])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def main(*names: str) -> None:
    """Compute the rows of all tasks, or of those that are named; the others stay as they are.

    Each row is written as soon as it is known: after a kill, name the tasks that are left.
    """
    found = {_key(row): row for row in _before()}
    with TemporaryDirectory() as name:
        folder = Path(name)
        for task in tasks(folder, *names):
            row = answer(task, folder / f"{task['name']}.npz")
            found[_key(row)] = judged(task["name"], row, folder)
            print(task["name"], row["verdict"], row["seconds"], flush=True)
            write([found[key] for key in sorted(found)])


def write(rows: Sequence[Mapping[str, Any]]) -> None:
    """The document, and the table of the page."""
    document = summary(rows)
    write_json(SOURCES / METRICS / FILE, document)
    before, begin, rest = (SOURCES / PAGE).read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    with written_whole(SOURCES / PAGE) as unfinished:
        unfinished.write_text(f"{before}{begin}\n\n{table(document)}\n\n{end}{after}", "utf-8")


def _key(row: Mapping[str, Any]) -> tuple[int, int]:
    return row["demonstration"], row["base"]


def _before() -> list[dict[str, Any]]:
    """What an earlier run has written."""
    file = SOURCES / METRICS / FILE
    found: list[dict[str, Any]] = read_json(file)["rows"] if file.is_file() else []
    return found


if __name__ == "__main__":
    main(*sys.argv[1:])
