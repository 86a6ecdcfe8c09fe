"""The stages of the cases: families of problems where geometry decides."""

from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

from guided_lgp.cli.alone import alone
from guided_lgp.cli.running import within
from guided_lgp.cli.stages import end_with_dvc
from guided_lgp.cli.terminal import ParamsFile, TimeLimit
from guided_lgp.paths import CASES, PARAMS

app = typer.Typer()

STAGES = {
    "demonstrate": "guided_lgp.cases.demonstrate",
    "train_case": "guided_lgp.cases.train",
    "evaluate_case": "guided_lgp.cases.evaluate",
    "replay_case": "guided_lgp.cases.replay",
    "collect_cases": "guided_lgp.cases.collect",
}
"""The module of each stage of cases/dvc.yaml; its ``run(params, root)`` does the work."""

CaseName = Annotated[str, typer.Option("--case", help="A case of params.yaml.")]


@app.command("demonstrate")
def demonstrate(case: CaseName, params: ParamsFile = PARAMS, timeout: TimeLimit = None) -> None:
    """Find demonstrations of a case by search. Writes data/CASE.

    Example: guided-lgp demonstrate --case rows
    """
    _run_stage("demonstrate", params, timeout, case)


@app.command("train_case")
def train_case(
    case: CaseName,
    seed: Annotated[int, typer.Option(help="Of the training.")],
    params: ParamsFile = PARAMS,
    timeout: TimeLimit = None,
) -> None:
    """Train the policies of a case once. Writes models/CASE.

    Example: guided-lgp train_case --case rows --seed 1
    """
    _run_stage("train_case", params, timeout, case, seed)


@app.command("evaluate_case")
def evaluate_case(
    case: CaseName,
    training: Annotated[str, typer.Option(help="Seed of one, or: rivals.")],
    params: ParamsFile = PARAMS,
    timeout: TimeLimit = None,
) -> None:
    """Plan the test problems of a case. Writes reports/CASE.

    Example: guided-lgp evaluate_case --case rows --training rivals
    """
    _run_stage("evaluate_case", params, timeout, case, training)


@app.command("replay_case")
def replay_case(case: CaseName, params: ParamsFile = PARAMS, timeout: TimeLimit = None) -> None:
    """Draw the longest plan of a case as a 3D page. Writes reports/CASE/replay.html.

    Example: guided-lgp replay_case --case rows
    """
    _run_stage("replay_case", params, timeout, case)


@app.command("collect_cases")
def collect_cases(params: ParamsFile = PARAMS, timeout: TimeLimit = None) -> None:
    """Put the figures of all cases together. Writes reports/cases.json.

    Example: guided-lgp collect_cases
    """
    _run_stage("collect_cases", params, timeout)


def _run_stage(stage: str, params_file: Path, timeout: float | None, *arguments: str | int) -> None:
    """Check the parameters and the case, which comes first, then run a stage, and record it.

    A stage without a case is about all of them.
    """
    from guided_lgp import tracking
    from guided_lgp.cases.declared import declared_case
    from guided_lgp.params import load_params

    end_with_dvc()
    params, root = load_params(params_file), Path.cwd()
    for case in arguments[:1] or params.cases:
        declared_case(params, str(case))
    module = import_module(STAGES[stage])
    name = "@".join(filter(None, [stage, "-".join(map(str, arguments))]))
    address = f"{CASES}:{name}"
    with within(timeout, address), alone(root, address), tracking.recorded(address, params):
        module.run(params, root, *arguments)
