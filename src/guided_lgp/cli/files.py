"""``examples export pddl schema view``: scenes and plans as files and pictures."""

import json
import os
from enum import Enum
from pathlib import Path
from typing import Annotated

import typer

from guided_lgp.cli.outputs import destinations, named_files
from guided_lgp.cli.terminal import PlanFile, is_plan, read_scene_or_plan
from guided_lgp.documents import copy_whole, write_text
from guided_lgp.errors import InputError
from guided_lgp.paths import EXAMPLES

app = typer.Typer()


@app.command()
def examples(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Where to put them; it is made if need be.")
    ] = Path("examples"),
) -> None:
    """Copy the example scenes that come with the package.

    Example: guided-lgp examples
    """
    if not _is_free(folder):
        raise InputError(str(folder), "is not an empty folder", "a new folder")
    copy_whole(EXAMPLES, folder)
    for scene in sorted(folder.glob("*.json")):
        typer.echo(scene)


def _is_free(folder: Path) -> bool:
    try:
        return not os.path.lexists(folder) or not any(folder.iterdir())
    except OSError:  # a file, or somebody else's folder
        return False


@app.command()
def export(
    plan_file: PlanFile,
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

    target = out
    if out.suffix:  # a bag is a folder, which is not replaced
        target = destinations({"FILE": out}, [plan_file])["FILE"] or out
    export_plan(read_plan(plan_file), target, speed)
    typer.echo(f"written: {out}")


@app.command()
def pddl(
    scene: Annotated[
        Path, typer.Argument(metavar="SCENE", help="JSON file with tables and boxes.")
    ],
    goal: Annotated[
        list[str], typer.Option(metavar="GOAL", help="What must hold at the end; once for each.")
    ],
    folder: Annotated[
        Path, typer.Option(metavar="FOLDER", help="Where domain.pddl and problem.pddl go.")
    ] = Path(),
) -> None:
    """Write the symbolic part of a task in PDDL, for classical planners.

    Example: guided-lgp pddl examples/three_boxes.json --goal "(on red green)"
    """
    from guided_lgp.logic import parse_objective, validate_objective
    from guided_lgp.logic.pddl import domain_text, problem_text
    from guided_lgp.scene import load_scene

    start, objective = load_scene(scene), parse_objective(goal)
    validate_objective(objective, start.symbols, start.state)
    texts = {
        "domain.pddl": domain_text(start.symbols.domain),
        "problem.pddl": problem_text(start.state, objective, start.symbols),
    }
    for name, text in texts.items():
        if (folder / name).exists():
            destinations({"FOLDER": folder / name}, [scene])
        write_text(folder / name, text)
        typer.echo(f"written: {folder / name}")


class Format(str, Enum):
    """Files that have a JSON Schema."""

    SCENE = "scene"
    ROBOT = "robot"
    PLAN = "plan"
    OBSERVED = "observed"
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
    rerun: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.rrd",
            help="Write a plan's motion for the Rerun viewer instead.",
            show_default="browser",
        ),
    ] = None,
) -> None:
    """Show a scene, or a plan in motion, in the browser until Ctrl-C.

    Example: guided-lgp view examples/three_boxes.json

    Example: guided-lgp view plan.json --port 8081

    Example: guided-lgp view plan.json --rerun plan.rrd && rerun plan.rrd
    """
    from guided_lgp.bounds.plan_file import parse_plan
    from guided_lgp.scene import parse_scene
    from guided_lgp.scene.validate import validate_scene

    document = read_scene_or_plan(file)
    inputs = [file, *named_files(document, file.parent)]
    target = destinations({"--rerun": rerun}, inputs)["--rerun"]
    found = parse_plan(document, str(file)) if is_plan(document) else None
    scene = found.scene if found else parse_scene(document, str(file), file.parent)
    validate_scene(scene, str(file))
    if target is not None:
        if found is None:
            raise InputError(str(file), "has no motion to record", "a plan written by plan --out")
        from guided_lgp.view.recording import write_recording

        write_recording(found.trajectory, scene, target, found.skeleton, found.goals)
        typer.echo(f"written: {rerun}")
        return
    from guided_lgp.view.live import view as serve

    serve(
        scene,
        found.trajectory if found else None,
        port,
        announce=lambda address: typer.echo(f"{address} (Ctrl-C ends it)"),
        skeleton=found.skeleton if found else (),
        objective=found.goals if found else (),
    )
