"""MLflow: what is recorded, once, and never at the expense of a stage's results."""

import json
import logging
import os
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from guided_lgp import cli, tracking
from guided_lgp.domains import load_domain
from guided_lgp.errors import InputError
from guided_lgp.mlflow_model import log_model
from guided_lgp.params import Params, load_params
from guided_lgp.policy.paper.encoding import Encoding
from guided_lgp.policy.paper.model import Model
from guided_lgp.policy.relational import model as relational
from guided_lgp.policy.relational.encoding import Range
from guided_lgp.policy.relational.heads import heads
from guided_lgp.policy.relational.model import Weights, shapes
from guided_lgp.tracking import runs as runs_module
from guided_lgp.tracking.stage_files import StageFiles

ROOT = Path(__file__).parents[1]
PARAMS = load_params(ROOT / "params.yaml")
METRICS = {
    "version": 1,
    "seed": 5,
    "sub_policies": {
        "box": {
            "accuracy": 0.9,
            "curves": {"loss": [2.0, 1.0, 0.5]},
            "by_configuration": {"accuracy": 0.8},
        }
    },
    "note": "text",
    "nan": None,
}
PIPELINE = """
stages:
  generate_scenes:
    cmd: python write.py
    deps: [write.py]
    params: [generate_scenes]
    outs:
      - data
      - reports/report.md:
          cache: false
      - reports/metrics/summary.json:
          cache: false
      - reports/training/place.json:
          cache: false
"""
WRITE = f"""
from pathlib import Path
for path, text in [
    ("data/x", "1"),
    ("reports/report.md", "# Report"),
    ("reports/metrics/summary.json", '{{"accuracy": {{"place": 0.9}}}}'),
    ("reports/training/place.json", {json.dumps(METRICS)!r}),
]:
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_text(text)
"""


@pytest.fixture(scope="module")
def database(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A database whose tables are made once for all tests here."""
    file = tmp_path_factory.mktemp("mlflow") / "template.db"
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{file}")
        tracking.prepare()
    return file


@pytest.fixture
def clone(tmp_path: Path, database: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A small pipeline whose stage has run, as the working directory, with a database."""
    (tmp_path / ".dvc").mkdir()
    (tmp_path / ".dvc" / "config").write_text("[core]\n    no_scm = true\n    analytics = false\n")
    (tmp_path / "dvc.yaml").write_text(PIPELINE)
    (tmp_path / "write.py").write_text(WRITE)
    (tmp_path / "params.yaml").write_text((ROOT / "params.yaml").read_text())
    (tmp_path / "mlflow.db").write_bytes(database.read_bytes())
    monkeypatch.chdir(tmp_path)
    for name in ("MLFLOW_TRACKING_URI", "DVC_ROOT", "DVC_EXP_NAME", "DVC_EXP_BASELINE_REV"):
        monkeypatch.delenv(name, raising=False)
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path}
    subprocess.run(["dvc", "repro", "-q"], check=True, env=environment)
    return tmp_path


def runs() -> list[Any]:
    client = tracking.prepare()
    experiment = client.get_experiment_by_name(tracking.EXPERIMENT).experiment_id
    return list(client.search_runs([experiment], order_by=["attributes.start_time ASC"]))


def children() -> list[Any]:
    return [run for run in runs() if tracking.STAGE_TAG in run.data.tags]


def record(params: Params = PARAMS) -> None:
    with tracking.recorded("generate_scenes", params):
        pass


def test_the_database_is_the_clones_own(clone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert tracking.tracking_uri() == f"sqlite:///{clone}/mlflow.db"
    (clone / "sub").mkdir()
    monkeypatch.chdir(clone / "sub")
    assert tracking.tracking_uri() == f"sqlite:///{clone}/mlflow.db"
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "http://127.0.0.1:5000")
    assert tracking.tracking_uri() == "http://127.0.0.1:5000"


def test_a_database_whose_making_is_interrupted_is_made_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from mlflow.store.db import utils

    def migrate(engine: Any) -> None:
        assert not (tmp_path / "mlflow.db").exists()
        raise KeyboardInterrupt

    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{tmp_path / 'mlflow.db'}")
    with monkeypatch.context() as patch:
        patch.setattr(utils, "_upgrade_db", migrate)
        patch.setattr(utils, "_initialize_tables", migrate)
        with pytest.raises(KeyboardInterrupt):
            tracking.prepare()
    assert tracking.prepare().get_experiment_by_name(tracking.EXPERIMENT) is not None
    assert {file.name for file in tmp_path.iterdir()} == {"mlflow.db"}


def test_temporary_experiments_record_in_their_origin(
    clone: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    temporary = clone / ".dvc" / "tmp" / "exps" / "temp"
    temporary.mkdir(parents=True)
    (temporary / "dvc.yaml").write_text(PIPELINE)
    monkeypatch.chdir(temporary)
    assert tracking.repository() == clone


def test_one_parent_per_execution_and_a_child_per_stage(clone: Path) -> None:
    record()
    record()
    parent, first, second = runs()
    for child in (first, second):
        assert child.data.tags["mlflow.parentRunId"] == parent.info.run_id
        assert child.data.params["seed_training"] == str(PARAMS.generate_scenes.seed_training)
        assert child.info.status == parent.info.status == "FINISHED"
    assert parent.data.params["train_policy.place.dropout"] == "0.1"
    assert parent.data.metrics == {"accuracy/place": 0.9}
    assert first.data.tags[tracking.KEY_TAG] == second.data.tags[tracking.KEY_TAG]


def test_metrics_curves_and_files_are_recorded(clone: Path) -> None:
    record()
    (child,) = children()
    assert child.data.metrics == {
        "box/accuracy": 0.9,
        "box/loss": 0.5,
        "box/by_configuration/accuracy": 0.8,
        "accuracy/place": 0.9,
    }
    client = tracking.prepare()
    curve = client.get_metric_history(child.info.run_id, "box/loss")
    assert [(point.step, point.value) for point in curve] == [(0, 2.0), (1, 1.0), (2, 0.5)]
    listings = [client.list_artifacts(child.info.run_id, folder) for folder in (None, "training")]
    files = [item.path for listing in listings for item in listing]
    assert files == ["metrics", "report.md", "training", "training/place.json"]


def test_the_data_that_a_stage_reads_are_inputs_of_both_runs(clone: Path) -> None:
    stage = StageFiles("build_dataset", "key", {"data/x": "0123", "src/y": "4567"}, {}, {})
    run = runs_module._Run.start("build_dataset", PARAMS, "execution", replayed=True)
    run.finish(stage)
    for recorded in runs():
        (data,) = recorded.inputs.dataset_inputs
        assert (data.dataset.name, data.dataset.digest) == ("data/x", "0123")


def test_data_in_arrays_is_no_model(clone: Path) -> None:
    outputs = {"data/rows/demonstrations.safetensors": "0123"}
    run = runs_module._Run.start("demonstrate", PARAMS, "execution", replayed=True)
    run.finish(StageFiles("demonstrate", "key", {}, outputs, {}))
    (child,) = children()
    assert child.info.status == "FINISHED"


def test_the_machine_is_watched_while_a_stage_runs(
    clone: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MLFLOW_SYSTEM_METRICS_SAMPLING_INTERVAL", "0.1")
    with tracking.recorded("generate_scenes", PARAMS):
        time.sleep(0.5)
    (child,) = children()
    assert "system/cpu_utilization_percentage" in child.data.metrics


@pytest.fixture
def experiment(tmp_path: Path, database: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """An experiment in a database of its own."""
    shutil.copy(database, tmp_path / "mlflow.db")
    monkeypatch.setenv("MLFLOW_TRACKING_URI", f"sqlite:///{tmp_path / 'mlflow.db'}")
    found: str = tracking.prepare().get_experiment_by_name(tracking.EXPERIMENT).experiment_id
    return found


def logged_and_loaded(folder: Path, name: str, experiment: str) -> Any:
    """A model after it went through MLflow."""
    import mlflow

    with mlflow.start_run(experiment_id=experiment):
        log_model(folder, name)
        (logged,) = mlflow.search_logged_models(
            experiment_ids=[experiment], filter_string=f"name = '{name}'", output_format="list"
        )
    model = mlflow.pyfunc.load_model(logged.model_uri)
    assert model.metadata.signature is not None
    assert model.input_example is not None
    return model


def test_networks_can_be_loaded_from_mlflow(tmp_path: Path, experiment: str) -> None:
    from mlflow.exceptions import MlflowException

    encoding = Encoding()
    rng = np.random.default_rng(0)
    sub_policies = {
        name: ((rng.normal(size=(classes, inputs)).astype(np.float32), np.zeros(classes, "f4")),)
        for name, inputs, classes in zip(
            Encoding().chains["grasp"],
            encoding.chain_inputs("grasp"),
            map(encoding.classes, Encoding().chains["grasp"]),
            strict=True,
        )
    }
    Model("grasp", encoding, sub_policies, training={}).save(tmp_path / "models")
    model = logged_and_loaded(tmp_path / "models", "grasp", experiment)
    inputs = rng.normal(size=(4, encoding.chain_inputs("grasp")[0])).astype(np.float32)
    probabilities = model.predict(inputs)
    assert probabilities.shape == (4, 6)
    np.testing.assert_allclose(probabilities.sum(axis=1), 1, rtol=1e-5)
    with pytest.raises(MlflowException):
        model.predict(inputs[:, :-1])


def test_the_relational_policy_can_be_loaded_from_mlflow(tmp_path: Path, experiment: str) -> None:
    rng = np.random.default_rng(0)
    tensors = {
        n: rng.normal(size=s).astype(np.float32)
        for n, s in shapes(4, 1, heads(load_domain())).items()
    }
    weights = Weights(Range(lower=(0.0,) * 3, upper=(1.0,) * 3), tensors, load_domain())
    relational.Model(weights, training={}).save(tmp_path / "models")
    model = logged_and_loaded(tmp_path / "models", "relational", experiment)
    scene = (ROOT / "examples" / "four_boxes_and_tray.json").read_text()
    goals = "(on red tray) (held blue)"
    (answer,) = model.predict(pd.DataFrame([{"scene": scene, "goals": goals}]))
    actions = json.loads(answer)
    assert len(actions) == 8
    assert "(grasp pr2L yellow)" in actions
    assert sum(actions.values()) == pytest.approx(1)


def test_a_failing_stage_is_recorded_as_failed(clone: Path) -> None:
    with (
        pytest.raises(ZeroDivisionError),
        tracking.recorded("generate_scenes", PARAMS),
    ):
        raise ZeroDivisionError("no results")
    parent, child = runs()
    assert child.info.status == parent.info.status == "FAILED"
    assert child.data.tags["error"] == "ZeroDivisionError: no results"


def test_killed_stages_are_marked_at_the_next_start(clone: Path) -> None:
    code = """
import os, signal
from pathlib import Path
from guided_lgp import cli, tracking
from guided_lgp.params import load_params
with tracking.recorded("generate_scenes", load_params(Path("params.yaml"))):
    os.kill(os.getpid(), signal.SIGKILL)
"""
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == -9
    parent, child = runs()
    assert child.info.status == parent.info.status == "KILLED"


def test_running_stages_stay_so(clone: Path) -> None:
    with tracking.recorded("generate_scenes", PARAMS):
        parent, child = runs()
        assert child.info.status == parent.info.status == "RUNNING"


def test_tracking_problems_are_warnings(
    clone: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (clone / "file").write_text("not a folder")
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "unknown-scheme://nowhere")
    with caplog.at_level(logging.WARNING, logger="guided_lgp"):
        record()
    assert "MLflow: not recorded" in caplog.text


def warnings(caplog: pytest.LogCaptureFixture, captured: str) -> list[str]:
    """All lines that tracking has written."""
    return [record.getMessage() for record in caplog.records] + captured.splitlines()


def test_a_server_that_does_not_answer_delays_no_stage(
    clone: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    capfd: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(runs_module, "LONGEST_S", 1.0)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        address = f"http://127.0.0.1:{silent.getsockname()[1]}"
        monkeypatch.setenv("MLFLOW_TRACKING_URI", address)
        start = time.monotonic()
        record()
        assert time.monotonic() - start < 3
    assert warnings(caplog, capfd.readouterr().err) == ["MLflow: not recorded: no answer in 1 s"]


def test_a_server_that_is_not_there_is_given_up_within_seconds(
    clone: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("MLFLOW_TRACKING_URI", "http://127.0.0.1:9")
    start = time.monotonic()
    record()
    assert time.monotonic() - start < 20
    (line,) = warnings(caplog, "")
    assert line.startswith("MLflow: not recorded: ")
    assert len(line) <= 300


def test_a_database_that_goes_during_a_stage_is_one_line(
    clone: Path, caplog: pytest.LogCaptureFixture, capfd: pytest.CaptureFixture[str]
) -> None:
    capfd.readouterr()
    with tracking.recorded("generate_scenes", PARAMS):
        (clone / "mlflow.db").unlink()
    (line,) = warnings(caplog, capfd.readouterr().err)
    assert line.startswith("MLflow: not recorded: ")
    assert len(line) <= 300


@pytest.mark.parametrize("content", [b"no database" * 1000, b"SQLite format 3\0" + b"\xff" * 5000])
@pytest.mark.parametrize("command", ["ui", "sync"])
def test_a_damaged_database_is_one_line(
    content: bytes, command: str, clone: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (clone / "mlflow.db").write_bytes(content)
    with pytest.raises(SystemExit) as ended:
        cli.main(["mlflow", command])
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"error: {clone / 'mlflow.db'}: cannot be used: ")


def test_of_two_that_make_the_database_both_are_recorded(clone: Path) -> None:
    (clone / "mlflow.db").unlink()
    code = """
from pathlib import Path
from guided_lgp import cli, tracking
from guided_lgp.params import load_params
with tracking.recorded("generate_scenes", load_params(Path("params.yaml"))):
    pass
"""
    both = [subprocess.Popen([sys.executable, "-c", code]) for _ in range(2)]
    assert [process.wait(120) for process in both] == [0, 0]
    assert [run.info.status for run in children()] == ["FINISHED"] * 2


def test_sync_records_once(clone: Path) -> None:
    assert tracking.sync(PARAMS) == (["generate_scenes"], [])
    assert tracking.sync(PARAMS) == ([], ["generate_scenes"])
    (child,) = children()
    assert child.data.tags["restored"] == "True"


def test_sync_leaves_what_a_stage_recorded_itself(clone: Path) -> None:
    record()
    assert tracking.sync(PARAMS) == ([], ["generate_scenes"])


def test_sync_joins_the_execution_with_the_same_parameters(clone: Path) -> None:
    with pytest.raises(KeyboardInterrupt), tracking.recorded("generate_scenes", PARAMS):
        raise KeyboardInterrupt
    assert tracking.sync(PARAMS) == (["generate_scenes"], [])
    interrupted, synced = children()
    assert synced.data.tags["mlflow.parentRunId"] == interrupted.data.tags["mlflow.parentRunId"]


def test_sync_refuses_what_dvc_did_not_write(clone: Path) -> None:
    other = PARAMS.generate_scenes.model_copy(update={"seed_test": 77})
    with pytest.raises(InputError, match=r"generate_scenes\.seed_test: is not 2, with which"):
        tracking.sync(PARAMS.model_copy(update={"generate_scenes": other}))
    (clone / "reports" / "training" / "place.json").write_text("{}")
    with pytest.raises(InputError, match=r"place\.json: is not the one that dvc\.lock names"):
        tracking.sync(PARAMS)
    (clone / "reports" / "training" / "place.json").unlink()
    with pytest.raises(InputError, match="made by the stage generate_scenes"):
        tracking.sync(PARAMS)
    (clone / "dvc.lock").unlink()
    with pytest.raises(InputError, match="no stage has run here"):
        tracking.sync(PARAMS)
    assert runs() == []
