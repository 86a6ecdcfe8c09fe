"""The command line: help, exit codes, one line per error, planning end to end."""

import json
import resource
import runpy
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import yaml
from typer.main import get_command

from guided_lgp import __version__, cache, cli, doctor
from guided_lgp.bounds.plan_file import read_plan
from guided_lgp.bounds.verify import verify_path
from guided_lgp.clearance import CLEARANCE
from guided_lgp.errors import InputError, WorkerError, pybullet_remedy
from guided_lgp.scene.world import world_of

ROOT = Path(__file__).parents[1]
SCENE = ROOT / "examples" / "three_boxes.json"
PLAN = ["plan", str(SCENE), "--goal", "(on red green)", "--planner", "breadth-first"]
COMMANDS = [
    *cli.STAGES,
    "plan",
    "execute",
    "replan",
    "export",
    "pddl",
    "view",
    "schema",
    "examples",
    "doctor",
    "mlflow",
]


def call(*arguments: str, cwd: Path = ROOT) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "guided_lgp.cli", *arguments],
        cwd=cwd,
        text=True,
        capture_output=True,
        stdin=subprocess.DEVNULL,
        check=False,
        timeout=120,
    )


def rejected(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """The message of a command that ends with 2 and one line on standard error."""
    with pytest.raises(SystemExit) as ended:
        cli.main(arguments)
    captured = capsys.readouterr()
    assert ended.value.code == 2
    assert captured.out == ""
    assert captured.err.count("\n") == 1
    assert captured.err.startswith("error: ")
    return captured.err.removeprefix("error: ").rstrip("\n")


def edited(folder: Path, **changes: Any) -> Path:
    """A scene file with other top-level fields."""
    file = folder / "scene.json"
    file.write_text(json.dumps(json.loads(SCENE.read_text()) | changes))
    return file


def test_help_takes_less_than_a_second() -> None:
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = call("--help")
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert done.returncode == 0
    for command in COMMANDS:
        assert command in done.stdout
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 1


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_with_an_example(
    command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["mlflow", "sync", "--help"] if command == "mlflow" else [command, "--help"]
    with pytest.raises(SystemExit) as ended:
        cli.main(words)
    assert ended.value.code in (0, None)
    shown = capsys.readouterr().out
    assert "Example:" in shown
    assert "<bool>" not in shown


def options() -> list[tuple[str, Any]]:
    """Every option and argument of every command, with the command's name."""
    found, commands = [], [("", get_command(cli.app))]
    for name, command in commands:
        found += [(name, option) for option in command.params]
        commands += getattr(command, "commands", {}).items()
    return found


@pytest.mark.parametrize(
    "option", [pytest.param(o, id=f"{name} {o.name}".strip()) for name, o in options()]
)
def test_every_option_has_help_and_a_default(option: Any) -> None:
    assert option.help
    shown = option.show_default if isinstance(option.show_default, str) else option.default
    assert option.required or shown or "completion" in option.name
    assert str(ROOT) not in str(shown)


def test_heavy_packages_are_not_imported_for_help() -> None:
    code = "import sys, guided_lgp.cli; print(*sys.modules)"
    loaded = subprocess.run(
        [sys.executable, "-c", code], text=True, capture_output=True, check=True
    )
    heavy = {"numpy", "pydantic", "torch", "lightning", "mlflow", "pandas", "pybullet", "casadi"}
    assert heavy.isdisjoint(loaded.stdout.split())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["plant"], "No such command 'plant'."),
        (["train_policy", "swim"], "'swim' is not one of 'instruction', 'grasp', 'place'"),
        (["plan", str(SCENE)], "goal: none given"),
        (["plan", str(SCENE), "--goal", "(on red green)", "--planner", "fast"], "'fast' is not"),
        (["plan", str(SCENE), "--goal", "(on red)"], "goal '(on red)': is not a goal"),
        (["plan", str(SCENE), "--goal", "(on red sink)"], "unknown table 'sink'"),
        (["plan", str(SCENE), "--goal", "(held pink)"], "unknown box 'pink'"),
        (["plan", "none.json", "--goal", "(held red)"], "none.json: No such file"),
        (["view", "none.json"], "none.json: No such file"),
        (["view", str(ROOT / "README.md")], "README.md: is not JSON"),
        (["view", str(SCENE), "--rerun", "plan.rrd"], "has no motion to record"),
        (["generate_scenes", "--params", "none.yaml"], "none.yaml: No such file"),
        (["mlflow", "ui", "--port", "0"], "--port"),
    ],
)
def test_bad_input_is_one_line_and_exit_code_2(
    capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert message in rejected(capsys, *arguments)


def test_contradictory_goals(capsys: pytest.CaptureFixture[str]) -> None:
    goals = ["--goal", "(on red tab2)", "--goal", "(held red)"]
    assert "contradict" in rejected(capsys, "plan", str(SCENE), *goals)
    goals = ["--goal", "(on red blue)", "--goal", "(on blue red)"]
    assert "cycle" in rejected(capsys, "plan", str(SCENE), *goals)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"boxes": []}, "boxes"),
        ({"colour": "blue"}, "unknown field 'colour'"),
        ({"robot": {"model": "pr2", "torso": 2}}, "robot.torso"),
        ({"tables": [{"name": "tab1", "position": [0, 0], "half_extents": [1, 1]}]}, "tables.0"),
    ],
)
def test_faulty_scenes_name_file_and_field(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], changes: dict[str, Any], message: str
) -> None:
    file = edited(tmp_path, **changes)
    text = rejected(capsys, "plan", str(file), "--goal", "(held red)")
    assert text.startswith(f"{file}: {message}")


def test_output_in_a_missing_folder(capsys: pytest.CaptureFixture[str]) -> None:
    assert "accepted: 0.003 to 0.05" in rejected(capsys, *PLAN, "--clearance", "10")
    assert "folder does not exist" in rejected(capsys, *PLAN, "--out", "nowhere/plan.json")


def test_output_over_the_scene_is_refused_before_planning(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = edited(tmp_path)
    before = file.read_bytes()
    words = ["plan", str(file), "--goal", "(on red green)"]
    assert "is read by this command" in rejected(capsys, *words, "--out", str(file))
    assert "is also the file of --out" in rejected(
        capsys, *words, "--out", str(tmp_path / "x"), "--html", str(tmp_path / "x")
    )
    assert "--out .: is a folder, or no name" in rejected(capsys, *words, "--out", "")
    assert "standard output" in rejected(capsys, *words, "--out", "-", "--json")
    assert file.read_bytes() == before


def test_a_scene_that_is_not_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "scene.json"
    file.write_text("{")
    assert "is not JSON" in rejected(capsys, "plan", str(file), "--goal", "(held red)")


def test_a_floating_box(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    boxes = json.loads(SCENE.read_text())["boxes"]
    boxes[0]["position"][2] += 0.1
    file = edited(tmp_path, boxes=boxes)
    text = rejected(capsys, "plan", str(file), "--goal", "(held red)")
    assert text.startswith(str(file))
    assert "red" in text


def test_missing_models_name_the_stage(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    goal = ["--goal", "(held red)", "--models", str(tmp_path)]
    assert "train_relational" in rejected(capsys, "plan", str(SCENE), *goal)


def test_impossible_parameters_stop_a_stage(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    document = yaml.safe_load((ROOT / "params.yaml").read_text())
    document["build_dataset"]["training_objectives"] = 99
    file = tmp_path / "params.yaml"
    file.write_text(yaml.safe_dump(document))
    monkeypatch.chdir(tmp_path)
    text = rejected(capsys, "build_dataset", "--params", str(file))
    assert "build_dataset.training_objectives" in text
    assert list(tmp_path.iterdir()) == [file]


def test_debug_shows_the_traceback() -> None:
    done = call("--debug", "plan", "none.json", "--goal", "(held red)")
    assert "Traceback" in done.stderr
    assert "InputError" in done.stderr


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (WorkerError("enumerate: task 1 of 2 failed"), "error: enumerate: task 1 of 2 failed\n"),
        (KeyError("x"), "error: internal error: KeyError: 'x'; --debug shows where\n"),
    ],
)
def test_errors_of_the_program_end_with_3(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    error: Exception,
    line: str,
) -> None:
    def fail() -> None:
        raise error

    monkeypatch.setattr("guided_lgp.doctor.examine", fail)
    with pytest.raises(SystemExit) as ended:
        cli.main(["doctor"])
    assert ended.value.code == 3
    assert capsys.readouterr().err == line


@pytest.mark.parametrize(
    ("error", "code", "line"),
    [
        (InputError("cases", "unknown: x", "paper"), 2, "cases: unknown: x (accepted: paper)"),
        (WorkerError("train: task 1 of 2 failed"), 3, "train: task 1 of 2 failed"),
        (KeyError("x"), 3, "internal error: KeyError: 'x'; --debug shows where"),
    ],
)
def test_errors_of_the_studies_are_one_line_too(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    error: Exception,
    code: int,
    line: str,
) -> None:
    def fail(root: Path, case: str) -> None:
        raise error

    monkeypatch.setattr("guided_lgp.studies.train.train", fail)
    monkeypatch.setattr("sys.argv", ["run.py", "train", "x"])
    before = signal.getsignal(signal.SIGTERM)
    try:
        with pytest.raises(SystemExit) as ended:
            runpy.run_path(str(ROOT / "studies" / "run.py"), run_name="__main__")
    finally:
        signal.signal(signal.SIGTERM, before)
    assert ended.value.code == code
    assert capsys.readouterr().err == f"error: {line}\n"


def test_plan_writes_actions_and_a_replay(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page, file = tmp_path / "plan.html", tmp_path / "plan.json"
    with pytest.raises(SystemExit) as ended:
        cli.main([*PLAN, "--json", "--execute", "--html", str(page), "--out", str(file)])
    assert not ended.value.code
    answer = json.loads(capsys.readouterr().out)
    assert answer["solved"] is True
    assert len(answer["actions"]) == 2
    assert answer["actions"][-1].endswith("red green)")
    assert answer["physics"]["success"] is True
    assert page.stat().st_size > 100_000
    plan = json.loads(file.read_text())
    assert plan["actions"] == answer["actions"]
    assert plan["objective"] == ["(on red green)"]
    assert plan["physics"]["success"] is True
    assert {"tree_size", "attempts", "time_s"} <= set(plan["statistics"])
    assert plan["statistics"]["clearance"]["wished"] == CLEARANCE
    assert {"distance", "part", "body", "time"} < set(plan["statistics"]["clearance"])


def test_a_plan_goes_to_standard_output_alone() -> None:
    done = call(*PLAN, "--out", "-")
    assert done.returncode == 0
    assert json.loads(done.stdout)["objective"] == ["(on red green)"]


def test_no_plan_ends_with_1_and_says_why(capsys: pytest.CaptureFixture[str]) -> None:
    scene = str(ROOT / "examples" / "impossible_tower.json")
    limits = ["--planner", "breadth-first", "--max-nodes", "100", "--json"]
    with pytest.raises(SystemExit) as ended:
        cli.main(["plan", scene, "--goal", "(on red green)", *limits])
    assert ended.value.code == 1
    captured = capsys.readouterr()
    first, *others, help_, hint = captured.err.splitlines()
    assert first.startswith("no plan: both arms fail to grasp red there, even alone in the scene")
    assert "stopped at the limit of the tree size (1" in first
    assert all(line.startswith("also infeasible: (") for line in others)
    assert help_ == "hint: move red or the robot, or a smaller red"
    assert hint == "hint: --max-nodes raises the limit"
    answer = json.loads(captured.out)
    assert answer["solved"] is False
    assert answer["obstacles"][0]["action"].endswith(" red)")
    assert answer["statistics"]["coarse_sequences"] > 0


def test_goals_that_hold_already_are_a_plan_of_no_actions(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(["plan", str(SCENE), "--goal", "(on red tab1)"])
    assert ended.value.code in (0, None)
    assert capsys.readouterr().out == "the goals hold already\n"


def test_the_plan_of_no_actions_is_written_like_any_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, page = tmp_path / "plan.json", tmp_path / "plan.html"
    words = ["plan", str(SCENE), "--goal", "(on red tab1)", "--execute"]
    with pytest.raises(SystemExit) as ended:
        cli.main([*words, "--out", str(out), "--html", str(page)])
    assert ended.value.code in (0, None)
    first, physics, *written = capsys.readouterr().out.splitlines()
    assert (first, physics) == ("the goals hold already", "physics: all goals hold")
    assert written == [f"written: {out}", f"written: {page}"]
    plan = read_plan(out)
    assert (plan.actions, plan.objective) == ((), ("(on red tab1)",))
    assert verify_path(world_of(plan.scene), plan.skeleton, plan.trajectory).violation is None


def test_a_limit_of_time_ends_the_search_with_a_reason(
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = ["plan", str(SCENE), "--goal", "(on red green)", "--timeout", "0.001"]
    with pytest.raises(SystemExit) as ended:
        cli.main(words)
    assert ended.value.code == 1
    said = capsys.readouterr().err
    assert "stopped at the limit of time" in said
    assert "--timeout raises the limit" in said


def test_doctor_says_how_to_mend(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))  # whatever older versions have left
    with pytest.raises(SystemExit):
        cli.main(["doctor", "--json"])
    findings = {finding["name"]: finding for finding in json.loads(capsys.readouterr().out)}
    assert findings["Python"]["ok"]
    assert findings["Robots"]["ok"]
    assert findings["Cache"]["ok"]
    assert findings["Vectors"]["detail"]
    assert findings["Policy paper"]["ok"]
    assert all(finding["ok"] or finding["mend"] for finding in findings.values())


def test_without_pybullet_one_line_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    assert pybullet_remedy((3, 11)) == "pip install pybullet"
    assert pybullet_remedy((3, 13)).endswith("or Python 3.10 or 3.11")
    code = "import sys; sys.modules['pybullet'] = None; from guided_lgp.cli import main; main()"
    words = [sys.executable, "-c", code, "plan", str(SCENE), "--goal", "(on red green)"]
    done = subprocess.run(words, text=True, capture_output=True, check=False)
    assert done.returncode == 2
    assert done.stderr == f"error: PyBullet: is not installed (accepted: {pybullet_remedy()})\n"
    monkeypatch.setattr(doctor, "find_spec", lambda _: None)
    finding = doctor._pybullet()
    assert not finding.ok
    assert finding.mend == pybullet_remedy()


def test_doctor_finds_a_damaged_cache_and_mends_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    file = cache.made("entry", lambda _: b"content")
    assert file is not None
    assert doctor._cache().ok
    file.write_bytes(b"other")
    finding = doctor._cache()
    assert not finding.ok
    assert str(file) in finding.detail
    assert finding.mend.endswith("doctor --repair")
    (tmp_path / "guided-lgp" / "without a digest").touch()
    assert doctor._cache().detail.endswith(" and 1 more")
    whole = cache.kept("whole", b"content")
    assert len(doctor.repair()) == 2
    assert doctor._cache().ok
    assert not file.exists()
    assert whole.read_bytes() == b"content"
    assert doctor.repair() == []


def test_doctor_finds_damaged_models_and_a_cache_that_cannot_be_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    (tmp_path / "instruction.json").write_text("{")
    monkeypatch.setattr(doctor, "MODELS", tmp_path)
    findings = {finding.name: finding for finding in doctor.examine()}
    assert not findings["Cache"].ok
    assert "XDG_CACHE_HOME" in findings["Cache"].mend
    for policy, stage in (("paper", "policy"), ("improved", "improved"), ("relational",) * 2):
        finding = findings[f"Policy {policy}"]
        assert not finding.ok
        assert f"dvc repro train_{stage}" in finding.mend
    assert "damaged" in findings["Policy paper"].detail


def test_the_python_interface_from_the_documentation() -> None:
    done = subprocess.run(
        [sys.executable, str(ROOT / "examples" / "plan.py")],
        text=True,
        capture_output=True,
        check=True,
        timeout=120,
    )
    assert done.stdout.startswith("(grasp")


def test_the_version_and_short_help(capsys: pytest.CaptureFixture[str]) -> None:
    for words, expected in (
        (["--version"], f"guided-lgp {__version__}"),
        (["plan", "-h"], "--goal"),
    ):
        with pytest.raises(SystemExit) as ended:
            cli.main(words)
        assert ended.value.code in (0, None)
        assert expected in capsys.readouterr().out


def test_stages_stand_apart_from_what_users_need(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        cli.main(["--help"])
    users, _, pipeline = capsys.readouterr().out.partition("pipeline \u2500")
    assert all(stage in pipeline for stage in (*cli.STAGES, "mlflow"))
    assert all(f" {command} " in users for command in ("plan", "view", "export", "doctor"))


def test_a_plan_given_as_a_scene_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "plan.json").write_text('{"scene": {}, "actions": []}')
    message = rejected(capsys, "plan", str(tmp_path / "plan.json"), "--goal", "(held red)")
    assert "is a plan, not a scene" in message
