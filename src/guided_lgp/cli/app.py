"""The program: its commands, in the order of the help, and its entry points."""

import sys
from collections.abc import Sequence
from typing import Annotated

import typer

from guided_lgp.cli import checks, dashboard, files, plan, stages
from guided_lgp.cli.running import run_program

app = typer.Typer(
    name="guided-lgp",
    help="Guided sequential manipulation planning: a policy learned from examples proposes the "
    "next grasp or placement, and a nonlinear program finds the motion of the robot.",
    epilog="Example: guided-lgp plan examples/three_boxes.json --goal '(on red green)'",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
for group in (checks, plan, files, stages):
    app.add_typer(group.app)
app.add_typer(dashboard.app, name="mlflow")


@app.callback()
def _options(
    debug: Annotated[
        bool,
        typer.Option("--debug", help="Show the traceback of an error.", show_default="one line"),
    ] = False,
) -> None:
    """Declare for the help what :func:`run_program` acts on, wherever it stands."""


def stage_main(stage: str) -> None:
    """Entry point of the scripts in ``stages/``: run one stage as the command line does."""
    main([stage, *sys.argv[1:]])


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command."""
    run_program(
        lambda words: app(words, standalone_mode=False),
        sys.argv[1:] if arguments is None else arguments,
    )
