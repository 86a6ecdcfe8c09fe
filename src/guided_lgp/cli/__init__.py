"""The command line: the stages of the pipeline, planning, viewing, tracking.

Exit codes: 0 solved or done; 1 no plan found, out of time, or a check failed; 2 bad input; 3 an
error of the program itself. Heavy packages are imported by the commands that use them.
"""

from guided_lgp.cli.app import app, main, stage_main
from guided_lgp.cli.running import run_program, within
from guided_lgp.cli.stages import STAGES, end_with_dvc
from guided_lgp.cli.terminal import seconds

__all__ = [
    "STAGES",
    "app",
    "end_with_dvc",
    "main",
    "run_program",
    "seconds",
    "stage_main",
    "within",
]
