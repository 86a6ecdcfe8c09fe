"""Where runs are recorded, and what is found there."""

import logging
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from guided_lgp.documents import unfinished_beside
from guided_lgp.errors import InputError

EXPERIMENT = "guided-lgp"
SQLITE = "sqlite:///"
STAGE_TAG = "guided_lgp.stage"
KEY_TAG = "guided_lgp.key"
EXECUTION_TAG = "guided_lgp.execution"
STATE_TAG = "guided_lgp.state"
PROCESS_TAG = "guided_lgp.process"
_HTTP = {"TIMEOUT": "5", "MAX_RETRIES": "1", "BACKOFF_FACTOR": "1"}
"""For a server that cannot be reached: seconds, where MLflow would try for minutes."""


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


@contextmanager
def named_errors() -> Iterator[None]:
    """Say what is wrong with the place where runs are recorded in one line.

    Raises:
        InputError: it cannot be reached, or is no database of MLflow, or a damaged one.
    """
    try:
        yield
    except Exception as error:
        from mlflow import MlflowException  # after prepare() has said how it is imported
        from sqlalchemy.exc import SQLAlchemyError

        if not isinstance(error, (MlflowException, SQLAlchemyError, OSError)):
            raise
        uri = tracking_uri()
        where = uri.removeprefix(SQLITE) if uri.startswith(SQLITE) else "$MLFLOW_TRACKING_URI"
        fault = f"cannot be used: {' '.join(str(error).split())}"
        raise InputError(where, fault, "a server or a database of MLflow") from error


def prepare() -> Any:
    """Create the database and the experiment, once and before any worker starts.

    Runs whose process is gone, as after ``kill -9``, are marked as killed.

    Returns:
        An ``mlflow.MlflowClient``.
    """
    os.environ.setdefault("MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR", "false")
    os.environ.setdefault("MLFLOW_DISABLE_TELEMETRY", "true")
    for name, value in _HTTP.items():
        os.environ.setdefault(f"MLFLOW_HTTP_REQUEST_{name}", value)
    import mlflow

    for noisy in ("alembic", "mlflow", "urllib3"):
        logging.getLogger(noisy).setLevel(logging.CRITICAL)  # errors are ours to say, in one line
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
        try:
            client.create_experiment(EXPERIMENT, folder.as_uri() if local else None, tags)
        except mlflow.MlflowException:  # of another process that was faster
            if client.get_experiment_by_name(EXPERIMENT) is None:
                raise
    _end_killed(client)
    return client


def _make_database(file: Path) -> None:
    """Make the tables elsewhere: MLflow cannot open a database whose making was interrupted."""
    import mlflow

    if file.exists():
        return
    with unfinished_beside(file) as folder:
        made = folder / file.name
        mlflow.MlflowClient(f"{SQLITE}{made}").search_experiments(max_results=1)
        with suppress(FileExistsError):  # another's, in which it may have recorded already
            file.hardlink_to(made)


def process() -> str:
    """Identity of this process among all that have ever run, on any machine."""
    import psutil

    return f"{platform.node()}:{os.getpid()}:{psutil.Process().create_time():.2f}"


def _end_killed(client: Any) -> None:
    """Mark runs of this machine whose process has ended without a word, and their parents."""
    import psutil

    for run in search(client, f"tags.`{PROCESS_TAG}` != '' and status = 'RUNNING'"):
        node, pid, created = run.data.tags[PROCESS_TAG].rsplit(":", 2)
        try:
            gone = f"{psutil.Process(int(pid)).create_time():.2f}" != created
        except psutil.NoSuchProcess:
            gone = True
        if gone and node == platform.node():
            client.set_terminated(run.info.run_id, "KILLED")
            client.set_terminated(run.data.tags["mlflow.parentRunId"], "KILLED")


def search(client: Any, condition: str) -> Iterator[Any]:
    """Every run that meets a condition, latest first."""
    experiment = client.get_experiment_by_name(EXPERIMENT).experiment_id
    token = None
    while True:
        page = client.search_runs([experiment], condition, page_token=token)
        yield from page
        token = page.token
        if not token:
            return


def find(client: Any, condition: str) -> str | None:
    """The latest run that meets a condition, by its id."""
    run = next(search(client, condition), None)
    return run.info.run_id if run else None


def recorded_keys(client: Any) -> set[str]:
    """The keys of the stages that have been recorded."""
    finished = search(client, f"tags.`{KEY_TAG}` != '' and status = 'FINISHED'")
    return {run.data.tags[KEY_TAG] for run in finished}
