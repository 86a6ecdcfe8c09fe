"""MLflow: one parent run per pipeline execution, one child per stage.

A stage records itself when it has finished, from the files it has written: everything in its own
run, and in the parent's what executions are compared by. What DVC restores from its cache is
recorded by :func:`sync` from the same files. Every child carries a key made of all that determines
the stage's results, so what has been recorded is not recorded again. Results never depend on
tracking: its failures become a warning.
"""

import json
import logging
import os
import platform
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import md5, sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from guided_lgp.documents import read_json
from guided_lgp.errors import InputError
from guided_lgp.params import Params
from guided_lgp.paths import PARAMS

Value = TypeVar("Value")

EXPERIMENT = "guided-lgp"
SQLITE = "sqlite:///"
STAGE_TAG = "guided_lgp.stage"
KEY_TAG = "guided_lgp.key"
EXECUTION_TAG = "guided_lgp.execution"
STATE_TAG = "guided_lgp.state"
PROCESS_TAG = "guided_lgp.process"
BATCH = 500
"""Metrics per request; MLflow accepts at most 1000."""

COMPARED = frozenset(
    ("accuracy", "shortest", "feasible", "no_solution", "solved", "tree_size_mean", "time_mean_s")
)
"""Figures of the stages that the parent run has too, since these runs are compared."""
DETAILS = frozenset(("by_configuration", "astar", "breadth_first_graph", "uniform_best_first"))
"""Groups of which it has none: the other split, and controls beside the planners of the paper.

A comparison draws a chart per figure; those of all groups would be two thousand."""

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class StageFiles:
    """A stage as ``dvc.lock`` describes it."""

    address: str
    """Name in dvc.yaml, such as ``train_policy@place``."""
    key: str
    """Hash of the command, the dependencies and the parameters."""
    dependencies: tuple[str, ...]
    outputs: Mapping[str, str | None]
    """Paths with their md5, where known."""
    parameters: Mapping[str, Any]
    """Values by dotted name."""

    @classmethod
    def of(cls, address: str, entry: Mapping[str, Any]) -> "StageFiles":
        """Read the entry of one stage in ``dvc.lock``."""
        dependencies = {item["path"]: item.get("md5") for item in entry.get("deps", ())}
        determinants = [address, entry["cmd"], dependencies, entry.get("params", {})]
        text = json.dumps(determinants, sort_keys=True)
        return cls(
            address=address,
            key=sha256(text.encode()).hexdigest(),
            dependencies=tuple(sorted(dependencies)),
            outputs={item["path"]: item.get("md5") for item in entry.get("outs", ())},
            parameters=entry.get("params", {}).get(PARAMS.name, {}),
        )


def repository() -> Path:
    """The clone that the working directory belongs to; of a temporary experiment, its origin."""
    if root := os.environ.get("DVC_ROOT"):
        return Path(root)
    here = Path.cwd()
    clones = (folder for folder in (here, *here.parents) if (folder / "dvc.yaml").is_file())
    return next((folder for folder in clones if ".dvc" not in folder.parts), here)


def tracking_uri() -> str:
    """Where runs are recorded: ``MLFLOW_TRACKING_URI``, or the database of the clone."""
    return os.environ.get("MLFLOW_TRACKING_URI") or f"{SQLITE}{repository() / 'mlflow.db'}"


def prepare() -> Any:
    """Create the database and the experiment, once and before any worker starts.

    Runs whose process is gone, as after ``kill -9``, are marked as killed.

    Returns:
        An ``mlflow.MlflowClient``.
    """
    os.environ.setdefault("MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR", "false")
    os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
    import mlflow

    for noisy in ("alembic", "mlflow"):
        logging.getLogger(noisy).setLevel(logging.ERROR)
    uri = tracking_uri()
    local = uri.startswith(SQLITE)
    if local:
        _make_database(Path(uri.removeprefix(SQLITE)))
    mlflow.set_tracking_uri(uri)
    client = mlflow.MlflowClient(uri)
    if client.get_experiment_by_name(EXPERIMENT) is None:
        folder = Path(uri.removeprefix(SQLITE)).resolve().parent / "mlruns"
        # the kind makes the dashboard open on runs and charts, not on language models
        tags = {"mlflow.experimentKind": "custom_model_development"}
        client.create_experiment(EXPERIMENT, folder.as_uri() if local else None, tags)
    _end_killed(client)
    return client


def _make_database(file: Path) -> None:
    """Make the tables elsewhere: MLflow cannot open a database whose making was interrupted."""
    import mlflow

    if file.exists():
        return
    with TemporaryDirectory(dir=file.parent, prefix=".unfinished-") as folder:
        made = Path(folder) / file.name
        mlflow.MlflowClient(f"{SQLITE}{made}").search_experiments(max_results=1)
        made.replace(file)


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
        _attempt(lambda: run.finish(_running_stage(address)))


def sync(params: Params) -> tuple[list[str], list[str]]:
    """Record the stages in ``dvc.lock`` that no run describes yet.

    Returns:
        The stages recorded now, and those that had been recorded before.

    Raises:
        InputError: there is no ``dvc.lock``, or an output or a parameter is not the one in it.
    """
    from dvc.utils.serialize import load_yaml  # YAML 1.2, where 1e-05 is a number

    lock = Path("dvc.lock")
    if not lock.is_file():
        raise InputError("dvc.lock", "not found: no stage has run here", "dvc repro first")
    document = load_yaml(lock)
    stages = [StageFiles.of(address, entry) for address, entry in document["stages"].items()]
    known = _recorded_keys(prepare())
    missing = [stage for stage in stages if stage.key not in known]
    for stage in missing:
        _check_parameters(stage, params)
        _check_outputs(stage)
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

    @classmethod
    def start(cls, address: str, params: Params, execution: str, replayed: bool) -> "_Run":
        from mlflow.utils.mlflow_tags import MLFLOW_PARENT_RUN_ID

        client = prepare()
        experiment = client.get_experiment_by_name(EXPERIMENT).experiment_id
        parent = _find(client, f"tags.`{EXECUTION_TAG}` = '{execution}'")
        if parent is None:
            parent = _create_parent(client, experiment, params, execution)
        client.update_run(parent, status="RUNNING")
        tags = {
            MLFLOW_PARENT_RUN_ID: parent,
            STAGE_TAG: address,
            PROCESS_TAG: _process(),
            "restored": str(replayed),
        }
        child = client.create_run(experiment, tags=tags, run_name=address)
        run = cls(client, parent, child.info.run_id)
        section = params.model_dump().get(address.partition("@")[0], {})
        _log_params(client, run._id, section)
        return run

    def finish(self, stage: StageFiles) -> None:
        """Record what the stage has written."""
        self._client.set_tag(self._id, KEY_TAG, stage.key)
        outputs = [Path(path) for path in stage.outputs]
        reports = [file for path in outputs if path.parts[0] == "reports" for file in _files(path)]
        for file in reports:
            if file.suffix == ".json":
                _log_metrics(self._client, self._id, _read_metrics(file))
            folder = file.parent.relative_to("reports")
            self._client.log_artifact(self._id, str(file), str(folder) if folder.name else None)
        self._log_models([path for path in outputs if path.suffix == ".safetensors"])
        read = [file for path in stage.dependencies for file in _files(Path(path))]
        for file in [*read, *reports]:
            if file.parts[0] == "reports" and file.suffix == ".json":
                group = "/".join(file.with_suffix("").parts[1:]).removeprefix("metrics/")
                scalars = {
                    f"{group}/{name}": [values[-1]]
                    for name, values in _read_metrics(file).items()
                    if _is_compared(name)
                }
                _log_metrics(self._client, self._parent, scalars)
        self._end("FINISHED")

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
                    log_model(Path(folder), path.stem)

    def fail(self, reason: str) -> None:
        """Record why the stage has no results."""
        self._client.set_tag(self._id, "error", reason[:5000])
        self._end("FAILED")

    def _end(self, status: str) -> None:
        self._client.set_terminated(self._id, status)
        self._client.set_terminated(self._parent, status)


def _process() -> str:
    """Identity of this process among all that have ever run, on any machine."""
    import psutil

    return f"{platform.node()}:{os.getpid()}:{psutil.Process().create_time():.2f}"


def _end_killed(client: Any) -> None:
    """Mark runs of this machine whose process has ended without a word, and their parents."""
    import psutil

    for run in _search(client, f"tags.`{PROCESS_TAG}` != '' and status = 'RUNNING'"):
        node, pid, created = run.data.tags[PROCESS_TAG].rsplit(":", 2)
        try:
            gone = f"{psutil.Process(int(pid)).create_time():.2f}" != created
        except psutil.NoSuchProcess:
            gone = True
        if gone and node == platform.node():
            client.set_terminated(run.info.run_id, "KILLED")
            client.set_terminated(run.data.tags["mlflow.parentRunId"], "KILLED")


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


def flatten(values: Mapping[str, Any], separator: str = ".", prefix: str = "") -> dict[str, Any]:
    """Nested mappings as one level, the names of the levels joined by a separator."""
    flat: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            flat |= flatten(value, separator, f"{prefix}{name}{separator}")
        else:
            flat[f"{prefix}{name}"] = value
    return flat


def _read_metrics(file: Path) -> dict[str, list[float]]:
    """The numbers of a JSON file by name; a list of numbers is a curve over epochs.

    MLflow groups its charts by what stands before the last slash of a name.
    """
    document = read_json(file)
    metrics = {}
    for path, value in flatten(document if isinstance(document, dict) else {}, "/").items():
        name = "/".join(part for part in path.split("/") if part not in ("sub_policies", "curves"))
        values = value if isinstance(value, list) else [value]
        measured = name not in ("version", "seed")
        if measured and values and all(_is_number(item) for item in values):
            metrics[name] = [float(item) for item in values]
    return metrics


def _is_compared(name: str) -> bool:
    *groups, figure = name.split("/")
    return figure in COMPARED and DETAILS.isdisjoint(groups)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _files(path: Path) -> list[Path]:
    if path.is_dir():
        return sorted(file for file in path.rglob("*") if file.is_file())
    return [path] if path.is_file() else []


def _search(client: Any, condition: str) -> Iterator[Any]:
    """Every run that meets a condition, latest first."""
    experiment = client.get_experiment_by_name(EXPERIMENT).experiment_id
    token = None
    while True:
        page = client.search_runs([experiment], condition, page_token=token)
        yield from page
        token = page.token
        if not token:
            return


def _find(client: Any, condition: str) -> str | None:
    run = next(_search(client, condition), None)
    return run.info.run_id if run else None


def _recorded_keys(client: Any) -> set[str]:
    finished = _search(client, f"tags.`{KEY_TAG}` != '' and status = 'FINISHED'")
    return {run.data.tags[KEY_TAG] for run in finished}


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
    run_id = _find(client, f"tags.`{STATE_TAG}` = '{_state(params)}'")
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


def _running_stage(address: str) -> StageFiles:
    """The running stage as DVC is about to write it to ``dvc.lock``."""
    from dvc.repo import Repo
    from dvc.stage.serialize import to_single_stage_lockfile

    with Repo() as repo:
        stage = repo.stage.load_one(name=address)
        stage.save_deps()
        return StageFiles.of(address, to_single_stage_lockfile(stage))


def _check_parameters(stage: StageFiles, params: Params) -> None:
    current = flatten(params.model_dump())
    for name, value in flatten(stage.parameters).items():
        if current.get(name) != value:
            fault = f"is not {value!r}, with which {stage.address} ran"
            raise InputError(f"{PARAMS}: {name}", fault, "dvc repro first")


def _check_outputs(stage: StageFiles) -> None:
    for path, expected in stage.outputs.items():
        file = Path(path)
        if not file.exists():
            raise InputError(path, f"missing, made by the stage {stage.address}", "dvc repro first")
        recorded = file.is_file() and file.parts[0] != "data"
        if recorded and expected not in (None, md5(file.read_bytes()).hexdigest()):
            raise InputError(path, "is not the one that dvc.lock names", "dvc repro first")


def _attempt(action: Callable[[], Value]) -> Value | None:
    try:
        return action()
    except Exception as error:
        reason = " ".join(str(error).split())
        logger.warning("MLflow: not recorded: %s: %s", type(error).__name__, reason)
        return None
