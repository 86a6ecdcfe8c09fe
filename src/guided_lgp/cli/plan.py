"""``plan``: one task."""

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from guided_lgp import __version__
from guided_lgp.cli.outputs import destinations, named_files
from guided_lgp.cli.running import complain, lasting_imports
from guided_lgp.cli.terminal import (
    AsJson,
    PlanningTime,
    WishedClearance,
    is_plan,
    one_of,
    read_scene_or_plan,
    show,
    spinner,
)
from guided_lgp.documents import STANDARD_OUTPUT
from guided_lgp.domains import domain_names
from guided_lgp.errors import InputError
from guided_lgp.paths import MODELS, PLANNING
from guided_lgp.policy.registry import DEFAULT_POLICY, POLICIES
from guided_lgp.search.planners import DEFAULT_SEARCH, SEARCHES

if TYPE_CHECKING:
    from guided_lgp.planning import PlanningResult

app = typer.Typer()

_HINTS: Mapping[str | None, str] = {
    "attempts": "--planner complete goes on after the last attempt",
    "max_tree_size": "--max-nodes raises the limit",
    "max_sequences": "max_sequences in the file of --params raises the limit",
    "max_paths": "max_paths in the file of --params raises the limit",
    "max_seconds": "--timeout raises the limit",
}
"""What a user can do about the limit at which a search ended."""


@app.command()
def plan(
    scene: Annotated[
        Path, typer.Argument(metavar="SCENE", help="JSON file with tables and boxes.")
    ],
    goal: Annotated[
        list[str],
        typer.Option(
            metavar="GOAL",
            help='What must hold at the end: "(on BOX TABLE)", where TABLE may be another box, '
            '"(held BOX)", "(heldby BOX GRIPPER)", "(empty GRIPPER)", "(handempty)", "(at BOX X Y '
            'Z YAW)", "(in BOX TABLE X0 Y0 X1 Y1)", a region of the top, "(posture GRIPPER JOINT '
            '...)", where the arm ends, or "(upright BOX)" on the way. Once for each goal.',
            show_default="none: only with --skeleton",
        ),
    ] = [],  # noqa: B006
    planner: Annotated[
        str,
        typer.Option(
            parser=one_of(SEARCHES),
            metavar="PLANNER",
            help="How to search. "
            + "; ".join(f"{name}: {search.summary}" for name, search in SEARCHES.items())
            + ".",
        ),
    ] = DEFAULT_SEARCH,
    policy: Annotated[
        str,
        typer.Option(
            parser=one_of(POLICIES),
            metavar="POLICY",
            help="Which trained policy. "
            + "; ".join(f"{name}: {declared.summary}" for name, declared in POLICIES.items())
            + ".",
        ),
    ] = DEFAULT_POLICY,
    domain: Annotated[
        str | None,
        typer.Option(
            parser=one_of(domain_names()),
            metavar="DOMAIN",
            help=f"Whose instructions the plan may have: {' or '.join(domain_names())}.",
            show_default="that of SCENE; or else the paper's, and more where a goal needs them",
        ),
    ] = None,
    skeleton: Annotated[
        str | None,
        typer.Option(
            metavar="ACTIONS|FILE",
            help="Actions with which the plan begins: as text, or in a plan or a file with one a "
            "line. If the goals hold after them, or there are none, only their motion is planned.",
            show_default="none",
        ),
    ] = None,
    candidates: Annotated[
        int,
        typer.Option(
            min=1,
            metavar="N",
            help="Look for up to N plans, also of the same actions by other hands or at other "
            "places, and take the one of the fewest actions, of several the fastest; of those "
            "alike the lighter grip.",
        ),
    ] = 1,
    one_at_a_time: Annotated[
        bool,
        typer.Option(
            "--no-coordinate",
            help="Move one arm at a time, and home after each action.",
            show_default="all at once, with limited jerk; actions of two arms may change places, "
            "unless they are given",
        ),
    ] = False,
    clearance: WishedClearance = 0.01,
    max_nodes: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="N",
            help="Give up when the search tree has N nodes.",
            show_default="the limit in --params",
        ),
    ] = None,
    timeout: PlanningTime = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write the plan as JSON, with its joint motion in rad and s; - is standard "
            "output.",
            show_default="no file",
        ),
    ] = None,
    html: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write a page that plays the motion in the browser; - is standard output.",
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
    with lasting_imports():
        from guided_lgp.logic import parse_objective
        from guided_lgp.params import load_planning
        from guided_lgp.planning import plan as search
        from guided_lgp.scene import parse_scene

    document = read_scene_or_plan(scene)
    inputs = [scene, params, models, *named_files(document, scene.parent)]
    inputs += [Path(skeleton)] if skeleton else []
    files = destinations({"--out": out, "--html": html}, inputs)
    piped = STANDARD_OUTPUT in files.values()
    if piped and as_json:
        raise InputError("--json", "needs standard output, and so does a file named -")
    if is_plan(document):
        raise InputError(
            str(scene), "is a plan, not a scene", "a scene; view and export take plans"
        )
    start = parse_scene(document, str(scene), scene.parent)
    objective = parse_objective(goal)
    with spinner("planning"):
        result = search(
            start,
            objective,
            planner,
            policy=policy,
            models=models,
            params=load_planning(params),
            max_nodes=max_nodes,
            timeout=timeout,
            domain=domain,
            skeleton=skeleton or (),
            candidates=candidates,
            coordinate=not one_at_a_time,
            clearance=clearance,
            where=str(scene),
        )
    start, objective = result.scene, result.objective
    followed = SEARCHES[planner].follows_policy
    times = {name: round(value, 3) for name, value in asdict(result.times).items()}
    statistics = {
        "planner": planner,
        "policy": policy if followed else None,
        "weights": _origin(models, MODELS) if followed else None,
        "limits": _origin(params, PLANNING),
        "domain": start.domain,
        "tree_size": result.tree_size,
        "attempts": 1 + sum(result.reattempts.values()),
        "coarse_sequences": result.coarse_calls,
        "solver_starts": result.solver_starts,
        "path_sequences": result.path_calls,
        "time_s": times,
        "clearance": result.clearance and {"wished": clearance, **asdict(result.clearance)},
    }
    summary = {
        "solved": result.solved,
        "actions": [str(action) for action in result.skeleton or ()],
        "reason": result.reason,
        "explanation": result.explanation,
        "finding": None if result.finding is None else result.finding.document(),
        "obstacles": [obstacle.document() for obstacle in result.obstacles],
        "statistics": statistics,
    }
    path = result.path
    if path is None or path.trajectory is None:
        _say_why_not(result, summary, as_json)
        raise typer.Exit(1)
    physics = None
    if execute:
        from guided_lgp.bounds.execution import execute as simulate

        with spinner("executing"):
            physics = asdict(simulate(start, objective, path.skeleton, path.trajectory))
        summary["physics"] = physics
    if plan_file := files["--out"]:
        from guided_lgp.bounds.plan_file import write_plan

        write_plan(plan_file, start, objective, path, statistics, physics)
    if page := files["--html"]:
        from guided_lgp.view.replay import replay_html

        with spinner("writing the replay"):
            replay_html(path.trajectory, start, page, path.skeleton, objective)
    if as_json:
        typer.echo(json.dumps(summary, indent=1))
        return
    if piped:
        return
    if path.skeleton:
        show(["", "action"], [(str(k), str(a)) for k, a in enumerate(path.skeleton, 1)])
        duration = path.trajectory.times[-1]
        typer.echo(f"motion of {duration:.1f} s, found in {sum(times.values()):.1f} s")
        guide = (
            f"policy {policy}, weights {statistics['weights']}; " if statistics["policy"] else ""
        )
        typer.echo(f"with: {guide}limits {statistics['limits']}")
        typer.echo(f"smallest distance: {result.clearance}")
    else:
        typer.echo("the goals hold already")
    if physics is not None:
        fault = physics["fault"] or f"goals: {physics['goals']}"
        typer.echo(f"physics: {'all goals hold' if physics['success'] else fault}")
    for file in filter(None, (out, html)):
        typer.echo(f"written: {file}")


def _say_why_not(result: "PlanningResult", summary: Mapping[str, object], as_json: bool) -> None:
    if as_json:
        typer.echo(json.dumps(summary, indent=1))
    complain(f"no plan: {result.explanation}")
    for obstacle in result.obstacles[1:3]:
        complain(f"also infeasible: {obstacle}")
    hints = [result.finding.help] if result.finding is not None else []
    for hint in (*hints, _HINTS.get(result.reason)):
        if hint:
            complain(f"hint: {hint}")


def _origin(path: Path, shipped: Path) -> str:
    """Where weights or limits come from, for the user: the package, unless another was named."""
    return f"shipped with {__version__}" if path == shipped else str(path)
