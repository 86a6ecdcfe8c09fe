"""How the policies of the studies plan.

Every policy solves all problems of the generalization test, up to the coarse bound: a sequence that
has one counts as a plan, the path bound is not asked. A verdict is computed once per configuration
and shared by all policies.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from guided_lgp import parallel
from guided_lgp.bounds.results import CoarseResult, PathResult
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.documents import write_json
from guided_lgp.errors import InputError
from guided_lgp.logic import (
    Objective,
    Skeleton,
    format_objective,
    one_goal_objectives,
    satisfied,
    two_goal_objectives,
)
from guided_lgp.params import BoundsParams, Params
from guided_lgp.paths import SCENES, SEQUENCES
from guided_lgp.policy.registry import POLICIES
from guided_lgp.policy.split import training_objectives
from guided_lgp.scene import Scene, load_scenes
from guided_lgp.search.problem import Problem
from guided_lgp.search.result import SearchResult
from guided_lgp.sequences import read_shortest
from guided_lgp.studies.cases import OUTCOMES, PLANNERS, RESULTS, TRAINED, StudyParams, load_study

Row = dict[str, Any]


class CoarseBounds:
    """The bounds of the NLP without the path: a sequence with a coarse bound counts as feasible."""

    def __init__(self, scene: Scene, params: BoundsParams) -> None:
        self._bounds = SceneBounds(scene, params)

    def coarse(self, skeleton: Skeleton) -> CoarseResult:
        """P_coarse(a_1:K)."""
        return self._bounds.coarse(skeleton)

    def path(self, skeleton: Skeleton) -> PathResult:
        """The verdict of the coarse bound."""
        return PathResult(skeleton, self.coarse(skeleton).feasible)


@dataclass(frozen=True)
class _Evaluation:
    """All problems of one test configuration, for every policy."""

    scene: Scene
    shortest: Mapping[str, int | None]
    """Shortest feasible length by objective."""
    study: StudyParams
    params: Params
    table: str
    root: Path


def evaluate(root: Path, table: str) -> None:
    """Write ``reports/studies/<table>.json``: figures of each case, planner, seed and subset.

    Raises:
        InputError: bad parameters, an unknown table, or an output of the pipeline or of the
            training is missing.
    """
    study, params = load_study(root)
    if table not in study.tables:
        raise InputError(f"table {table!r}", "is unknown", ", ".join(study.tables))
    scenes = load_scenes(root / SCENES / "test.json").scenes
    lengths = shortest_lengths(root, scenes)
    tasks = [
        _Evaluation(scene, lengths[scene.name], study, params, table, root) for scene in scenes
    ]
    parts = parallel.run(_evaluate, tasks, params.parallel, "studies")
    rows: dict[tuple[str, int, str], list[Row]] = {run: [] for run in _runs(study, table)}
    for row in (row for part in parts for row in part):
        rows[row["run"]].append(row)
    figures = {
        name: {
            planner: _by_subset([rows[run] for run in rows if run[::2] == (name, planner)])
            for planner in PLANNERS
        }
        for name in study.tables[table].cases
    }
    write_json(root / RESULTS / f"{table}.json", figures)


def shortest_lengths(root: Path, scenes: Sequence[Scene]) -> Mapping[str, Mapping[str, int | None]]:
    """Shortest feasible length by test configuration and objective.

    Raises:
        InputError: the output of enumerate_sequences is missing or of other scenes.
    """
    symbols = scenes[0].symbols
    objectives = one_goal_objectives(symbols) + two_goal_objectives(symbols)
    return read_shortest(root / SEQUENCES / "test_shortest.parquet", scenes, objectives)


def _by_subset(runs: Sequence[Sequence[Row]]) -> dict[str, dict[str, list[float | int]]]:
    """All or unseen objectives, then figures as in Table I, each with one value per run."""
    subsets: dict[str, dict[str, list[float | int]]] = {}
    for subset, only in (("all", False), ("unseen", True)):
        counted = [[row for row in run if row["unseen"] or not only] for run in runs]
        subsets[subset] = {"n": [len(run) for run in counted]}
        for outcome in OUTCOMES:
            subsets[subset][outcome] = [
                sum(row["outcome"] == outcome for row in run) / max(len(run), 1) for run in counted
            ]
    return subsets


def _evaluate(task: _Evaluation) -> list[Row]:
    symbols = task.scene.symbols
    bounds = CoarseBounds(task.scene, task.params.bounds)
    rows = []
    for name, seed, planner in _runs(task.study, task.table):
        case = task.study.cases[name]
        policy = POLICIES[case.policy].read(task.root / TRAINED / name / str(seed))
        seen = set(training_objectives(symbols, case.drawn_objectives(task.params), seed))
        for objective in problems(task.scene):
            search = PLANNERS[planner]
            result = search.plan(
                Problem(task.scene, objective, task.study.limits, bounds, policy, search.adapt)
            )
            rows.append(
                {
                    "run": (name, seed, planner),
                    "unseen": objective not in seen,
                    "outcome": outcome(result, task.shortest[format_objective(objective)]),
                }
            )
    return rows


def _runs(study: StudyParams, table: str) -> Iterator[tuple[str, int, str]]:
    for name in study.tables[table].cases:
        for seed in study.seeds:
            for planner in PLANNERS:
                yield name, seed, planner


def problems(scene: Scene) -> list[Objective]:
    """The objectives of the generalization test that do not hold at the start."""
    objectives = one_goal_objectives(scene.symbols) + two_goal_objectives(scene.symbols)
    return [objective for objective in objectives if not satisfied(scene.state, objective)]


def outcome(result: SearchResult, shortest: int | None) -> str:
    """One of :data:`OUTCOMES`, given the shortest feasible length."""
    if result.skeleton is None:
        return "no_solution"
    return "shortest" if len(result.skeleton) == shortest else "feasible"
