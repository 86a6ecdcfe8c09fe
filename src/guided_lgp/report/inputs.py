"""What the report is made from: metrics, verdicts, problems and scenes, read and checked."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
from pydantic import TypeAdapter

from guided_lgp.experiments.outcomes import BOUND_COUNTS, GENERALIZATION, OUTCOMES, SCALABILITY
from guided_lgp.experiments.problems import PROBLEMS, ProblemClass
from guided_lgp.logic import format_objective, one_goal_objectives, two_goal_objectives
from guided_lgp.paths import EVALUATION, METRICS, REPORTS, SCENES, SEQUENCES, TRAINING
from guided_lgp.policy.registry import TRAINED_POLICIES
from guided_lgp.report import metrics as shapes
from guided_lgp.report.metrics import Metrics, read_evaluations, read_metrics
from guided_lgp.scene import GeneratedScenes, Scene, load_scenes
from guided_lgp.search.planners import TABLE_1, TABLE_3
from guided_lgp.sequences import read_verdicts
from guided_lgp.tables import columns_of, read_columns

_VERDICTS = (
    "configuration",
    "skeleton",
    "length",
    "feasible",
    "failure_action",
    "failure_constraint",
)
_OUTCOMES = columns_of(
    GENERALIZATION,
    (
        *("configuration", "objective", "unseen", "planner"),
        *("outcome", "length", "policy_calls", *BOUND_COUNTS),
    ),
    ("configuration", "objective", "unseen", "planner", "outcome"),
)
_RUNS = columns_of(
    SCALABILITY,
    (
        *("problem", "configuration", "objective", "planner"),
        *("solved", "reason", "skeleton"),
    ),
    ("problem", "configuration", "objective", "planner", "solved"),
)
_MEANS = (
    "tree_size_mean",
    "tree_size_std",
    "plan_length_mean",
    "expansions_mean",
    "policy_calls_mean",
    "coarse_calls_mean",
    "infeasible_calls_mean",
    "failed_candidates_mean",
    "path_calls_mean",
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
    training: Mapping[str, Mapping[str, Metrics]]
    """By policy and network, the report of its training."""
    geometry: Metrics | None
    """Written by ``make bench``, which is not part of the pipeline."""
    spread: Metrics | None
    """Written by ``make study``, which is not part of the pipeline either: by policy, search, set
    of objectives and figure, one value per draw of the training objectives."""
    cases: Metrics | None
    """Written by ``make cases``, which is not part of it either: by case, size and planner ..."""
    cases_compared: Metrics | None
    """... and by case and size, the policy against the best rival."""
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
    generalization, scalability, timing = read_evaluations(root)
    evaluated = {variant.policy for name, variant in TABLE_1.items() if name in generalization}
    scenes = {
        name: load_scenes(root / SCENES / f"{name}.json")
        for name in (
            "training",
            "test",
            *(f"scalability_{setup}" for setup in _setups(scalability)),
        )
    }
    runs = _runs(root, scenes, scalability)
    return Inputs(
        generalization=generalization,
        scalability=mask_stopped(scalability, runs),
        timing=mask_stopped(timing, runs),
        training={
            name: {
                network: read_metrics(
                    root / TRAINING / declared.folder / f"{network}.json",
                    declared.address(network),
                    shapes.TRAINING,
                )
                for network in declared.networks
            }
            for name, declared in TRAINED_POLICIES.items()
            if name in evaluated
        },
        geometry=_optional(geometry, "make bench", shapes.GEOMETRY),
        spread=_optional(spread, "make study", shapes.SPREAD),
        cases=_optional(root / REPORTS / "cases.json", "make cases", shapes.CASES),
        cases_compared=_optional(
            root / REPORTS / "cases_compared.json", "make cases", shapes.COMPARED
        ),
        scenes=scenes,
        verdicts=_verdicts(root, scenes),
        problems=_problems(root, scenes["test"]),
        runs=runs,
    )


def _optional(path: Path, stage: str, shape: TypeAdapter[Any]) -> Metrics | None:
    return read_metrics(path, stage, shape) if path.exists() else None


def _verdicts(root: Path, scenes: Mapping[str, GeneratedScenes]) -> pd.DataFrame:
    frames = []
    for split in ("training", "test"):
        path = root / SEQUENCES / f"{split}.parquet"
        table = read_verdicts(path, *_VERDICTS, of=scenes[split].scenes)
        frames.append(_frame(table).assign(split=split))
    return pd.concat(frames, ignore_index=True)


def _problems(root: Path, test: GeneratedScenes) -> pd.DataFrame:
    symbols = test.scenes[0].symbols
    objectives = one_goal_objectives(symbols) + two_goal_objectives(symbols)
    known = {
        "configuration": {scene.name for scene in test.scenes},
        "objective": set(map(format_objective, objectives)),
        "planner": TABLE_1.keys(),
        "outcome": {"trivial", *OUTCOMES},
    }
    path, stage = root / EVALUATION / "generalization.parquet", "evaluate_generalization"
    return _frame(read_columns(path, stage, _OUTCOMES, known))


def _runs(root: Path, scenes: Mapping[str, GeneratedScenes], scalability: Metrics) -> pd.DataFrame:
    known = {
        "problem": scalability.keys(),
        "configuration": {scene.name for part in scenes.values() for scene in part.scenes},
        "planner": TABLE_3.keys(),
    }
    path, stage = root / EVALUATION / "scalability.parquet", "compare_scalability"
    return _frame(read_columns(path, stage, _RUNS, known))


def _frame(table: pa.Table) -> pd.DataFrame:
    """The table; values that are missing are None, which Arrow's own conversion changes."""
    return pd.DataFrame(table.to_pylist(), columns=table.column_names)


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
