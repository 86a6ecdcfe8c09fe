"""``execute``: a plan under gravity."""

import json
from dataclasses import asdict
from typing import Annotated

import typer

from guided_lgp.cli.terminal import AsJson, PlanFile, one_of, spinner
from guided_lgp.errors import InputError

app = typer.Typer()


@app.command()
def execute(
    plan_file: PlanFile,
    grip: Annotated[
        str,
        typer.Option(
            parser=one_of(("fixed", "friction")),
            metavar="[fixed|friction]",
            help="Boxes are rigid in the hand, or held by the friction of the fingertips.",
        ),
    ] = "fixed",
    friction: Annotated[
        float, typer.Option(metavar="MU", help="Coefficient of friction, from 0.1 to 2.")
    ] = 0.64,
    force: Annotated[
        float | None,
        typer.Option(
            metavar="N",
            help="Force of the fingers, from 1 to 1000.",
            show_default="what each grasp wants",
        ),
    ] = None,
    noise: Annotated[
        float,
        typer.Option(
            metavar="M",
            help="Standard deviation along x and y by which arms misplace boxes, up to 0.05.",
            show_default="0: none",
        ),
    ] = 0.0,
    seed: Annotated[
        int, typer.Option(min=0, metavar="N", help="Of that noise.", show_default="0")
    ] = 0,
    closed_loop: Annotated[
        bool,
        typer.Option(
            "--closed-loop",
            help="Look after each action where everything is, and go on from there.",
            show_default="open loop",
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Verify a plan and carry it out in a simulation under gravity.

    Ends with 0 if all goals hold and every box is where the plan says, else with 1 and the reason.

    Example: guided-lgp execute plan.json --grip friction --friction 0.6

    Example: guided-lgp execute plan.json --noise 0.008 --closed-loop
    """
    from guided_lgp.bounds.execution import Conditions
    from guided_lgp.bounds.execution import execute as simulate
    from guided_lgp.bounds.execution.forces import chosen_grips, loosest
    from guided_lgp.bounds.goals import GoalTerms
    from guided_lgp.bounds.plan_file import read_plan
    from guided_lgp.bounds.verify import verify_path
    from guided_lgp.clearance import clearance_of
    from guided_lgp.replanning import Course, follow
    from guided_lgp.scene.world import world_of

    conditions = Conditions(grip, friction, force, noise, seed)  # type: ignore[arg-type]
    course = Course.of(read_plan(plan_file))
    scene, skeleton, trajectory = course.scene, course.skeleton, course.trajectory
    goals = GoalTerms.of(course.objective, scene.symbols.domain)
    with spinner("verifying"):
        fault = verify_path(world_of(scene), skeleton, trajectory, goals).violation
        if fault is None and conditions.grip == "friction":
            worst = loosest(chosen_grips(scene, skeleton, trajectory))
            fault = None if worst is None else worst.fault
    if fault is not None:
        raise InputError(str(plan_file), f"is not carried out: {fault}", "a plan that is verified")
    clearance = clearance_of(scene, skeleton, trajectory)
    decisions: tuple[str, ...] = ()
    with spinner("executing"):
        if closed_loop:
            followed = follow(course, conditions)
            report, decisions = followed.report, followed.decisions
        else:
            report = simulate(scene, course.objective, skeleton, trajectory, conditions)
    if as_json:
        document = asdict(report) | {"clearance": asdict(clearance), "decisions": decisions}
        typer.echo(json.dumps(document, indent=1))
    else:
        for decision in decisions:
            typer.echo(decision)
        typer.echo(f"smallest distance: {clearance}")
        outcome = "all goals hold" if report.success else report.fault or f"goals: {report.goals}"
        typer.echo(f"physics: {outcome}, boxes at most {1000 * report.drift:.1f} mm off")
    if not report.success:
        raise typer.Exit(1)
