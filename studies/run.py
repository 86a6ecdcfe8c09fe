"""The stages of studies/dvc.yaml: train CASE, evaluate TABLE, feasibility, render."""

import logging
import sys
from pathlib import Path

from guided_lgp.errors import InputError
from guided_lgp.experiments import feasibility, studies
from guided_lgp.report.studies import render

logging.basicConfig(format="%(message)s", level=logging.INFO)
try:
    match sys.argv[1:]:
        case ["train", case]:
            studies.train(Path.cwd(), case)
        case ["evaluate", table]:
            studies.evaluate(Path.cwd(), table)
        case ["feasibility"]:
            feasibility.run(Path.cwd())
        case ["render"]:
            render(Path.cwd())
        case words:
            raise InputError(
                " ".join(words), "is no stage", "train CASE, evaluate TABLE, feasibility, render"
            )
except InputError as error:
    print(f"error: {error}", file=sys.stderr)
    sys.exit(2)
