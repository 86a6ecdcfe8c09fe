"""Cases: refused before anything is computed, no scene twice, labels that are true, figures."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from typer.testing import CliRunner

from guided_lgp import sources
from guided_lgp.cases import collect, demonstrate, evaluate, train
from guided_lgp.cases.declared import declared_case
from guided_lgp.cases.outcomes import read_outcomes
from guided_lgp.cases.policies import FULL, SHUFFLED, SIGHTS, models_of
from guided_lgp.cases.shards import run_kept
from guided_lgp.cli import app
from guided_lgp.documents import read_json, read_yaml, write_text
from guided_lgp.domains import load_domain
from guided_lgp.errors import InputError
from guided_lgp.logic import applicable_actions
from guided_lgp.params import Parallel, Params, load_params
from guided_lgp.paths import CASES
from guided_lgp.policy.relational.inference import load_relational
from guided_lgp.policy.relational.samples import Examples
from guided_lgp.policy.tensors import write_tensors
from guided_lgp.report.case_page import came_out
from guided_lgp.report.pages import ABOUT_CASES

ROOT = Path(__file__).parents[1]
PARAMS = load_params(ROOT / "params.yaml")
SHOWN = PARAMS.cases["rows"].demonstrations


def changed(case: str = "rows", **update: Any) -> Params:
    cases = dict(PARAMS.cases)
    cases[case] = cases[case].model_copy(update=update)
    return PARAMS.model_copy(update={"cases": cases})


@pytest.mark.parametrize(
    ("update", "fault"),
    [
        ({"domain": "chess"}, r"cases\.rows\.domain: unknown domain 'chess' .*pick_and_place"),
        ({"robot": "nao"}, r"'nao' .*pr2"),
        ({"family": "heaps"}, r"cases\.rows\.family: unknown family 'heaps' .*rows"),
        (
            {"demonstrations": SHOWN.model_copy(update={"family": "heaps"})},
            r"cases\.rows\.demonstrations\.family: unknown family 'heaps' .*rows",
        ),
        ({"layout": {"gap": 3}}, r"cases\.rows\.layout: gap"),
        ({"layout": {"slope": 3}}, r"cases\.rows\.layout: slope"),
        ({"controls": ("blindfold",)}, r"cases\.rows\.controls: unknown 'blindfold' .*shuffled"),
    ],
)
def test_a_case_that_names_what_there_is_not_is_refused(update: dict[str, Any], fault: str) -> None:
    with pytest.raises(InputError, match=fault):
        declared_case(changed(**update), "rows")


@pytest.mark.parametrize("file", ["params.yaml", "tests/params.yaml"])
def test_there_is_a_stage_for_every_case_and_training(file: str) -> None:
    """With all parameters that it names: those that are not there, DVC does not take."""
    stages = read_yaml(ROOT / CASES)["stages"]
    cases = read_yaml(ROOT / file)["cases"]
    for stage in stages.values():
        matrix = stage.get("matrix", {"case": stage.get("foreach", list(cases))})
        assert matrix["case"] == list(cases)
        for case in cases.values():
            assert matrix.get("seed", case["seeds"]) == case["seeds"]
            assert matrix.get("training", ["rivals", *case["seeds"]])[1:] == case["seeds"]
            (listed,) = stage.get("do", stage)["params"]
            sections = [text.partition("}.")[2] for text in listed["params.yaml"]]
            assert {*sections} - {""} <= case.keys()


def test_an_unknown_case_is_refused() -> None:
    with pytest.raises(InputError, match=r"unknown case 'column' .*rows, rows_decoys"):
        declared_case(PARAMS, "column")


@pytest.mark.parametrize("name", PARAMS.cases)
def test_no_problem_of_a_test_set_is_in_a_training_set(name: str) -> None:
    """Neither a scene nor a row of it: sizes, seeds and positions all differ."""
    case = declared_case(PARAMS, name)
    trained, tested = case.params.demonstrations, case.params.evaluation
    assert trained.size not in tested.sizes
    assert trained.seed != tested.seed

    def places(scene: Any) -> set[tuple[float, ...]]:
        return {(*box.position, *box.size) for box in scene.boxes}

    known = set().union(*(places(scene) for scene, _ in case.training()))
    for size in tested.sizes:
        problems = case.problems(size)
        assert len(problems) == tested.scenes
        assert len({drawn.scene.name for drawn in problems}) == tested.scenes
        assert known.isdisjoint(set().union(*(places(drawn.scene) for drawn in problems)))


@pytest.fixture(scope="module")
def rows() -> list[dict[str, Any]]:
    """The labelled states of one scene with one goal."""
    case = declared_case(PARAMS, "rows")
    task = next(demonstrate._tasks(case, PARAMS))
    return demonstrate.demonstrate(replace(task, objectives=task.objectives[:1]))


def test_labels_are_disjoint_and_applicable(rows: list[dict[str, Any]]) -> None:
    case = declared_case(PARAMS, "rows")
    scene, _ = next(case.training())
    start = {
        tuple(demonstrate._place(scene, action))
        for action in applicable_actions(scene.state, scene.symbols)
    }
    assert rows
    for row in rows:
        right, wrong = (set(map(tuple, row[name])) for name in ("right", "wrong"))
        assert right
        assert not right & wrong
    assert {tuple(place) for name in ("right", "wrong") for place in rows[0][name]} <= start


def test_a_policy_of_each_kind_is_trained(rows: list[dict[str, Any]], tmp_path: Path) -> None:
    labelled = [row | {"configuration": i % 3} for i, row in enumerate(rows * 3)]
    file = tmp_path / "data" / "rows" / "demonstrations.safetensors"
    write_tensors(file, demonstrate.label_arrays(labelled, 2))
    quick = PARAMS.cases["rows"].training.model_copy(update={"epochs": 1, "width": 8})
    params = changed(training=quick, seeds=(7,)).model_copy(
        update={"parallel": Parallel(backend="loky", workers=1)}
    )
    train.run(params, tmp_path, "rows", 7)
    for policy in (FULL, *params.cases["rows"].controls):
        loaded = load_relational(models_of(tmp_path, "rows", policy, 7))
        assert loaded._weights.sight == SIGHTS[policy]
    examples = train.load_demonstrations(tmp_path, "rows", load_domain())
    assert isinstance(examples, Examples)
    labels = train.shuffled(examples, np.random.default_rng(1)).right
    assert labels.sum(axis=(1, 2)).tolist() == [1] * len(examples)
    assert (labels != examples.right).any()
    assert SHUFFLED in params.cases["rows"].controls


def test_of_several_right_places_surfaces_are_taught(
    rows: list[dict[str, Any]], tmp_path: Path
) -> None:
    arrays = demonstrate.label_arrays([rows[-1] | {"configuration": i} for i in range(2)], 2)
    arrays["positions"][1] += 0.1  # so that there is a range of them
    known = arrays["right"].copy()
    (held,) = np.flatnonzero(arrays["supports"][0] < 0)
    surfaces = known.shape[2] - arrays["supports"].shape[1]
    another = surfaces + (held + 1) % arrays["supports"].shape[1]
    arrays["right"][0, -1 - arrays["supports"][0, held], another] = True
    write_tensors(tmp_path / "data" / "rows" / "demonstrations.safetensors", arrays)
    taught = train.load_demonstrations(tmp_path, "rows", load_domain()).right
    assert known[0, :, :surfaces].any()
    assert np.array_equal(taught, known)


def double(number: int) -> int:
    return 2 * number


def test_results_are_kept_and_damaged_ones_made_again(tmp_path: Path) -> None:
    settings = Parallel(backend="loky", workers=1)
    tasks = [(number, number) for number in range(3)]
    assert run_kept(double, tasks, tmp_path, settings, "demonstrate", "doubling") == [0, 2, 4]
    files = sorted(tmp_path.iterdir())
    kept = {file: file.stat().st_mtime_ns for file in files}
    files[0].write_text(files[0].read_text().replace('"result": ', '"result": 1'))
    (tmp_path / "of-another-program").mkdir()
    assert run_kept(double, tasks[:2], tmp_path, settings, "demonstrate", "doubling") == [0, 2]
    left = sorted(tmp_path.iterdir())
    assert len(left) == 2
    assert all(file.stat().st_mtime_ns == kept[file] for file in left if file != files[0])


def test_results_of_other_sources_are_not_used(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    clone, kept = tmp_path / "clone", tmp_path / "kept"
    stage = {"foreach": ["rows"], "do": {"deps": ["data/rows.json", "src/half.py"]}}
    write_text(clone / CASES, yaml.safe_dump({"stages": {"halve": stage}}))
    monkeypatch.setattr(sources, "SOURCES", clone)
    settings = Parallel(backend="loky", workers=1)
    names = []
    for half, other in (("n / 2", ""), ("n / 2", "pi"), ("n // 2", "pi")):
        write_text(clone / "src" / "half.py", half)
        write_text(clone / "src" / "other.py", other)
        run_kept(double, [(1, 1)], kept, settings, "halve", "doubling")
        names.append([file.name for file in kept.iterdir()])
    assert names[0] == names[1] != names[2]


def row(training: str, solved: bool, calls: int, **more: Any) -> dict[str, Any]:
    base = {"scene": "one", "size": 4, "planner": "facts", "length": 4 if solved else None}
    counts = {"coarse_calls": calls, "infeasible_calls": 1, "part_calls": 0, "failed_candidates": 0}
    checks = {"path_verified": None, "physics": None, "time_s": 0.5}
    return base | counts | checks | {"training": training, "solved": solved} | more


def test_figures() -> None:
    cell = [
        row("1", True, 4, path_verified=True, physics=True),
        row("1", True, 8, scene="two", path_verified=False),
        row("2", True, 6),
        row("2", False, 100, scene="two"),
    ]
    assert collect.figures(cell) == {
        "scenes": 2,
        "trainings": 2,
        "problems": 4,
        "solved": 3,
        "solved_within_2k": 3,
        "solved_min": 1,
        "calls_mean": 6.0,
        "infeasible_calls_mean": 1.0,
        "part_calls_mean": 0.0,
        "calls_limited_mean": 29.5,
        "failed_candidates_mean": 0.0,
        "plan_length_mean": 4.0,
        "path_verified_share": 0.5,
        "physics_share": 1.0,
    }


def test_a_stage_is_a_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for case in PARAMS.cases:
        shutil.copytree(ROOT / "reports" / case, tmp_path / "reports" / case)
    shutil.copy(ROOT / "params.yaml", tmp_path)
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(app, ["collect_cases"])
    assert done.exit_code == 0, done.output
    assert read_json(tmp_path / collect.RESULTS) == read_json(ROOT / collect.RESULTS)
    done = CliRunner().invoke(app, ["replay_case", "--case", "column"])
    assert isinstance(done.exception, InputError)


@pytest.mark.parametrize("name", PARAMS.cases)
@pytest.mark.parametrize("training", ["rivals", "1"])
def test_rows_in_git_are_found_again(name: str, training: str) -> None:
    """All planners on the first problem, searches and policies as they are today."""
    task = next(evaluate._tasks(declared_case(PARAMS, name), PARAMS, ROOT, training))
    rows = evaluate.compare(replace(task, with_path=False))
    written = read_outcomes(ROOT, name, training)
    for row in rows:
        (known,) = (
            one
            for one in written
            if (one["scene"], one["planner"]) == (row["scene"], row["planner"])
        )
        assert all(known[key] == row[key] for key in (*evaluate.COUNTS, "solved", "skeleton"))


@pytest.mark.parametrize("name", PARAMS.cases)
def test_the_figures_in_git_follow_from_the_rows_in_git(name: str) -> None:
    rows = collect.read_rows(ROOT, name, PARAMS.cases[name])
    written = read_json(ROOT / collect.RESULTS, "make cases")[name]
    assert collect.by_cell({name: rows}, collect.figures)[name] == written
    assert collect.compared(rows) == read_json(ROOT / collect.COMPARED, "make cases")[name]
    for size in map(str, PARAMS.cases[name].evaluation.sizes):
        assert set(written[size]) >= {
            *("no_policy", "facts", "facts_tuned", "conflicts", "astar"),
            *("relational", "relational_best_first"),
        }
        assert written[size]["relational"]["trainings"] == len(PARAMS.cases[name].seeds)


def test_the_page_on_cases_follows_from_the_figures_in_git() -> None:
    figures, shares = (read_json(ROOT / name) for name in (collect.RESULTS, collect.COMPARED))
    assert came_out(figures, shares) in (ROOT / ABOUT_CASES).read_text(encoding="utf-8")
