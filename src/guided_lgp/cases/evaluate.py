"""How the planners of a case do on its test problems: calls of the coarse bound above all.

A sequence with a coarse bound counts as a plan, so that a search costs calls and nothing else. Some
plans of the first training, for every size, then get a path and are carried out under gravity.
"""

import logging
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from guided_lgp.bounds.execution import execute
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.cases.declared import DeclaredCase, declared_case
from guided_lgp.cases.demonstrate import CoarseBounds
from guided_lgp.cases.outcomes import Row, outcomes_of, times_of
from guided_lgp.cases.policies import RIVALS, models_of, trained_with
from guided_lgp.cases.shards import run_kept
from guided_lgp.documents import write_json
from guided_lgp.logic import format_objective, format_skeleton
from guided_lgp.params import BoundsParams, Params, SearchLimits
from guided_lgp.policy.relational.inference import load_relational
from guided_lgp.policy.uniform import Uniform
from guided_lgp.scene.families import Drawn
from guided_lgp.search.planners import CASE_PLANNERS, UNIFORM, Planner
from guided_lgp.search.policy import Policy
from guided_lgp.search.problem import Problem

COUNTS = ("coarse_calls", "infeasible_calls", "part_calls", "failed_candidates")

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Task:
    """One problem, for all planners without a training or for those of one training."""

    drawn: Drawn
    size: int
    policies: Mapping[str, Path]
    """Folders of trained policies by their names; none for the rivals."""
    with_path: bool
    """Whether plans get a path and are carried out."""
    bounds: BoundsParams
    limits: SearchLimits


def run(params: Params, root: Path, name: str, training: str) -> None:
    """Write ``reports/<case>/<training>.json`` and the times beside it.

    Args:
        params: all parameters.
        root: the folder of ``dvc.yaml``.
        name: the case.
        training: the seed of one, or :data:`RIVALS`.
    """
    case = declared_case(params, name)
    tasks = [(task, _content(task)) for task in _tasks(case, params, root, training)]
    shards = root / "data" / name / f".evaluation-{training}"
    description = f"{name}: evaluation {training}"
    parts = run_kept(compare, tasks, shards, params.parallel, "evaluate_case", description)
    rows = [row for part in parts for row in part]
    times = [
        {
            key: row.pop(key) if key == "time_s" else row[key]
            for key in ("scene", "planner", "time_s")
        }
        for row in rows
    ]
    write_json(outcomes_of(root, name, training), rows)
    write_json(times_of(root, name, training), times)
    solved = sum(row["solved"] for row in rows)
    logger.info("%s, %s: %d of %d solved", name, training, solved, len(rows))


def _tasks(case: DeclaredCase, params: Params, root: Path, training: str) -> Iterator[Task]:
    policies = {}
    if training != RIVALS:
        for policy in trained_with(case.params, int(training)):
            policies[policy] = models_of(root, case.name, policy, int(training))
    first = training == str(case.params.seeds[0])
    for size in case.params.evaluation.sizes:
        for index, drawn in enumerate(case.problems(size)):
            with_path = first and index < case.params.evaluation.paths
            yield Task(drawn, size, policies, with_path, params.bounds, case.params.limits)


def _content(task: Task) -> Any:
    weights = [file.read_bytes().hex() for path in task.policies.values() for file in _files(path)]
    settings = task.bounds.model_dump(), task.limits.model_dump()
    scene = task.drawn.scene.model_dump(mode="json")
    goals = format_objective(task.drawn.objective)
    return [scene, goals, list(task.policies), weights, task.with_path, *settings]


def _files(folder: Path) -> list[Path]:
    return sorted(folder.glob("relational.*"))


def compare(task: Task) -> list[Row]:
    """One row per planner."""
    bounds = CoarseBounds(task.drawn.scene, task.bounds)
    loaded: dict[str, Policy] = {
        name: load_relational(path) for name, path in task.policies.items()
    }
    return [
        _row(task, planner, policy, bounds)
        for planner in CASE_PLANNERS.values()
        if (policy := _policy(planner, loaded)) is not None or not planner.policy
        if planner.trained == bool(loaded)
    ]


def _policy(planner: Planner, loaded: Mapping[str, Policy]) -> Policy | None:
    return Uniform() if planner.policy == UNIFORM else loaded.get(planner.policy)


def _row(task: Task, planner: Planner, policy: Policy | None, bounds: CoarseBounds) -> Row:
    drawn = task.drawn
    problem = Problem(drawn.scene, drawn.objective, task.limits, bounds, policy, parts=bounds)
    result = planner.plan(problem)
    row = {
        "scene": drawn.scene.name,
        "size": task.size,
        "objective": format_objective(drawn.objective),
        "planner": planner.name,
        "solved": result.solved,
        "skeleton": None if result.skeleton is None else format_skeleton(result.skeleton),
        "length": None if result.skeleton is None else len(result.skeleton),
        **{name: getattr(result, name) for name in COUNTS},
        "path_verified": None,
        "physics": None,
        "time_s": round(result.times.total, 4),
    }
    if task.with_path and result.skeleton is not None and planner.carried_out:
        row |= _carried_out(task, problem, result.skeleton)
    return row


def _carried_out(task: Task, problem: Problem, skeleton: Any) -> Row:
    path = SceneBounds(task.drawn.scene, task.bounds).path(skeleton)
    if path.trajectory is None:
        return {"path_verified": False}
    report = execute(problem.scene, problem.objective, skeleton, path.trajectory)
    return {"path_verified": True, "physics": report.success}
