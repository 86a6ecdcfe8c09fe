"""Stage compare_scalability: the protocol behind Table III.

Every planner solves every objective of problems a.1 to e.10 in every configuration of the setup,
on the same bounds and within the same limits. A verdict of a bound is computed once, and its
time counts for every planner that asks for it. Planners without a policy get the paper's reduced
branching in b.1, c.1 and d.1; the guided ones never do. The maximum depth is the paper's, which is
twice the least number of actions of its longest problems, and that also where more are needed.
"""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean, pstdev
from typing import Any

import pyarrow as pa

from guided_lgp import parallel
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.documents import write_json
from guided_lgp.experiments.memory import peak_mb, reset_peak
from guided_lgp.experiments.outcomes import BOUND_COUNTS, SCALABILITY
from guided_lgp.experiments.policies import load_policies
from guided_lgp.experiments.problems import PROBLEMS
from guided_lgp.logic import format_objective, format_skeleton
from guided_lgp.params import BoundsParams, Params, SearchLimits
from guided_lgp.paths import EVALUATION, METRICS, SCENES, TRAINED
from guided_lgp.scene import Scene, load_scenes
from guided_lgp.search.planners import TABLE_3, controls_last
from guided_lgp.search.problem import Problem
from guided_lgp.search.result import SearchResult
from guided_lgp.tables import write_table

Row = dict[str, Any]

COUNTS = ("expansions", "policy_calls", *BOUND_COUNTS, "path_calls")
TIMES = ("symbolic", "policy", "coarse", "path")

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Task:
    """All objectives of one problem in one configuration."""

    problem: str
    scene: Scene
    bounds: BoundsParams
    limits: SearchLimits
    models: Path


def run(params: Params, root: Path) -> None:
    """Write ``data/evaluation/scalability.parquet``, its metrics and its timings."""
    tasks = [
        Task(problem.name, scene, params.bounds, params.compare_scalability, root / TRAINED)
        for problem in PROBLEMS
        for scene in load_scenes(root / SCENES / f"scalability_{problem.setup}.json").scenes
    ]
    longest_first = tasks[::-1]
    parts = parallel.run(compare, longest_first, params.parallel, "scalability")
    rows = [row for part in reversed(parts) for row in part]
    table = pa.Table.from_pylist(
        [{name: row[name] for name in SCALABILITY.names} for row in rows], schema=SCALABILITY
    )
    write_table(root / EVALUATION / "scalability.parquet", table)
    write_json(root / METRICS / "scalability.json", summarize(rows))
    write_json(root / METRICS / "scalability_timing.json", summarize_times(rows))
    for problem, planners in summarize(rows).items():
        solved = ", ".join(f"{name} {cell['solved']}" for name, cell in planners.items())
        logger.info("%s: solved: %s", problem, solved)


def compare(task: Task) -> list[Row]:
    """Rows of one task: every objective by every planner."""
    problem = next(problem for problem in PROBLEMS if problem.name == task.problem)
    symbols = task.scene.symbols
    unguided_symbols = problem.unguided_symbols(symbols)
    bounds = SceneBounds(task.scene, task.bounds)
    depth = max(task.limits.max_depth, 2 * problem.k_min)
    limits = task.limits.model_copy(update={"max_depth": depth})
    planners = controls_last(TABLE_3.values())
    policies = load_policies(planners, task.models)
    rows = []
    for objective in problem.objectives(symbols.boxes):
        for planner in planners:
            policy = policies.get(planner.policy)
            restriction = None if policy else unguided_symbols
            reset_peak()
            result = planner.plan(
                Problem(task.scene, objective, limits, bounds, policy, planner.adapt, restriction)
            )
            rows.append(
                {
                    "problem": problem.name,
                    "configuration": task.scene.name,
                    "objective": format_objective(objective),
                    "planner": planner.name,
                    "peak_rss_mb": peak_mb(),
                    **_figures(result),
                }
            )
    return rows


def _figures(result: SearchResult) -> Row:
    skeleton = result.skeleton
    times = {f"{part}_s": getattr(result.times, part) for part in TIMES}
    return {
        "solved": result.solved,
        "reason": result.reason,
        "skeleton": format_skeleton(skeleton) if skeleton is not None else None,
        "length": len(skeleton) if skeleton is not None else None,
        "tree_size": result.tree_size,
        **{count: getattr(result, count) for count in COUNTS},
        "reattempts_infeasible": result.reattempts["infeasible"],
        "reattempts_max_depth": result.reattempts["max_depth"],
        "time_s": result.times.total,
        **times,
    }


def summarize(rows: Sequence[Row]) -> dict[str, dict[str, Row]]:
    """Table III: problem, then planner, then figures over the problems that it solved.

    ``objectives`` and, of these, ``solved`` in every configuration; ``problems``: objectives times
    configurations, and ``problems_solved`` of them. Means are None where nothing was solved; calls
    are those of one search, whether or not the verdict was known.
    """
    return _by_cell(rows, _sizes)


def summarize_times(rows: Sequence[Row]) -> dict[str, dict[str, Row]]:
    """Times (s) over the problems that each planner solved, and the peak memory over all.

    ``peak_rss_mb`` is the highest resident memory of the worker process while the planner ran:
    libraries and the verdicts that all planners share are in it.
    """
    return _by_cell(rows, _times)


def _by_cell(rows: Sequence[Row], figures: Callable[[list[Row]], Row]) -> dict[str, dict[str, Row]]:
    cells: dict[str, dict[str, list[Row]]] = {}
    for row in rows:
        cells.setdefault(row["problem"], {}).setdefault(row["planner"], []).append(row)
    return {
        problem: {planner: figures(cell) for planner, cell in planners.items()}
        for problem, planners in cells.items()
    }


def _sizes(cell: list[Row]) -> Row:
    solved = [row for row in cell if row["solved"]]
    objectives = {row["objective"] for row in cell}
    failed = {row["objective"] for row in cell if not row["solved"]}
    sizes = [row["tree_size"] for row in solved]
    return {
        "objectives": len(objectives),
        "solved": len(objectives - failed),
        "problems": len(cell),
        "problems_solved": len(solved),
        "tree_size_mean": _mean(sizes),
        "tree_size_std": _std(sizes),
        "plan_length_mean": _mean([row["length"] for row in solved]),
        **{f"{count}_mean": _mean([row[count] for row in solved]) for count in COUNTS},
    }


def _times(cell: list[Row]) -> Row:
    solved = [row for row in cell if row["solved"]]
    totals = [row["time_s"] for row in solved]
    parts = {f"{part}_s": _mean([row[f"{part}_s"] for row in solved]) for part in TIMES}
    peak = max(row["peak_rss_mb"] for row in cell)
    return {
        "time_mean_s": _mean(totals),
        "time_std_s": _std(totals),
        **parts,
        "peak_rss_mb": peak,
    }


def _mean(values: Sequence[float]) -> float | None:
    return fmean(values) if values else None


def _std(values: Sequence[float]) -> float | None:
    return pstdev(values) if values else None
