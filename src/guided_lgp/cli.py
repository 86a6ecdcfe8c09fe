"""The command line: the stages of the pipeline, planning, viewing, tracking.

Exit codes: 0 solved or done; 1 no plan found, or a check failed; 2 bad input; 3 an error of the
program itself. Heavy packages are imported by the commands that use them.
"""

import json
import logging
import os
import shutil
import signal
import sys
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from enum import StrEnum
from importlib import import_module
from pathlib import Path
from typing import Annotated, NoReturn

import typer
from typer.exceptions import TyperException

from guided_lgp import __version__
from guided_lgp.documents import read_json
from guided_lgp.errors import InputError, WorkerError
from guided_lgp.paths import EXAMPLES, MODELS, PARAMS, PLANNING
from guided_lgp.search.planners import SEARCHES

app = typer.Typer(
    name="guided-lgp",
    help="Guided sequential manipulation planning: a policy learned from examples proposes the "
    "next grasp or placement, and a nonlinear program finds the motion of the robot.",
    epilog="Example: guided-lgp plan examples/three_boxes.json --goal '(on red green)'",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
STAGES = {
    "generate_scenes": "guided_lgp.experiments.generate_scenes",
    "enumerate_sequences": "guided_lgp.experiments.enumerate_sequences",
    "build_dataset": "guided_lgp.experiments.build_dataset",
    "train_policy": "guided_lgp.experiments.train_policy",
    "train_improved": "guided_lgp.experiments.train_improved",
    "train_relational": "guided_lgp.experiments.train_relational",
    "evaluate_generalization": "guided_lgp.experiments.evaluate_generalization",
    "compare_scalability": "guided_lgp.experiments.compare_scalability",
    "render_reports": "guided_lgp.report.render",
}
"""The module of each stage of dvc.yaml; its ``run(params, root)`` does the work."""

mlflow_app = typer.Typer(
    help="The MLflow dashboard of pipeline runs.",
    epilog="Example: guided-lgp mlflow ui",
    no_args_is_help=True,
)
app.add_typer(mlflow_app, name="mlflow")


class Network(StrEnum):
    """The networks of the hierarchical policy."""

    INSTRUCTION = "instruction"
    GRASP = "grasp"
    PLACE = "place"


class Policy(StrEnum):
    """The trained policies."""

    PAPER = "paper"
    IMPROVED = "improved"
    RELATIONAL = "relational"


_HINTS: Mapping[str | None, str] = {
    "attempts": "--planner best-first goes on after the last attempt",
    "stopped": "--max-nodes raises the limit",
}
"""What a user can do about the reason for which a search ended."""


def _one_of(names: Collection[str]) -> Callable[[str], str]:
    """A parser of an option that accepts some names only."""

    def parse(word: str) -> str:
        if word not in names:
            raise typer.BadParameter(f"{word!r} is not one of {', '.join(names)}")
        return word

    return parse


AsJson = Annotated[
    bool,
    typer.Option("--json", help="Write JSON to standard output.", show_default="text"),
]
ParamsFile = Annotated[
    Path, typer.Option(metavar="FILE", help="YAML file with the parameters of all stages.")
]
NetworkName = Annotated[Network, typer.Argument(help="Which of the three networks to train.")]


@app.callback()
def _options(
    debug: Annotated[
        bool,
        typer.Option("--debug", help="Show the traceback of an error.", show_default="one line"),
    ] = False,
) -> None:
    """Declare for the help what :func:`run_program` acts on, wherever it stands."""


@app.command()
def doctor(as_json: AsJson = False) -> None:
    """Check the installation and say how to mend what is missing.

    Example: guided-lgp doctor
    """
    from guided_lgp.doctor import examine

    findings = examine()
    if as_json:
        typer.echo(json.dumps([asdict(finding) for finding in findings], indent=1))
    else:
        marks = {True: "ok", False: "FAIL"}
        _show(
            ["", "check", "found", "how to mend it"],
            [
                (marks[finding.ok], finding.name, finding.detail, finding.mend)
                for finding in findings
            ],
        )
    if not all(finding.ok for finding in findings):
        raise typer.Exit(1)


@app.command()
def plan(
    scene: Annotated[
        Path, typer.Argument(metavar="SCENE", help="JSON file with tables and boxes.")
    ],
    goal: Annotated[
        list[str],
        typer.Option(
            metavar="GOAL",
            help='What must hold at the end: "(on BOX TABLE)", where TABLE may be another box, or '
            '"(held BOX)". Once for each goal.',
        ),
    ],
    planner: Annotated[
        str,
        typer.Option(
            parser=_one_of(SEARCHES),
            metavar=f"[{'|'.join(SEARCHES)}]",
            help="How to search. "
            + "; ".join(f"{name}: {search.summary}" for name, search in SEARCHES.items())
            + ".",
        ),
    ] = "guided",
    policy: Annotated[
        Policy,
        typer.Option(
            help="Which trained policy. paper: its networks, for 3 boxes and 2 tables; improved: "
            "the same networks, better trained; relational: for any number of boxes and tables."
        ),
    ] = Policy.RELATIONAL,
    max_nodes: Annotated[
        int,
        typer.Option(min=1, metavar="N", help="Give up when the search tree has N nodes."),
    ] = 5000,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write the plan as JSON, with its joint motion in rad and s.",
            show_default="no file",
        ),
    ] = None,
    html: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write a page that plays the motion in the browser.",
            show_default="no file",
        ),
    ] = None,
    execute: Annotated[
        bool,
        typer.Option(
            "--execute",
            help="Carry the plan out in a simulation under gravity.",
            show_default="plan only",
        ),
    ] = False,
    models: Annotated[
        Path,
        typer.Option(
            metavar="FOLDER",
            help="Folder with the trained policies.",
            show_default="those shipped with the package",
        ),
    ] = MODELS,
    params: Annotated[
        Path,
        typer.Option(
            metavar="FILE",
            help="YAML file with the limits of the solver and of the search: the sections bounds "
            "and compare_scalability.",
            show_default="those shipped with the package",
        ),
    ] = PLANNING,
    as_json: AsJson = False,
) -> None:
    """Plan a sequence of actions and the motion for it.

    Ends with 0 if a plan was found, with 1 and the reason if not, with 2 for bad input.

    Example: guided-lgp plan examples/three_boxes.json --goal "(on red green)" --goal "(held blue)"

    Example: guided-lgp plan scene.json --goal "(on red tray)" --html plan.html --execute
    """
    from guided_lgp.logic import parse_objective
    from guided_lgp.params import load_planning
    from guided_lgp.planning import plan as search
    from guided_lgp.scene import load_scene

    for file in filter(None, (out, html)):
        if not file.parent.is_dir():
            raise InputError(str(file), "its folder does not exist", "a file in an existing folder")
    start = load_scene(scene)
    objective = parse_objective(goal)
    with _spinner("planning"):
        result = search(
            start,
            objective,
            planner,
            policy=policy.value,
            models=models,
            params=load_planning(params),
            max_nodes=max_nodes,
            where=str(scene),
        )
    followed = SEARCHES[planner].follows_policy
    times = {name: round(value, 3) for name, value in asdict(result.times).items()}
    statistics = {
        "planner": planner,
        "policy": policy.value if followed else None,
        "weights": _origin(models, MODELS) if followed else None,
        "limits": _origin(params, PLANNING),
        "tree_size": result.tree_size,
        "attempts": 1 + sum(result.reattempts.values()),
        "coarse_sequences": result.coarse_calls,
        "solver_starts": result.solver_starts,
        "path_sequences": result.path_calls,
        "time_s": times,
    }
    summary = {
        "solved": result.solved,
        "actions": [str(action) for action in result.skeleton or ()],
        "explanation": result.explanation,
        "obstacles": [obstacle.document() for obstacle in result.obstacles],
        "statistics": statistics,
    }
    path = result.path
    if path is None or path.trajectory is None:
        if as_json:
            typer.echo(json.dumps(summary, indent=1))
        typer.echo(f"no plan: {result.explanation}", err=True)
        for obstacle in result.obstacles[1:3]:
            typer.echo(f"also infeasible: {obstacle}", err=True)
        if hint := _HINTS.get(result.reason):
            typer.echo(f"hint: {hint}", err=True)
        raise typer.Exit(1)
    physics = None
    if execute:
        from guided_lgp.bounds.execution import execute as simulate

        with _spinner("executing"):
            physics = asdict(simulate(start, objective, path.skeleton, path.trajectory))
        summary["physics"] = physics
    if out:
        from guided_lgp.bounds.plan_file import write_plan

        write_plan(out, start, objective, path, statistics, physics)
    if html:
        from guided_lgp.view.replay import replay_html

        with _spinner("writing the replay"):
            replay_html(path.trajectory, start, html)
    if as_json:
        typer.echo(json.dumps(summary, indent=1))
        return
    _show(["", "action"], [(str(k), str(a)) for k, a in enumerate(path.skeleton, 1)])
    typer.echo(f"motion of {path.trajectory.times[-1]:.1f} s, found in {sum(times.values()):.1f} s")
    guide = (
        f"policy {policy.value}, weights {statistics['weights']}; " if statistics["policy"] else ""
    )
    typer.echo(f"with: {guide}limits {statistics['limits']}")
    if physics is not None:
        fault = physics["fault"] or f"goals: {physics['goals']}"
        typer.echo(f"physics: {'all goals hold' if physics['success'] else fault}")
    for file in filter(None, (out, html)):
        typer.echo(f"written: {file}")


@app.command()
def examples(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Where to put them; it is made if need be.")
    ] = Path("examples"),
) -> None:
    """Copy the example scenes that come with the package.

    Example: guided-lgp examples
    """
    if folder.exists() and any(folder.iterdir()):
        raise InputError(str(folder), "is not empty", "a new folder")
    shutil.copytree(EXAMPLES, folder, dirs_exist_ok=True)
    for scene in sorted(folder.glob("*.json")):
        typer.echo(scene)


@app.command()
def export(
    plan_file: Annotated[
        Path, typer.Argument(metavar="PLAN", help="A plan written by plan --out.")
    ],
    out: Annotated[
        Path,
        typer.Argument(
            metavar="FILE",
            help="FILE.json: JointTrajectory messages, one per action; FILE.csv: a row per point; "
            "no suffix: a folder with a ROS 2 bag.",
        ),
    ],
    speed: Annotated[
        float, typer.Option(metavar="SHARE", help="Share of the robot's speed, in (0, 1].")
    ] = 1.0,
) -> None:
    """Write a plan's motion for a robot's trajectory controllers.

    Example: guided-lgp export plan.json motion.csv --speed 0.5
    """
    from guided_lgp.bounds.plan_file import read_plan
    from guided_lgp.export import export_plan

    export_plan(read_plan(plan_file), out, speed)
    typer.echo(f"written: {out}")


class Format(StrEnum):
    """Files that have a JSON Schema."""

    SCENE = "scene"
    PLAN = "plan"
    PLANNING = "planning"
    PARAMS = "params"


@app.command()
def schema(
    name: Annotated[Format, typer.Argument(help="Which file.")],
) -> None:
    """Print the JSON Schema of a file, for editors and validators.

    Example: guided-lgp schema scene > scene.schema.json
    """
    from guided_lgp.schemas import schema as schema_of

    typer.echo(json.dumps(schema_of(name.value), indent=1))


@app.command()
def view(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="A scene, or a plan written by plan --out, as JSON."),
    ],
    port: Annotated[
        int,
        typer.Option(
            metavar="N", help="TCP port on this machine alone (127.0.0.1).", min=1, max=65535
        ),
    ] = 8080,
) -> None:
    """Show a scene, or a plan in motion, in the browser until Ctrl-C.

    Example: guided-lgp view examples/three_boxes.json

    Example: guided-lgp view plan.json --port 8081
    """
    from guided_lgp.bounds.plan_file import read_plan
    from guided_lgp.scene import load_scene
    from guided_lgp.scene.validate import validate_scene
    from guided_lgp.view.live import view as serve

    found = read_plan(file) if _is_plan(file) else None
    scene = found.scene if found else load_scene(file)
    validate_scene(scene, str(file))
    serve(
        scene,
        found.trajectory if found else None,
        port,
        announce=lambda address: typer.echo(f"{address} (Ctrl-C ends it)"),
    )


@app.command("generate_scenes")
def generate_scenes(params: ParamsFile = PARAMS) -> None:
    """Draw the scenes for training, test and scalability. Writes data/scenes.

    Example: guided-lgp generate_scenes
    """
    _run_stage("generate_scenes", params)


@app.command("enumerate_sequences")
def enumerate_sequences(params: ParamsFile = PARAMS) -> None:
    """Find every shortest feasible sequence of actions in every scene. Writes data/sequences.

    Example: guided-lgp enumerate_sequences
    """
    _run_stage("enumerate_sequences", params)


@app.command("build_dataset")
def build_dataset(params: ParamsFile = PARAMS) -> None:
    """Turn the sequences into samples for training. Writes data/dataset.

    Example: guided-lgp build_dataset
    """
    _run_stage("build_dataset", params)


@app.command("train_policy")
def train_policy(
    network: NetworkName,
    params: ParamsFile = PARAMS,
) -> None:
    """Train one network of the paper's policy. Writes models, reports/training.

    Example: guided-lgp train_policy place
    """
    _run_stage("train_policy", params, network.value)


@app.command("train_improved")
def train_improved(
    network: NetworkName,
    params: ParamsFile = PARAMS,
) -> None:
    """Train one network of the improved policy. Writes models/improved, reports/training/improved.

    Example: guided-lgp train_improved place
    """
    _run_stage("train_improved", params, network.value)


@app.command("train_relational")
def train_relational(params: ParamsFile = PARAMS) -> None:
    """Train the relational policy. Writes models, reports/training.

    Example: guided-lgp train_relational
    """
    _run_stage("train_relational", params)


@app.command("evaluate_generalization")
def evaluate_generalization(params: ParamsFile = PARAMS) -> None:
    """Plan every objective in every test scene (Table I). Writes reports/metrics.

    Example: guided-lgp evaluate_generalization
    """
    _run_stage("evaluate_generalization", params)


@app.command("compare_scalability")
def compare_scalability(params: ParamsFile = PARAMS) -> None:
    """Compare the planners on problems of growing length (Table III). Writes reports/metrics.

    Example: guided-lgp compare_scalability
    """
    _run_stage("compare_scalability", params)


@app.command("render_reports")
def render_reports(params: ParamsFile = PARAMS) -> None:
    """Draw the tables, figures and replays. Writes reports/report.html, reports/report.md.

    Example: guided-lgp render_reports
    """
    _run_stage("render_reports", params)


@mlflow_app.command("ui")
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

    experiment = tracking.prepare().get_experiment_by_name(tracking.EXPERIMENT)
    address = f"http://127.0.0.1:{port}/#/experiments/{experiment.experiment_id}"
    typer.echo(f"MLflow: {address} (Ctrl-C ends it)")
    command = [sys.executable, "-m", "mlflow", "server", "--host", "127.0.0.1"]
    command += ["--port", str(port), "--workers", "1"]
    command += ["--backend-store-uri", tracking.tracking_uri()]
    os.execv(sys.executable, command)


@mlflow_app.command("sync")
def mlflow_sync() -> None:
    """Record the stages that DVC restored from its cache, each once.

    Example: dvc exp apply EXPERIMENT && guided-lgp mlflow sync
    """
    from guided_lgp import tracking
    from guided_lgp.params import load_params

    now, before = tracking.sync(load_params())
    typer.echo(f"recorded {len(now)} stages {' '.join(now)}".strip())
    typer.echo(f"already recorded: {len(before)}")


def _run_stage(stage: str, params_file: Path, *arguments: str) -> None:
    """Check all parameters, then run a stage and record it."""
    from guided_lgp import tracking
    from guided_lgp.params import load_params

    end_with_dvc()
    params = load_params(params_file)
    module = import_module(STAGES[stage])
    with tracking.recorded("@".join([stage, *arguments]), params):
        module.run(params, Path.cwd(), *arguments)


def _origin(path: Path, shipped: Path) -> str:
    """Where weights or limits come from, for the user: the package, unless another was named."""
    return f"shipped with {__version__}" if path == shipped else str(path)


def _show(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> None:
    """Print rows: a table on a terminal, lines with tabs in a pipe."""
    if not sys.stdout.isatty():
        for row in rows:
            typer.echo("\t".join(filter(None, row)))
        return
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(*columns)
    for row in rows:
        table.add_row(*map(Text, row))
    Console().print(table)


def _is_plan(file: Path) -> bool:
    """Whether a file is a plan; what is not is left to the reader of scenes.

    Raises:
        InputError: the file is missing or is not JSON.
    """
    document = read_json(file, "a scene, or a plan written by plan --out")
    return isinstance(document, dict) and "actions" in document


@contextmanager
def _spinner(text: str) -> Iterator[None]:
    """Show on a terminal that something is going on."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console

    with Console(stderr=True).status(text):
        yield


def stage_main(stage: str) -> None:
    """Entry point of the scripts in ``stages/``: run one stage as the command line does."""
    main([stage, *sys.argv[1:]])


def main(arguments: Sequence[str] | None = None) -> None:
    """Run a command."""
    run_program(
        lambda words: app(words, standalone_mode=False),
        sys.argv[1:] if arguments is None else arguments,
    )


def run_program(program: Callable[[list[str]], int | None], arguments: Sequence[str]) -> NoReturn:
    """Run a program; every error becomes one line on standard error and an exit code.

    Args:
        program: is given the words of the command line; what it returns is the exit code.
        arguments: these words, and anywhere among them ``--debug`` for the traceback of an error.
    """
    debug = "--debug" in arguments
    logging.basicConfig(format="%(message)s", level=logging.WARNING)
    logging.getLogger("guided_lgp").setLevel(logging.DEBUG if debug else logging.INFO)
    try:
        code = program([word for word in arguments if word != "--debug"])
    except (InputError, TyperException) as error:
        _fail(error, 2, debug)
    except ModuleNotFoundError as error:
        _fail(_missing(error), 2, debug)
    except KeyboardInterrupt:
        sys.exit(130)
    except Exception as error:
        _fail(error, 3, debug)
    sys.exit(code)


def end_with_dvc() -> None:
    """Have this process end when the DVC that started it, if one did, is gone.

    It ends as on SIGTERM: its workers with it, and the end is recorded.
    """
    from guided_lgp import parallel

    signal.signal(signal.SIGTERM, lambda *_: sys.exit(143))
    if "DVC_STAGE" in os.environ:
        parallel.end_with_parent(os.getppid(), signal.SIGTERM)


_EXTRAS = {
    "PIL": "view",
    "dask": "cluster",
    "distributed": "cluster",
    "gymnasium": "gym",
    "rosbags": "ros",
    "viser": "view",
}
"""The extra that brings a package, where it is not ``pipeline``."""


def _missing(error: ModuleNotFoundError) -> Exception:
    """What to install for a package that the core goes without; a module of our own is a fault."""
    package = (error.name or "").partition(".")[0]
    if package in ("", "guided_lgp"):
        return error
    extra = _EXTRAS.get(package, "pipeline")
    return InputError(
        f"package {package}", "is not installed", f"pip install 'guided-lgp[{extra}]'"
    )


def _fail(error: Exception, code: int, debug: bool) -> NoReturn:
    if debug:
        raise error
    text = error.format_message() if isinstance(error, TyperException) else str(error)
    if code == 3 and not isinstance(error, WorkerError):
        text = f"internal error: {type(error).__name__}: {text}; --debug shows where"
    typer.echo(f"error: {' '.join(text.split())}", err=True)
    sys.exit(code)


if __name__ == "__main__":
    main()
