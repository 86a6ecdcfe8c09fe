"""MLflow: one parent run per pipeline execution, one child per stage.

A stage records itself when it has finished, from the files it has written: everything in its own
run, and in the parent's what executions are compared by. What DVC restores from its cache is
recorded by :func:`sync` from the same files. Every child carries a key made of all that determines
the stage's results, so what has been recorded is not recorded again. Results never depend on
tracking: its failures become a warning.
"""

from guided_lgp.tracking.database import (
    EXPERIMENT,
    KEY_TAG,
    STAGE_TAG,
    named_errors,
    prepare,
    repository,
    tracking_uri,
)
from guided_lgp.tracking.metrics import SUMMARY, flatten
from guided_lgp.tracking.runs import recorded, sync

__all__ = [
    "EXPERIMENT",
    "KEY_TAG",
    "STAGE_TAG",
    "SUMMARY",
    "flatten",
    "named_errors",
    "prepare",
    "recorded",
    "repository",
    "sync",
    "tracking_uri",
]
