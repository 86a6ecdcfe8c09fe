"""The benchmark beside peers: its figures, what stays of an earlier run, and KOMO on a problem."""

import sys
from pathlib import Path

import pytest

from guided_lgp.documents import write_json

sys.path.append(str(Path(__file__).parents[1] / "benchmarks"))

import peers
import run


def row(komo: bool, ours: bool, seconds: float) -> peers.Row:
    times = {f"{name}_s": seconds for name in peers.TIMES}
    verdicts = {"komo": komo, "ours": ours, "komo_first_start": False, "komo_errors": seconds}
    return verdicts | times


def test_times_are_of_what_both_solve() -> None:
    rows = [
        row(True, True, 0.1),
        row(True, True, 0.3),
        row(True, False, 5.0),
        row(False, True, 7.0),
    ]
    found = peers.figures(rows)
    assert (found["n"], found["komo"], found["ours"], found["komo_first_start"]) == (4, 3, 3, 0)
    assert (found["only_komo"], found["only_ours"]) == (1, 1)
    assert found["komo_errors_max"] == 0.3
    assert all(found[f"{name}_ms"] == pytest.approx(200) for name in peers.TIMES)
    assert peers.unsolved(rows) == {"komo_n": 1, "ours_n": 1, "komo_ms": 7e3, "ours_ms": 5e3}
    assert peers.unsolved(rows[:2])["ours_ms"] is None


def test_figures_of_peers_stay_when_all_else_is_measured(tmp_path: Path) -> None:
    target = tmp_path / "benchmark.json"
    assert run.kept(target, []) == {}
    before = {"peers": {"n": 1}, "limits": {}, "measured_on": {"peers": "A CPU", "limits": "B"}}
    write_json(target, before)
    assert run.kept(target, ["limits"]) == before
    assert run.kept(target, []) == {"peers": {"n": 1}, "measured_on": {"peers": "A CPU"}}
    write_json(target, {"limits": {}, "measured_on": {}})
    assert run.kept(target, []) == {"measured_on": {}}


@pytest.mark.skipif(not peers.PYTHON.exists(), reason="make bench-peers installs the package")
def test_both_solve_a_near_problem_and_neither_one_out_of_reach() -> None:
    (scene, skeleton), *_ = peers.problems(peers.TABLES["near"], 2, count=1)
    tables = tuple(
        table.model_copy(update={"position": (1.5, *table.position[1:])}) for table in scene.tables
    )
    boxes = tuple(
        box.model_copy(update={"position": (box.position[0] + 1.0, *box.position[1:])})
        for box in scene.boxes
    )
    far = scene.model_copy(update={"tables": tables, "boxes": boxes})
    near, none = peers.rows([(scene, skeleton), (far, skeleton)])
    assert near["komo"]
    assert near["ours"]
    assert not none["komo"]
    assert not none["ours"]
