"""The program: its commands, in the order of the help, and its entry points."""

import atexit
import gc
import sys
from collections.abc import Sequence
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from guided_lgp import __version__
from guided_lgp.cli import cases, checks, dashboard, execute, files, plan, replan, stages
from guided_lgp.cli.running import run_program


class _Command(TyperCommand):
    """A command whose help shows values for options that take one: not ``<bool>`` for the rest."""

    def get_params(self, ctx: Any) -> list[Any]:
        return _without_value(super().get_params(ctx))


class _Group(TyperGroup):
    """A group of commands, the same."""

    def get_params(self, ctx: Any) -> list[Any]:
        return _without_value(super().get_params(ctx))


def _without_value(params: list[Any]) -> list[Any]:
    for param in params:
        if getattr(param, "is_flag", False):
            param.metavar = ""
    return params


app = typer.Typer(
    name="guided-lgp",
    cls=_Group,
    help="Guided sequential manipulation planning: a policy learned from examples proposes the "
    "next grasp or placement, and a nonlinear program finds the motion of the robot.",
    epilog="Example: guided-lgp plan examples/three_boxes.json --goal '(on red green)'",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
PIPELINE = "The paper's pipeline"
"""The panel of the help that keeps its stages apart."""
CASES = "Cases beside it"
"""That of the families where geometry decides."""
GROUPS = (plan, execute, replan, files, checks, stages, cases)
for group in GROUPS:
    app.add_typer(group.app)
for group in (*GROUPS, dashboard):
    for command in group.app.registered_commands:
        command.cls = _Command
for module, panel in ((stages, PIPELINE), (cases, CASES)):
    for stage in module.app.registered_commands:
        stage.rich_help_panel = panel
app.add_typer(dashboard.app, name="mlflow", cls=_Group, rich_help_panel=PIPELINE)


def _show_version(asked: bool) -> None:
    if asked:
        typer.echo(f"guided-lgp {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    debug: Annotated[
        bool,
        typer.Option("--debug", help="Show the traceback of an error.", show_default="one line"),
    ] = False,
    version: Annotated[
        bool,
        typer.Option(
            "--version",
            help="Print the version.",
            show_default="off",
            callback=_show_version,
            is_eager=True,
        ),
    ] = False,
) -> None:
    """Declare for the help what :func:`run_program` acts on, wherever it stands."""


def stage_main(stage: str) -> None:
    """Entry point of the scripts in ``stages/``: run one stage as the command line does."""
    main([stage, *sys.argv[1:]])


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command."""
    atexit.register(gc.freeze)  # else cycles are looked for in all that is there, in a sixth second
    run_program(
        lambda words: app(words, standalone_mode=False),
        sys.argv[1:] if arguments is None else arguments,
    )
