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
from guided_lgp.experiments.files import write_table
from guided_lgp.experiments.memory import peak_mb, reset_peak
from guided_lgp.experiments.problems import PROBLEMS, Problem
from guided_lgp.logic import Objective, format_objective, format_skeleton
from guided_lgp.params import BoundsParams, Params, SearchLimits
from guided_lgp.paths import EVALUATION, METRICS, SCENES, TRAINED
from guided_lgp.policy.registry import POLICIES, load_policy
from guided_lgp.scene import Scene, load_scenes
from guided_lgp.search import best_first, breadth_first, classical, graph, guided
from guided_lgp.search.bounds import Bounds
from guided_lgp.search.policy import Policy, Uniform
from guided_lgp.search.result import SearchResult

Row = dict[str, Any]

UNGUIDED: dict[str, Callable[..., SearchResult]] = {
    "breadth_first": breadth_first.plan,
    "breadth_first_graph": graph.plan,
    "astar": classical.plan,
}
GUIDED: dict[str, tuple[str, Callable[..., SearchResult]]] = {
    "guided": ("paper", guided.plan),
    "guided_best_first": ("paper", best_first.plan),
    "improved": ("improved", guided.plan),
    "improved_best_first": ("improved", best_first.plan),
    "relational": ("relational", guided.plan),
    "relational_best_first": ("relational", best_first.plan),
    "uniform_best_first": ("uniform", best_first.plan),
}
"""Policy and search of each guided planner. The uniform policy knows nothing: the control that
shows what the best-first search owes to its bound on the missing actions alone."""

COUNTS = ("expansions", "policy_calls", "coarse_calls", "path_calls")
TIMES = ("symbolic", "policy", "coarse", "path")

ROWS = pa.schema(
    [
        ("problem", pa.string()),
        ("configuration", pa.string()),
        ("objective", pa.string()),
        ("planner", pa.string()),
        ("solved", pa.bool_()),
        ("reason", pa.string()),
        ("skeleton", pa.string()),
        ("length", pa.int32()),
        ("tree_size", pa.int32()),
        ("expansions", pa.int32()),
        ("policy_calls", pa.int32()),
        ("coarse_calls", pa.int32()),
        ("path_calls", pa.int32()),
        ("reattempts_infeasible", pa.int32()),
        ("reattempts_max_depth", pa.int32()),
    ]
)

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
        [{name: row[name] for name in ROWS.names} for row in rows], schema=ROWS
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
    bounds = SceneBounds(task.scene, task.bounds)
    planners = _planners(task, bounds, problem)
    rows = []
    for objective in problem.objectives(symbols.boxes):
        for planner, plan in planners.items():
            reset_peak()
            result = plan(objective)
            rows.append(
                {
                    "problem": problem.name,
                    "configuration": task.scene.name,
                    "objective": format_objective(objective),
                    "planner": planner,
                    "peak_rss_mb": peak_mb(),
                    **_figures(result),
                }
            )
    return rows


def _planners(
    task: Task, bounds: Bounds, problem: Problem
) -> dict[str, Callable[[Objective], SearchResult]]:
    """Every planner, by name, as a function of the objective alone."""
    symbols = task.scene.symbols
    unguided_symbols = problem.unguided_symbols(symbols)
    policies: dict[str, Policy] = {name: load_policy(name, task.models) for name in POLICIES}
    policies["uniform"] = Uniform()
    depth = max(task.limits.max_depth, 2 * problem.k_min)
    limits = task.limits.model_copy(update={"max_depth": depth})

    def by(
        policy: Policy, plan: Callable[..., SearchResult]
    ) -> Callable[[Objective], SearchResult]:
        return lambda objective: plan(task.scene, objective, symbols, bounds, policy, limits)

    def alone(plan: Callable[..., SearchResult]) -> Callable[[Objective], SearchResult]:
        return lambda objective: plan(task.scene, objective, unguided_symbols, bounds, limits)

    return {name: by(policies[policy], plan) for name, (policy, plan) in GUIDED.items()} | {
        name: alone(plan) for name, plan in UNGUIDED.items()
    }


def _figures(result: SearchResult) -> Row:
    skeleton = result.skeleton
    times = {f"{part}_s": getattr(result.times, part) for part in TIMES}
    return {
        "solved": result.solved,
        "reason": result.reason,
        "skeleton": format_skeleton(skeleton) if skeleton is not None else None,
        "length": len(skeleton) if skeleton is not None else None,
        "tree_size": result.tree_size,
        "expansions": result.expansions,
        "policy_calls": result.policy_calls,
        "coarse_calls": result.coarse_calls,
        "path_calls": result.path_calls,
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
