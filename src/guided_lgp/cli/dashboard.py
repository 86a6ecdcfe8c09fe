"""``mlflow``: the dashboard of pipeline runs."""

import os
import sys
from typing import Annotated

import typer

app = typer.Typer(
    help="The MLflow dashboard of pipeline runs.",
    epilog="Example: guided-lgp mlflow ui",
    no_args_is_help=True,
)


@app.command("ui")
def mlflow_ui(
    port: Annotated[
        int,
        typer.Option(
            metavar="N", help="TCP port on this machine alone (127.0.0.1).", min=1, max=65535
        ),
    ] = 5000,
) -> None:
    """Serve the dashboard on http://127.0.0.1:5000 until Ctrl-C.

    Example: guided-lgp mlflow ui --port 5001
    """
    from guided_lgp import tracking

    with tracking.named_errors():
        experiment = tracking.prepare().get_experiment_by_name(tracking.EXPERIMENT)
    address = f"http://127.0.0.1:{port}/#/experiments/{experiment.experiment_id}/runs"
    typer.echo(f"MLflow: {address} (Ctrl-C ends it)")
    command = [sys.executable, "-P", "-m", "mlflow", "server", "--host", "127.0.0.1"]
    command += ["--port", str(port), "--workers", "1"]
    command += ["--backend-store-uri", tracking.tracking_uri()]
    os.execv(sys.executable, command)


@app.command("sync")
def mlflow_sync() -> None:
    """Record the stages that DVC restored from its cache, each once.

    Example: dvc exp apply EXPERIMENT && guided-lgp mlflow sync
    """
    from guided_lgp import tracking
    from guided_lgp.params import load_params

    with tracking.named_errors():
        now, before = tracking.sync(load_params())
    typer.echo(f"recorded {len(now)} stages {' '.join(now)}".strip())
    typer.echo(f"already recorded: {len(before)}")
