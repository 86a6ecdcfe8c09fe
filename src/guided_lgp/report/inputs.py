"""What the report is made from: metrics, verdicts, problems and scenes, read and checked."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from guided_lgp.documents import read_json
from guided_lgp.errors import InputError
from guided_lgp.experiments.files import read_table
from guided_lgp.paths import EVALUATION, METRICS, SCENES, SEQUENCES, TRAINING
from guided_lgp.report.style import NETWORKS
from guided_lgp.scene import GeneratedScenes, load_scenes

SCENE_SETS = ("training", "test", *(f"scalability_{setup}" for setup in "abcd"))

Metrics = Mapping[str, Any]

_VERDICTS = (
    "configuration",
    "skeleton",
    "length",
    "feasible",
    "failure_action",
    "failure_constraint",
)
_PROBLEMS = ("configuration", "objective", "unseen", "planner", "outcome")
_RUNS = ("problem", "configuration", "objective", "planner", "solved", "reason", "skeleton")
_MEANS = (
    "tree_size_mean",
    "tree_size_std",
    "plan_length_mean",
    "time_mean_s",
    "time_std_s",
    "symbolic_s",
    "policy_s",
    "coarse_s",
    "path_s",
)


@dataclass(frozen=True)
class Inputs:
    """Everything that the stages before wrote and the report shows."""

    generalization: Metrics
    scalability: Metrics
    """By problem and planner; a figure is None where the planner met the limit of the tree size
    on any of the problems, since a mean over the others would understate it."""
    timing: Metrics
    """As ``scalability``."""
    training: Metrics
    """By network, the report of its training."""
    geometry: Metrics | None
    """Written by ``make bench``, which is not part of the pipeline."""
    scenes: Mapping[str, GeneratedScenes]
    verdicts: pd.DataFrame
    """One row per verdict of the coarse bound, of both splits."""
    problems: pd.DataFrame
    """One row per problem and planner of the test of generalization."""
    runs: pd.DataFrame
    """One row per problem, configuration, objective and planner of the test of scalability."""


def load_inputs(root: Path) -> Inputs:
    """Read the outputs of the earlier stages.

    Args:
        root: the folder of ``dvc.yaml``.

    Raises:
        InputError: a file is missing or damaged; the message names the stage that makes it.
    """
    metrics = root / METRICS
    geometry = metrics / "geometry.json"
    verdicts = [
        _frame(root / SEQUENCES / f"{split}.parquet", "enumerate_sequences", _VERDICTS).assign(
            split=split
        )
        for split in ("training", "test")
    ]
    runs = _frame(root / EVALUATION / "scalability.parquet", "compare_scalability", _RUNS)
    stage = "compare_scalability"
    return Inputs(
        generalization=read_object(metrics / "generalization.json", "evaluate_generalization"),
        scalability=mask_stopped(read_object(metrics / "scalability.json", stage), runs),
        timing=mask_stopped(read_object(metrics / "scalability_timing.json", stage), runs),
        training={
            network: read_object(root / TRAINING / f"{network}.json", f"train_policy@{network}")
            for network in NETWORKS
        },
        geometry=read_object(geometry, "make bench") if geometry.exists() else None,
        scenes={name: load_scenes(root / SCENES / f"{name}.json") for name in SCENE_SETS},
        verdicts=pd.concat(verdicts, ignore_index=True),
        problems=_frame(
            root / EVALUATION / "generalization.parquet", "evaluate_generalization", _PROBLEMS
        ),
        runs=runs,
    )


def mask_stopped(metrics: Metrics, runs: pd.DataFrame) -> Metrics:
    """Metrics by problem and planner without the means of planners stopped at the node limit."""
    limited = runs[runs["reason"] == "stopped"]
    stopped = set(zip(limited["problem"], limited["planner"], strict=True))
    return {
        problem: {
            planner: {
                key: None if (problem, planner) in stopped and key in _MEANS else value
                for key, value in cell.items()
            }
            for planner, cell in planners.items()
        }
        for problem, planners in metrics.items()
    }


def _frame(path: Path, stage: str, columns: Sequence[str]) -> pd.DataFrame:
    return pd.DataFrame(read_table(path, stage, columns), columns=list(columns))


def read_object(path: Path, stage: str) -> Metrics:
    """Read a JSON object that a stage wrote.

    Raises:
        InputError: the file is missing or is not a JSON object.
    """
    remedy = f"the output of stage {stage}"
    document = read_json(path, remedy)
    if not isinstance(document, dict):
        raise InputError(str(path), "is not a JSON object", remedy)
    return document
