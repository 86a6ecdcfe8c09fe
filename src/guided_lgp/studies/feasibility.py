"""Study: does a feasibility classifier pay?

A classifier of the coarse verdicts is trained on the enumeration of the training configurations and
tested on that of the test configurations. Then the pipeline's policies solve the generalization
test up to the coarse bound, each with and without it. The time of infeasible coarse NLPs is what a
perfect classifier would save at most.
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from guided_lgp import parallel, sequences
from guided_lgp.bounds.results import Array, CoarseResult
from guided_lgp.documents import write_json
from guided_lgp.errors import InputError
from guided_lgp.logic import Skeleton, format_objective, parse_skeleton, progress
from guided_lgp.params import BoundsParams, SearchLimits
from guided_lgp.paths import SCENES, SEQUENCES, TRAINED
from guided_lgp.policy.registry import TRAINED_POLICIES, load_policy
from guided_lgp.scene import Scene, load_scenes
from guided_lgp.search.observation import observe, start
from guided_lgp.search.policy import Policy
from guided_lgp.search.problem import Problem
from guided_lgp.studies.cases import CLASSIFIER, OUTCOMES, PLANNERS, RESULTS, load_study
from guided_lgp.studies.classifier import (
    FeasibilityAware,
    FeasibilityClassifier,
    Verdicts,
    calibration,
    features,
    train_classifier,
)
from guided_lgp.studies.evaluate import (
    CoarseBounds,
    Row,
    outcome,
    problems,
    shortest_lengths,
)

SEARCHES = tuple(key for key, planner in PLANNERS.items() if planner.adapt)
"""Of the planners of the studies: greedy with reattempts, and best-first."""

CALLS = ("coarse_calls", "infeasible_calls", "policy_calls")
TIMES = ("coarse_s", "infeasible_s", "policy_s")
"""Of the coarse NLPs, of the infeasible ones among them, and of the policy with its classifier."""

logger = logging.getLogger(__name__)


class AskedBounds(CoarseBounds):
    """The bounds of the studies, which also keep what one search has asked for."""

    def __init__(self, scene: Scene, params: BoundsParams) -> None:
        super().__init__(scene, params)
        self.asked: dict[Skeleton, CoarseResult] = {}

    def coarse(self, skeleton: Skeleton) -> CoarseResult:
        """P_coarse(a_1:K)."""
        result = self.asked[skeleton] = super().coarse(skeleton)
        return result


@dataclass(frozen=True)
class _Task:
    """All problems of one test configuration."""

    scene: Scene
    shortest: Mapping[str, int | None]
    """Shortest feasible length by objective."""
    classifier: FeasibilityClassifier
    bounds: BoundsParams
    limits: SearchLimits
    models: Path


def run(root: Path) -> None:
    """Write ``reports/studies/feasibility.json``, and its times to ``feasibility_timing.json``.

    Raises:
        InputError: bad parameters, or an output of the pipeline is missing or damaged.
    """
    study, params = load_study(root)
    own = study.feasibility
    scenes = {
        split: load_scenes(root / SCENES / f"{split}.json").scenes for split in ("training", "test")
    }
    known, new = (
        read_verdicts(scenes[split], root / SEQUENCES / f"{split}.parquet") for split in scenes
    )
    classifier = train_classifier(known, own.network, own.validation_share, own.patience, own.seed)
    quality = calibration(np.exp(classifier.log_probabilities(new.inputs)), new.feasible)
    quality |= {"temperature": classifier.temperature}
    logger.info("classifier: Brier score %(brier).4f (%(brier_base).4f), ECE %(ece).4f", quality)
    lengths = shortest_lengths(root, scenes["test"])
    tasks = [
        _Task(scene, lengths[scene.name], classifier, params.bounds, study.limits, root / TRAINED)
        for scene in scenes["test"]
    ]
    parts = parallel.run(evaluate, tasks, params.parallel, "feasibility")
    rows = [row for part in parts for row in part]
    document = {"classifier": quality, "search": _by_run(rows, _figures)}
    write_json(root / RESULTS / "feasibility.json", document)
    write_json(root / RESULTS / "feasibility_timing.json", _by_run(rows, _times))


def read_verdicts(scenes: Sequence[Scene], path: Path) -> Verdicts:
    """The coarse verdicts of an enumeration.

    Args:
        scenes: the configurations.
        path: Parquet file of their sequences, written by enumerate_sequences.

    Raises:
        InputError: the file is missing, damaged, or not of these scenes.
    """
    columns = "configuration", "skeleton", "feasible", "states"
    rows_of: dict[str, list[Row]] = {}
    for row in sequences.read_verdicts(path, *columns).to_pylist():
        rows_of.setdefault(row["configuration"], []).append(row)
    inputs: list[list[float]] = []
    feasible: list[bool] = []
    configuration: list[int] = []
    for index, scene in enumerate(scenes):
        rows = rows_of.get(scene.name, [])
        try:
            inputs += _inputs(scene, rows)
        except (KeyError, ValueError):
            rows = []
        if not rows:
            fault = f"lacks sequences of {scene.name}, or has those of another scene of that name"
            raise InputError(str(path), fault, "the sequences of the same scenes")
        feasible += [row["feasible"] for row in rows]
        configuration += [index] * len(rows)
    return Verdicts(
        np.array(inputs, dtype=np.float32), np.array(feasible, dtype=int), np.array(configuration)
    )


def _inputs(scene: Scene, rows: Sequence[Row]) -> list[list[float]]:
    """Features of the last action of every sequence, at the end of its prefix."""
    names = (*scene.symbols.grippers, *scene.symbols.boxes, *scene.symbols.surfaces)
    positions: dict[Skeleton, dict[str, Array]] = {(): observe(scene, start(scene))}
    for row in rows:
        if row["feasible"]:
            last = np.reshape(row["states"], (-1, len(names), 3))[-1]
            positions[parse_skeleton(row["skeleton"])] = dict(zip(names, last, strict=True))
    inputs = []
    for row in rows:
        *prefix, action = parse_skeleton(row["skeleton"])
        state = progress(scene.state, prefix)
        inputs.append(features(state, scene.symbols, positions[tuple(prefix)], action))
    return inputs


def evaluate(task: _Task) -> list[Row]:
    """Rows of one configuration: every policy, without and with the classifier, in every search."""
    bounds = AskedBounds(task.scene, task.bounds)
    rows = []
    for name in TRAINED_POLICIES:
        policy = load_policy(name, task.models)
        scorers: tuple[Policy, Policy] = (policy, FeasibilityAware(policy, task.classifier))
        for classified, scorer in zip(CLASSIFIER, scorers, strict=True):
            for search in SEARCHES:
                for objective in problems(task.scene):
                    bounds.asked = {}
                    result = PLANNERS[search].plan(
                        Problem(task.scene, objective, task.limits, bounds, scorer)
                    )
                    infeasible = [
                        verdict for verdict in bounds.asked.values() if not verdict.feasible
                    ]
                    rows.append(
                        {
                            "run": (name, search, classified),
                            "outcome": outcome(result, task.shortest[format_objective(objective)]),
                            "coarse_calls": result.coarse_calls,
                            "infeasible_calls": len(infeasible),
                            "policy_calls": result.policy_calls,
                            "coarse_s": result.times.coarse,
                            "infeasible_s": sum(verdict.time_s for verdict in infeasible),
                            "policy_s": result.times.policy,
                        }
                    )
    return rows


def _by_run(rows: Sequence[Row], summarize: Callable[[Sequence[Row]], Row]) -> Row:
    """Policy, search, without or with the classifier, then figures."""
    return {
        policy: {
            search: {
                classified: summarize(
                    [row for row in rows if row["run"] == (policy, search, classified)]
                )
                for classified in CLASSIFIER
            }
            for search in SEARCHES
        }
        for policy in TRAINED_POLICIES
    }


def _figures(rows: Sequence[Row]) -> Row:
    """Problems, shares of their outcomes, and sums of calls."""
    return {
        "n": len(rows),
        **{name: sum(row["outcome"] == name for row in rows) / len(rows) for name in OUTCOMES},
        **{name: sum(row[name] for row in rows) for name in CALLS},
    }


def _times(rows: Sequence[Row]) -> Row:
    """Sums over all problems (s)."""
    return {name: sum(row[name] for row in rows) for name in TIMES}
