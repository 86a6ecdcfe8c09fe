"""A parent run per pipeline execution and a child per stage, each recorded once."""

import json
import logging
import os
import shutil
import subprocess
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from guided_lgp.errors import shortened
from guided_lgp.params import Params
from guided_lgp.tracking.database import (
    EXECUTION_TAG,
    EXPERIMENT,
    KEY_TAG,
    PROCESS_TAG,
    STAGE_TAG,
    STATE_TAG,
    find,
    prepare,
    process,
    recorded_keys,
)
from guided_lgp.tracking.metrics import SUMMARY, files, flatten, read_metrics
from guided_lgp.tracking.stage_files import (
    StageFiles,
    check_outputs,
    check_parameters,
    read_lock,
    running_stage,
)

Value = TypeVar("Value")

BATCH = 500
"""Metrics per request; MLflow accepts at most 1000."""

LONGEST_S = 120.0
"""How long recording may hold a stage at its start and at its end: on a busy machine the import of
MLflow alone takes a quarter of it."""

logger = logging.getLogger(__name__)


@contextmanager
def recorded(address: str, params: Params) -> Iterator[None]:
    """Record a stage as a run; its own errors pass through, those of tracking do not."""
    run = _attempt(lambda: _Run.start(address, params, _execution(), replayed=False))
    try:
        yield
    except BaseException as error:
        if run is not None:
            reason = f"{type(error).__name__}: {error}"
            _attempt(lambda: run.fail(reason))
        raise
    if run is not None:
        _attempt(lambda: run.finish(running_stage(address)))


def sync(params: Params) -> tuple[list[str], list[str]]:
    """Record the stages in ``dvc.lock`` that no run describes yet.

    Returns:
        The stages recorded now, and those that had been recorded before.

    Raises:
        InputError: there is no good ``dvc.lock``, or an output or a parameter is not the one in it.
    """
    stages = read_lock(Path("dvc.lock"))
    known = recorded_keys(prepare())
    missing = [stage for stage in stages if stage.key not in known]
    for stage in missing:
        check_parameters(stage, params)
        check_outputs(stage)
    for stage in missing:
        run = _Run.start(stage.address, params, _execution_of_same_state(params), replayed=True)
        run.finish(stage)
    before = [stage.address for stage in stages if stage.key in known]
    return [stage.address for stage in missing], before


class _Run:
    """The child run of one stage, and its parent."""

    def __init__(self, client: Any, parent: str, run_id: str) -> None:
        self._client = client
        self._parent = parent
        self._id = run_id
        self._monitor: Any = None

    @classmethod
    def start(cls, address: str, params: Params, execution: str, replayed: bool) -> "_Run":
        from mlflow.utils.mlflow_tags import MLFLOW_PARENT_RUN_ID

        client = prepare()
        experiment = client.get_experiment_by_name(EXPERIMENT).experiment_id
        parent = find(client, f"tags.`{EXECUTION_TAG}` = '{execution}'")
        if parent is None:
            parent = _create_parent(client, experiment, params, execution)
        client.update_run(parent, status="RUNNING")
        tags = {
            MLFLOW_PARENT_RUN_ID: parent,
            STAGE_TAG: address,
            PROCESS_TAG: process(),
            "restored": str(replayed),
        }
        child = client.create_run(experiment, tags=tags, run_name=address)
        run = cls(client, parent, child.info.run_id)
        if not replayed:
            run._watch()
        section = _section(address, params)
        _log_params(client, run._id, section)
        return run

    def _watch(self) -> None:
        """Record processor, memory, disk and network while the stage runs."""
        from mlflow.system_metrics.system_metrics_monitor import SystemMetricsMonitor

        self._monitor = SystemMetricsMonitor(self._id)
        self._monitor.start()

    def finish(self, stage: StageFiles) -> None:
        """Record what the stage has written."""
        self._client.set_tag(self._id, KEY_TAG, stage.key)
        outputs = [Path(path) for path in stage.outputs]
        reports = [file for path in outputs if path.parts[0] == "reports" for file in files(path)]
        for file in reports:
            if file.suffix == ".json":
                _log_metrics(self._client, self._id, read_metrics(file))
            if file == SUMMARY:
                _log_metrics(self._client, self._parent, read_metrics(file))
            folder = file.parent.relative_to("reports")
            self._client.log_artifact(self._id, str(file), str(folder) if folder.name else None)
        weights = (path for path in outputs if path.suffix == ".safetensors")
        self._log_models([path for path in weights if path.parts[0] == "models"])
        self._log_datasets(stage)
        self._end("FINISHED")

    def _log_datasets(self, stage: StageFiles) -> None:
        """The data that the stage has read, by path and md5: in its run and in the parent's."""
        from mlflow.entities import Dataset, DatasetInput

        inputs = [
            DatasetInput(Dataset(path, digest or "", "local", json.dumps({"uri": path})))
            for path, digest in stage.dependencies.items()
            if Path(path).parts[0] == "data"
        ]
        for run in (self._id, self._parent) if inputs else ():
            self._client.log_inputs(run, datasets=inputs)

    def _log_models(self, weights: list[Path]) -> None:
        if not weights:
            return
        import mlflow

        from guided_lgp.mlflow_model import log_model

        with mlflow.start_run(run_id=self._id, log_system_metrics=False):
            for path in weights:
                with TemporaryDirectory() as folder:
                    for file in (path, path.with_suffix(".json")):
                        shutil.copy(file, folder)
                    logged = log_model(Path(folder), path.stem)
                self._register("-".join(path.with_suffix("").parts[1:]), logged)

    def _register(self, name: str, logged: Any) -> None:
        """Make a logged model the latest version of its name in the registry."""
        from mlflow import MlflowException

        registered = f"{EXPERIMENT}-{name}"
        with suppress(MlflowException):  # it is there already
            self._client.create_registered_model(registered)
        self._client.create_model_version(
            registered, logged.model_uri, self._id, model_id=logged.model_id
        )

    def fail(self, reason: str) -> None:
        """Record why the stage has no results."""
        self._client.set_tag(self._id, "error", reason[:5000])
        self._end("FAILED")

    def _end(self, status: str) -> None:
        if self._monitor is not None:
            self._monitor.finish()
        self._client.set_terminated(self._id, status)
        self._client.set_terminated(self._parent, status)


def _section(address: str, params: Params) -> Mapping[str, Any]:
    """The parameters of a stage: its own, or those of the case that it belongs to."""
    stage, _, of = address.rpartition(":")[2].partition("@")
    values = params.model_dump()
    own: Mapping[str, Any] = values.get(stage) or values["cases"].get(of.partition("-")[0], {})
    return own


def _create_parent(client: Any, experiment: str, params: Params, execution: str) -> str:
    values = params.model_dump()
    name = os.environ.get("DVC_EXP_NAME") or time.strftime("repro %Y-%m-%d %H:%M:%S")
    tags = {
        EXECUTION_TAG: execution,
        STATE_TAG: _state(params),
        "commit": _commit(),
        "dvc_experiment": os.environ.get("DVC_EXP_NAME", ""),
    }
    run_id: str = client.create_run(experiment, tags=tags, run_name=name).info.run_id
    _log_params(client, run_id, values)
    return run_id


def _log_params(client: Any, run_id: str, values: Mapping[str, Any]) -> None:
    from mlflow.entities import Param

    flat = [Param(name, str(value)) for name, value in flatten(values).items()]
    client.log_batch(run_id, params=flat)


def _log_metrics(client: Any, run_id: str, metrics: Mapping[str, list[float]]) -> None:
    from mlflow.entities import Metric

    now = int(time.time() * 1000)
    points = [
        Metric(name, value, now, step)
        for name, values in metrics.items()
        for step, value in enumerate(values)
    ]
    for first in range(0, len(points), BATCH):
        client.log_batch(run_id, metrics=points[first : first + BATCH])


def _execution() -> str:
    """Identity of the pipeline execution that this process belongs to.

    DVC starts every stage from one process, so that process identifies the execution; a stage
    started by hand is an execution of its own.
    """
    import psutil

    this = psutil.Process()
    ancestors = [
        process
        for process in this.parents()
        if any(Path(word).name == "dvc" for word in process.cmdline()[:3])
    ]
    root = ancestors[0] if ancestors else this
    return f"{os.environ.get('DVC_EXP_NAME', '')}:{root.pid}:{root.create_time():.2f}"


def _execution_of_same_state(params: Params) -> str:
    """The latest execution of this commit with these parameters, or a new one."""
    client = prepare()
    run_id = find(client, f"tags.`{STATE_TAG}` = '{_state(params)}'")
    if run_id is None:
        return f"sync:{_state(params)}"
    return str(client.get_run(run_id).data.tags[EXECUTION_TAG])


def _state(params: Params) -> str:
    return sha256(f"{_commit()} {params.model_dump_json()}".encode()).hexdigest()


def _commit() -> str:
    if revision := os.environ.get("DVC_EXP_BASELINE_REV"):
        return revision
    command = ["git", "rev-parse", "HEAD"]
    answer = subprocess.run(command, capture_output=True, text=True, check=False)
    return answer.stdout.strip() or "unknown"


def _attempt(action: Callable[[], Value]) -> Value | None:
    """What an action returns; None and one line if it fails or takes too long."""
    results: list[Value] = []
    faults: list[str] = [f"no answer in {LONGEST_S:g} s"]

    def act() -> None:
        try:
            results.append(action())
        except Exception as error:
            faults[:] = [f"{type(error).__name__}: {' '.join(str(error).split())}"]

    thread = threading.Thread(target=act, daemon=True)  # which ends with the process
    thread.start()
    thread.join(LONGEST_S)
    if results:
        return results[0]
    logger.warning("%s", shortened(f"MLflow: not recorded: {faults[0]}"))
    return None
