"""Benchmark of stacks at the start: three boxes, with every tower of two and of three as a goal.

The default planner, within the limits that users have; the plan checker of the tests judges every
plan. Writes ``reports/metrics/stacks.json`` and the table of ``docs/open_world.md``:

    python benchmarks/stacks.py
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, permutations
from typing import Any

from guided_lgp import parallel
from guided_lgp.documents import write_json
from guided_lgp.logic import parse_objective, satisfied
from guided_lgp.params import load_params
from guided_lgp.paths import METRICS, SOURCES
from guided_lgp.planning import plan
from guided_lgp.scene import Scene, parse_scene
from open_world import faults_of, markdown, write_table

FILE = "stacks.json"
BEGIN = "<!-- written by benchmarks/stacks.py -->"
SIZE = (0.15, 0.07, 0.1)
STARTS = {
    "tower of two, the third beside it": {"a": "left", "b": "a", "c": "left"},
    "tower of two, the third on the other table": {"a": "left", "b": "a", "c": "right"},
    "tower of three": {"a": "left", "b": "a", "c": "b"},
}
"""What each box stands on."""
PLACES = {"a": (0.5, 0.25), "left": (0.58, 0.43), "right": (0.54, -0.33)}
"""x and y (m) of the tower, and of the third box."""


@dataclass(frozen=True)
class Task:
    """One objective from one start."""

    start: str
    goals: tuple[str, ...]


def scene(start: str) -> Scene:
    """Two tables and three boxes."""
    tables = [
        {"name": name, "position": [0.54, y, 0.6], "half_extents": [0.17, 0.2]}
        for name, y in (("left", 0.33), ("right", -0.33))
    ]
    boxes: list[dict[str, Any]] = []
    for name, on in STARTS[start].items():
        x, y = PLACES[on if name == "c" and on in PLACES else "a"]
        level = 0.6 if on in ("left", "right") else boxes[-1]["position"][2] + SIZE[2] / 2
        position = [x, y, level + SIZE[2] / 2]
        boxes.append({"name": name, "size": list(SIZE), "position": position, "on": on})
    return parse_scene({"name": start, "tables": tables, "boxes": boxes}, start)


def tasks() -> Iterator[Task]:
    """Every objective that does not hold at the start: pairs, towers, towers on the other table."""
    pairs = [(f"(on {upper} {lower})",) for upper, lower in permutations("abc", 2)]
    orders = list(permutations("abc"))
    towers = [tuple(f"(on {upper} {lower})" for upper, lower in pairwise(o)) for o in orders]
    moved = [
        (*tower, f"(on {order[-1]} right)") for tower, order in zip(towers, orders, strict=True)
    ]
    for start in STARTS:
        state = scene(start).state
        for goals in (*pairs, *towers, *moved):
            if not satisfied(state, parse_objective(goals)):
                yield Task(start, goals)


def run_task(task: Task) -> dict[str, Any]:
    """What the default planner finds, and what it takes."""
    result = plan(scene(task.start), task.goals)
    return {
        "start": task.start,
        "goals": list(task.goals),
        "solved": result.solved,
        "rejected": bool(faults_of(result)),
        "actions": len(result.skeleton or ()),
        "coarse_calls": result.coarse_calls,
    }


def summary(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The whole document."""
    starts = {
        start: {
            "problems": sum(row["start"] == start for row in rows),
            "solved": sum(row["solved"] for row in rows if row["start"] == start),
            "rejected_by_checker": sum(row["rejected"] for row in rows if row["start"] == start),
        }
        for start in STARTS
    }
    return {"starts": starts, "rows": list(rows)}


def main() -> None:
    """Plan every problem."""
    settings = load_params(SOURCES / "params.yaml").parallel
    document = summary(parallel.run(run_task, list(tasks()), settings, "stacks at the start"))
    write_json(SOURCES / METRICS / FILE, document)
    write_table(BEGIN, markdown("start", document["starts"]))


if __name__ == "__main__":
    main()
