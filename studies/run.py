"""The stages of studies/dvc.yaml: train CASE, evaluate TABLE, feasibility, render."""

import sys
from pathlib import Path

from guided_lgp.cli import end_with_dvc, run_program
from guided_lgp.errors import InputError


def run(words: list[str]) -> None:
    """Run one stage in the working directory.

    Raises:
        InputError: the words name no stage, or the stage's input is bad.
    """
    end_with_dvc()
    from guided_lgp.studies import evaluate, feasibility, tables, train

    match words:
        case ["train", case]:
            train.train(Path.cwd(), case)
        case ["evaluate", table]:
            evaluate.evaluate(Path.cwd(), table)
        case ["feasibility"]:
            feasibility.run(Path.cwd())
        case ["render"]:
            tables.render(Path.cwd())
        case _:
            stages = "train CASE, evaluate TABLE, feasibility, render"
            raise InputError("stage", f"unknown: {' '.join(words)}", stages)


if __name__ == "__main__":
    run_program(run, sys.argv[1:])
