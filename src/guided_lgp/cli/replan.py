"""``replan``: going on with a plan from what is observed."""

import json
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from guided_lgp.cli.outputs import destinations
from guided_lgp.cli.terminal import AsJson, PlanFile, PlanningTime, WishedClearance, show, spinner

app = typer.Typer()


@app.command()
def replan(
    plan_file: PlanFile,
    observed: Annotated[
        Path,
        typer.Option(
            metavar="FILE", help="JSON file with joints, poses of boxes, and what is held."
        ),
    ],
    after: Annotated[
        int,
        typer.Option(
            min=0,
            metavar="N",
            help="How many actions have been carried out.",
            show_default="0: none yet",
        ),
    ] = 0,
    clearance: WishedClearance = 0.01,
    timeout: PlanningTime = None,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write the plan from here on.", show_default="no file"),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Go on with a plan from what is observed: keep its rest, repair it, or plan anew.

    Ends with 0 and says which, with 1 and the reason if no plan goes on from here.

    Example: guided-lgp replan plan.json --after 2 --observed state.json --out rest.json
    """
    from guided_lgp.bounds.plan_file import read_plan, write_plan
    from guided_lgp.observed import read_observed
    from guided_lgp.replanning import Course
    from guided_lgp.replanning import replan as go_on

    target = destinations({"--out": out}, [plan_file, observed])["--out"]
    course, seen = Course.of(read_plan(plan_file)), read_observed(observed)
    with spinner("planning"):
        found = go_on(
            course, after, seen, clearance=clearance, timeout=timeout, where=str(observed)
        )
    actions = [] if found.path is None else list(map(str, found.path.skeleton))
    if as_json:
        how = None if found.path is None else found.how
        document = {
            "how": how,
            "actions": actions,
            "explanation": found.explanation,
            "clearance": found.clearance and asdict(found.clearance),
        }
        typer.echo(json.dumps(document, indent=1))
    if found.path is None:
        typer.echo(f"no plan: {found.explanation}", err=True)
        raise typer.Exit(1)
    if target is not None:
        write_plan(target, found.scene, found.objective, found.path, {"replanned": found.how})
    if not as_json:
        show(["", "action"], [(str(k), action) for k, action in enumerate(actions, 1)])
        typer.echo(f"the rest of the plan: {found.how}")
        typer.echo(f"smallest distance: {found.clearance}")
