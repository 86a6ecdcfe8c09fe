"""Stage evaluate_generalization: the protocol behind Table I.

Every planner solves every objective of setup a, of one goal and of two, in every test
configuration. A plan counts as shortest if its length is the shortest feasible length of the
exhaustive enumeration, which knows the coarse bound only; whether any sequence of that length
has a path, too, is recorded beside it. Objectives that hold at the start are counted apart.
"""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa

from guided_lgp import parallel
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.documents import write_json
from guided_lgp.experiments.outcomes import BOUND_COUNTS, GENERALIZATION, OUTCOMES
from guided_lgp.experiments.policies import load_policies
from guided_lgp.logic import (
    Objective,
    Skeleton,
    format_objective,
    format_skeleton,
    one_goal_objectives,
    progress,
    satisfied,
    two_goal_objectives,
)
from guided_lgp.params import BoundsParams, Params, SearchLimits
from guided_lgp.paths import EVALUATION, METRICS, SCENES, SEQUENCES, TRAINED
from guided_lgp.policy.split import training_objectives
from guided_lgp.scene import Scene, load_scenes
from guided_lgp.search.bounds import Bounds
from guided_lgp.search.planners import TABLE_1
from guided_lgp.search.policy import Policy
from guided_lgp.search.problem import Problem
from guided_lgp.search.result import SearchResult
from guided_lgp.sequences import feasible_sequences, read_shortest
from guided_lgp.tables import write_table

Row = dict[str, Any]

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Task:
    """All problems of one test configuration."""

    scene: Scene
    seen: tuple[Objective, ...]
    shortest: Mapping[str, int | None]
    """Shortest feasible length by objective."""
    sequences: tuple[Skeleton, ...]
    """The feasible sequences that the enumeration found."""
    bounds: BoundsParams
    limits: SearchLimits
    models: Path


def run(params: Params, root: Path) -> None:
    """Write ``data/evaluation/generalization.parquet`` and its metrics."""
    rows = [
        row
        for part in parallel.run(evaluate, _tasks(params, root), params.parallel, "generalization")
        for row in part
    ]
    table = pa.Table.from_pylist(rows, schema=GENERALIZATION)
    write_table(root / EVALUATION / "generalization.parquet", table)
    metrics = summarize(rows)
    write_json(root / METRICS / "generalization.json", metrics)
    for planner, subsets in metrics.items():
        shares = ", ".join(f"{name} {figures['shortest']:.1%}" for name, figures in subsets.items())
        logger.info("%s: shortest: %s", planner, shares)


def _tasks(params: Params, root: Path) -> list[Task]:
    scenes = load_scenes(root / SCENES / "test.json").scenes
    draw = params.build_dataset
    seen = training_objectives(scenes[0].symbols, draw.training_objectives, draw.seed)
    objectives = one_goal_objectives(scenes[0].symbols) + two_goal_objectives(scenes[0].symbols)
    lengths = read_shortest(root / SEQUENCES / "test_shortest.parquet", scenes, objectives)
    sequences = feasible_sequences(root / SEQUENCES / "test.parquet", scenes)
    return [
        Task(
            scene,
            tuple(seen),
            lengths[scene.name],
            sequences[scene.name],
            params.bounds,
            params.evaluate_generalization,
            root / TRAINED,
        )
        for scene in scenes
    ]


def evaluate(task: Task) -> list[Row]:
    """Rows of one configuration: every objective by every planner."""
    symbols = task.scene.symbols
    bounds = SceneBounds(task.scene, task.bounds)
    policies = load_policies(TABLE_1.values(), task.models)
    return [
        row
        for objective in one_goal_objectives(symbols) + two_goal_objectives(symbols)
        for row in _problem(task, objective, bounds, policies)
    ]


def _problem(
    task: Task,
    objective: Objective,
    bounds: Bounds,
    policies: Mapping[str, Policy],
) -> list[Row]:
    shortest = task.shortest[format_objective(objective)]
    problem = {
        "configuration": task.scene.name,
        "objective": format_objective(objective),
        "unseen": objective not in task.seen,
        "shortest_length": shortest,
    }
    if satisfied(task.scene.state, objective):
        return [problem | {"planner": name, "outcome": "trivial"} for name in TABLE_1]
    results = {
        name: planner.plan(
            Problem(
                task.scene,
                objective,
                task.limits,
                bounds,
                policies[planner.policy],
                planner.adapt,
            )
        )
        for name, planner in TABLE_1.items()
    }
    found = {len(result.skeleton) for result in results.values() if result.skeleton is not None}
    has_path = None
    if shortest is not None:
        has_path = shortest in found or any(
            bounds.path(skeleton).feasible
            for skeleton in task.sequences
            if len(skeleton) == shortest
            and satisfied(progress(task.scene.state, skeleton), objective)
        )
    return [
        problem | {"planner": name, "shortest_has_path": has_path} | _figures(result, shortest)
        for name, result in results.items()
    ]


def _figures(result: SearchResult, shortest: int | None) -> Row:
    skeleton = result.skeleton
    length = len(skeleton) if skeleton is not None else None
    outcome = "no_solution"
    if length is not None:
        outcome = "shortest" if length == shortest else "feasible"
    return {
        "outcome": outcome,
        "skeleton": format_skeleton(skeleton) if skeleton is not None else None,
        "length": length,
        "reattempts_infeasible": result.reattempts["infeasible"],
        "reattempts_max_depth": result.reattempts["max_depth"],
        "tree_size": result.tree_size,
        "expansions": result.expansions,
        "policy_calls": result.policy_calls,
        **{count: getattr(result, count) for count in BOUND_COUNTS},
        "path_calls": result.path_calls,
        "reason": result.reason,
    }


def summarize(rows: Sequence[Row]) -> dict[str, dict[str, dict[str, float | int]]]:
    """Table I: planner, then all or unseen objectives, then figures.

    ``n`` problems do not hold at the start, a share ``trivial`` of all problems does. The other
    figures are shares of n: the outcomes; problems with at least one reattempt for a cause;
    ``unsolvable``, for which the enumeration found no feasible sequence; and
    ``shortest_without_path``, where no sequence of the shortest length has a path.
    """
    return {
        planner: {
            subset: _shares(
                [row for row in rows if row["planner"] == planner and (row["unseen"] or not only)]
            )
            for subset, only in (("all", False), ("unseen", True))
        }
        for planner in TABLE_1
    }


def _shares(rows: Sequence[Row]) -> dict[str, float | int]:
    counted = [row for row in rows if row["outcome"] != "trivial"]

    def share(holds: Callable[[Row], bool]) -> float:
        return sum(map(holds, counted)) / max(len(counted), 1)

    outcomes = [row["outcome"] for row in counted]
    return {
        "n": len(counted),
        "trivial": (len(rows) - len(counted)) / max(len(rows), 1),
        **{name: outcomes.count(name) / max(len(counted), 1) for name in OUTCOMES},
        "reattempt_infeasible": share(lambda row: row["reattempts_infeasible"] > 0),
        "reattempt_max_depth": share(lambda row: row["reattempts_max_depth"] > 0),
        "unsolvable": share(lambda row: row["shortest_length"] is None),
        "shortest_without_path": share(lambda row: row["shortest_has_path"] is False),
    }
