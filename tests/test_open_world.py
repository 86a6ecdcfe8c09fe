"""The suite of the open world: its figures are those of its rows, and rows come out again."""

import sys
from pathlib import Path
from typing import Any

import pytest

from guided_lgp.documents import read_json
from guided_lgp.paths import METRICS

ROOT = Path(__file__).parents[1]
FILE = ROOT / METRICS / "open_world.json"

sys.path.append(str(ROOT / "benchmarks"))

import open_world  # noqa: E402
import open_world_scenes  # noqa: E402
import stacks  # noqa: E402


def document() -> dict[str, Any]:
    found: dict[str, Any] = read_json(FILE)
    return found


def test_the_figures_are_those_of_the_rows() -> None:
    written = document()
    assert open_world.summary(written["rows"]) == written
    assert open_world.table(written) in (ROOT / open_world.PAGE).read_text(encoding="utf-8")
    every = written["all"]
    assert every["rejected_by_checker"] == 0
    assert every["solved"] + every["undecided"] <= every["scenes"]


@pytest.mark.parametrize("kind", open_world_scenes.KINDS)
def test_scenes_are_drawn_again_as_they_were(kind: str) -> None:
    for number in (0, 1):
        one, other = open_world_scenes.cases(kind, number), open_world_scenes.cases(kind, number)
        assert one.scene == other.scene
        assert one.goals == other.goals
        assert bool(one.fault) == (number == 0)


@pytest.mark.parametrize("kind", open_world_scenes.KINDS)
def test_a_row_of_every_kind_comes_out_again(kind: str) -> None:
    rows = {row["number"]: row for row in document()["rows"] if row["kind"] == kind}
    assert open_world.run_task(open_world.Task(kind, 1))[0] == rows[1]


def test_stacks_at_the_start() -> None:
    """All 49 problems are solved, and the shortest of each start comes out again."""
    written = read_json(ROOT / METRICS / stacks.FILE)
    rows, tasks = written["rows"], list(stacks.tasks())
    assert stacks.summary(rows) == written
    assert [(row["start"], tuple(row["goals"])) for row in rows] == [
        (task.start, task.goals) for task in tasks
    ]
    page = (ROOT / open_world.PAGE).read_text(encoding="utf-8")
    assert open_world.markdown("start", written["starts"]) in page
    assert all(row["solved"] and not row["rejected"] for row in rows)
    for start in stacks.STARTS:
        task, row = min(
            ((task, row) for task, row in zip(tasks, rows, strict=True) if task.start == start),
            key=lambda pair: pair[1]["actions"],
        )
        assert stacks.run_task(task) == row
