"""What the report is made from: metrics, verdicts, problems and scenes, read and checked."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from guided_lgp.documents import read_json
from guided_lgp.errors import InputError
from guided_lgp.experiments.problems import PROBLEMS, ProblemClass
from guided_lgp.paths import EVALUATION, METRICS, REPORTS, SCENES, SEQUENCES, TRAINING
from guided_lgp.report.style import NETWORKS
from guided_lgp.scene import GeneratedScenes, Scene, load_scenes
from guided_lgp.search.planners import TABLE_1
from guided_lgp.tables import read_table

Metrics = Mapping[str, Any]

_VERDICTS = (
    "configuration",
    "skeleton",
    "length",
    "feasible",
    "failure_action",
    "failure_constraint",
)
_OUTCOMES = (
    *("configuration", "objective", "unseen", "planner"),
    *("outcome", "length", "policy_calls"),
)
_RUNS = (
    *("problem", "configuration", "objective", "planner"),
    *("solved", "reason", "skeleton"),
)
_MEANS = (
    "tree_size_mean",
    "tree_size_std",
    "plan_length_mean",
    "expansions_mean",
    "policy_calls_mean",
    "coarse_calls_mean",
    "path_calls_mean",
    "time_mean_s",
    "time_std_s",
    "symbolic_s",
    "policy_s",
    "coarse_s",
    "path_s",
)
_TRAINING = {
    "paper": {name: (f"{name}.json", f"train_policy@{name}") for name in NETWORKS},
    "improved": {name: (f"improved/{name}.json", f"train_improved@{name}") for name in NETWORKS},
    "relational": {"relational": ("relational.json", "train_relational")},
}
"""By policy and network: the report of its training, and the stage that writes it."""


@dataclass(frozen=True)
class Inputs:
    """Everything that the stages before wrote and the report shows."""

    generalization: Metrics
    scalability: Metrics
    """By problem and planner; a figure is None where the planner met the limit of the tree size
    on any of the problems, since a mean over the others would understate it."""
    timing: Metrics
    """As ``scalability``."""
    training: Mapping[str, Mapping[str, Metrics]]
    """By policy and network, the report of its training."""
    geometry: Metrics | None
    """Written by ``make bench``, which is not part of the pipeline."""
    spread: Metrics | None
    """Written by ``make study``, which is not part of the pipeline either: by policy, search, set
    of objectives and figure, one value per draw of the training objectives."""
    scenes: Mapping[str, GeneratedScenes]
    verdicts: pd.DataFrame
    """One row per verdict of the coarse bound, of both splits."""
    problems: pd.DataFrame
    """One row per problem and planner of the test of generalization."""
    runs: pd.DataFrame
    """One row per problem, configuration, objective and planner of the test of scalability."""

    @property
    def setups(self) -> list[str]:
        """The setups of the test of scalability."""
        return _setups(self.scalability)

    @property
    def configurations(self) -> Mapping[str, Scene]:
        """The scenes of training and test by name."""
        return {
            scene.name: scene for name in ("training", "test") for scene in self.scenes[name].scenes
        }


def load_inputs(root: Path) -> Inputs:
    """Read the outputs of the earlier stages.

    Args:
        root: the folder of ``dvc.yaml``.

    Raises:
        InputError: a file is missing or damaged; the message names the stage that makes it.
    """
    metrics = root / METRICS
    geometry, spread = metrics / "geometry.json", root / REPORTS / "studies" / "spread.json"
    verdicts = [
        _frame(root / SEQUENCES / f"{split}.parquet", "enumerate_sequences", _VERDICTS).assign(
            split=split
        )
        for split in ("training", "test")
    ]
    generalization = read_object(metrics / "generalization.json", "evaluate_generalization")
    evaluated = {variant.policy for name, variant in TABLE_1.items() if name in generalization}
    stage = "compare_scalability"
    runs = _frame(root / EVALUATION / "scalability.parquet", stage, _RUNS)
    scalability = mask_stopped(read_object(metrics / "scalability.json", stage), runs)
    return Inputs(
        generalization=generalization,
        scalability=scalability,
        timing=mask_stopped(read_object(metrics / "scalability_timing.json", stage), runs),
        training={
            policy: {
                network: read_object(root / TRAINING / file, stage)
                for network, (file, stage) in _TRAINING[policy].items()
            }
            for policy in _TRAINING
            if policy in evaluated
        },
        geometry=read_object(geometry, "make bench") if geometry.exists() else None,
        spread=read_object(spread, "make study") if spread.exists() else None,
        scenes={
            name: load_scenes(root / SCENES / f"{name}.json")
            for name in (
                "training",
                "test",
                *(f"scalability_{setup}" for setup in _setups(scalability)),
            )
        },
        verdicts=pd.concat(verdicts, ignore_index=True),
        problems=_frame(
            root / EVALUATION / "generalization.parquet", "evaluate_generalization", _OUTCOMES
        ),
        runs=runs,
    )


def sub_policies(inputs: Inputs) -> Iterator[tuple[str, str, Metrics]]:
    """Policy, name and report of every sub-policy."""
    for policy, networks in inputs.training.items():
        for network, report in networks.items():
            for name, trained in report["sub_policies"].items():
                yield policy, network if network == name else f"{network}: {name}", trained


def compared(scalability: Metrics) -> list[ProblemClass]:
    """The problems of the metrics, in the order of Table II, family e last."""
    return [problem for problem in PROBLEMS if problem.name in scalability]


def all_solved(cell: Metrics) -> bool:
    """Whether a planner, in a cell of the metrics, solved every problem that it was given."""
    return bool(cell["problems_solved"] == cell["problems"])


def _setups(scalability: Metrics) -> list[str]:
    return list(dict.fromkeys(problem.setup for problem in compared(scalability)))


def mask_stopped(metrics: Metrics, runs: pd.DataFrame) -> Metrics:
    """Metrics by problem and planner without the means of planners stopped at the node limit."""
    limited = runs[runs["reason"] == "max_tree_size"]
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
