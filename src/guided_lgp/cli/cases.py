"""The stages of the cases: families of problems where geometry decides."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from guided_lgp.cli.alone import alone
from guided_lgp.cli.running import within
from guided_lgp.cli.stages import end_with_dvc
from guided_lgp.cli.terminal import ParamsFile, TimeLimit
from guided_lgp.paths import CASES, PARAMS

if TYPE_CHECKING:
    from guided_lgp.params import Params

app = typer.Typer()

CaseName = Annotated[str, typer.Option("--case", help="A case of params.yaml.")]


@app.command("demonstrate")
def demonstrate(case: CaseName, params: ParamsFile = PARAMS, timeout: TimeLimit = None) -> None:
    """Find demonstrations of a case by search. Writes data/CASE.

    Example: guided-lgp demonstrate --case rows
    """
    from guided_lgp.cases import demonstrate

    _run(
        f"demonstrate@{case}",
        case,
        lambda root, read: demonstrate.run(read, root, case),
        params,
        timeout,
    )


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
    from guided_lgp.cases import train

    _run(
        f"train_case@{case}-{seed}",
        case,
        lambda root, read: train.run(read, root, case, seed),
        params,
        timeout,
    )


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
    from guided_lgp.cases import evaluate

    def work(root: Path, read: "Params") -> None:
        evaluate.run(read, root, case, training)

    _run(f"evaluate_case@{case}-{training}", case, work, params, timeout)


@app.command("replay_case")
def replay_case(case: CaseName, params: ParamsFile = PARAMS, timeout: TimeLimit = None) -> None:
    """Draw the longest plan of a case as a 3D page. Writes reports/CASE/replay.html.

    Example: guided-lgp replay_case --case rows
    """
    from guided_lgp.cases import replay

    _run(
        f"replay_case@{case}",
        case,
        lambda root, read: replay.run(read, root, case),
        params,
        timeout,
    )


@app.command("collect_cases")
def collect_cases(params: ParamsFile = PARAMS, timeout: TimeLimit = None) -> None:
    """Put the figures of all cases together. Writes reports/cases.json.

    Example: guided-lgp collect_cases
    """
    from guided_lgp.cases import collect

    _run("collect_cases", None, lambda root, read: collect.run(read, root), params, timeout)


def _run(
    stage: str,
    case: str | None,
    work: "Callable[[Path, Params], None]",
    params_file: Path,
    timeout: float | None,
) -> None:
    """Check the parameters and the case, all of them for None, run a stage, and record it."""
    from guided_lgp import tracking
    from guided_lgp.cases.declared import declared_case
    from guided_lgp.params import load_params

    end_with_dvc()
    params, root = load_params(params_file), Path.cwd()
    for name in params.cases if case is None else [case]:
        declared_case(params, name)
    address = f"{CASES}:{stage}"
    with within(timeout, address), alone(root, address), tracking.recorded(address, params):
        work(root, params)
