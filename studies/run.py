"""The stages of studies/dvc.yaml: train CASE, evaluate TABLE, feasibility, render.

``--timeout SECONDS`` behind them ends a stage that takes longer.
"""

import sys
from pathlib import Path

from guided_lgp.cli import end_with_dvc, run_program, seconds, within
from guided_lgp.cli.alone import alone
from guided_lgp.errors import InputError


def run(words: list[str]) -> None:
    """Run one stage in the working directory, once at a time in a clone.

    Raises:
        InputError: the words name no stage, the stage's input is bad, or another process runs it.
    """
    end_with_dvc()
    match words:
        case [*stage, "--timeout", word]:
            limit: float | None = seconds(word)
        case stage:
            limit = None
    name = " ".join(stage)
    with within(limit, name), alone(Path.cwd(), f"studies {name}"):
        _run(stage, Path.cwd())


def _run(stage: list[str], root: Path) -> None:
    from guided_lgp.studies import evaluate, feasibility, tables, train

    match stage:
        case ["train", case]:
            train.train(root, case)
        case ["evaluate", table]:
            evaluate.evaluate(root, table)
        case ["feasibility"]:
            feasibility.run(root)
        case ["render"]:
            tables.render(root)
        case _:
            stages = "train CASE, evaluate TABLE, feasibility, render"
            raise InputError("stage", f"unknown: {' '.join(stage)}", stages)


if __name__ == "__main__":
    run_program(run, sys.argv[1:])
