"""The studies beside the pipeline: spread over draws, ablations, data efficiency, shuffled labels.

A case is a policy of the pipeline, or one that differs from it in something; it is trained once per
seed, which draws the training objectives and seeds the training. Every policy then solves all
problems of the generalization test, up to the coarse bound: a sequence that has one counts as a
plan, the path bound is not asked. A verdict is computed once per configuration and shared by all
policies.
"""

import logging
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from guided_lgp import parallel
from guided_lgp.bounds.results import CoarseResult, PathResult
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.documents import write_json
from guided_lgp.errors import InputError
from guided_lgp.experiments.files import read_table
from guided_lgp.logic import (
    Objective,
    Skeleton,
    format_objective,
    one_goal_objectives,
    satisfied,
    two_goal_objectives,
)
from guided_lgp.params import (
    BoundsParams,
    Count,
    Network,
    Params,
    SearchLimits,
    Section,
    Seed,
    TrainPolicy,
    TrainRelational,
    Variant,
    load_params,
    read_params,
)
from guided_lgp.paths import PARAMS, REPORTS, SCENES, SEQUENCES
from guided_lgp.policy.dataset import Dataset
from guided_lgp.policy.encoding import CHAINS
from guided_lgp.policy.inference import load_policy
from guided_lgp.policy.relational.train import train_split
from guided_lgp.policy.samples import build_dataset
from guided_lgp.policy.split import training_objectives
from guided_lgp.policy.train import train_model
from guided_lgp.scene import Scene, load_scenes
from guided_lgp.search import best_first, guided
from guided_lgp.search.result import SearchResult

OUTCOMES = ("shortest", "feasible", "no_solution")

STUDIES = Path("studies")
POLICIES = Path("data/studies")
RESULTS = REPORTS / "studies"

Row = dict[str, Any]

PLANNERS: Mapping[str, Callable[..., SearchResult]] = {
    "default": partial(guided.plan, adapt=False),
    "adaptation": guided.plan,
    "best_first": best_first.plan,
}

logger = logging.getLogger(__name__)


class Case(Section):
    """A policy, by what differs from the paper's."""

    title: str
    policy: Literal["paper", "improved", "relational"]
    """Whose training: the paper's networks (Table IV), the improved variant or the relational."""
    patience: Count | None = None
    """Of early stopping, if not the policy's own."""
    dropout: Annotated[float, Field(strict=True, ge=0, lt=1)] | None = None
    """Of all three networks, if not their own; the relational policy has none."""
    variant: Variant = Variant()
    """How samples are made and encoded."""
    configurations: Count | None = None
    """How many training configurations, the first ones, if not all."""
    objectives: Annotated[int, Field(strict=True, ge=1, le=72)] | None = None
    """How many training objectives, if not as many as in the pipeline."""
    split: Literal["random", "configuration"] = "random"
    """How samples for early stopping are chosen."""
    shuffled: Annotated[bool, Field(strict=True)] = False
    """Whether the actions of all samples are exchanged at random."""


class FeasibilityStudy(Section):
    """Training of the feasibility classifier."""

    seed: Seed
    validation_share: Annotated[float, Field(gt=0, lt=1)]
    """Share of the configurations that stop the training and calibrate it."""
    patience: Count
    network: Network


class StudyTable(Section):
    """One study: its cases, in order."""

    title: str
    cases: tuple[str, ...]


class StudyParams(Section):
    """The content of ``studies/params.yaml``."""

    seeds: Annotated[tuple[Seed, ...], Field(min_length=1)]
    limits: SearchLimits
    cases: dict[str, Case]
    tables: dict[str, StudyTable]
    feasibility: FeasibilityStudy


def load_study(root: Path) -> tuple[StudyParams, Params]:
    """The parameters of the studies and those of the pipeline.

    Raises:
        InputError: a file is missing or damaged; a table names a case that does not exist, or a
            case wants dropout for the relational policy or more configurations than there are.
    """
    path = root / STUDIES / "params.yaml"
    study, params = read_params(path, StudyParams), load_params(root / PARAMS)
    for table, content in study.tables.items():
        for name in content.cases:
            if name not in study.cases:
                where = f"{path}: tables.{table}.cases"
                raise InputError(where, f"unknown case {name!r}", ", ".join(study.cases))
    for name, case in study.cases.items():
        where, most = f"{path}: cases.{name}", params.generate_scenes.training_configurations
        if case.policy == "relational" and case.dropout is not None:
            raise InputError(f"{where}.dropout", "is given", "none for the relational policy")
        if case.configurations is not None and case.configurations > most:
            raise InputError(f"{where}.configurations", f"is {case.configurations}", f"1 to {most}")
    return study, params


@dataclass(frozen=True)
class _Training:
    """One network to train."""

    case: Case
    seed: int
    network: str
    settings: TrainPolicy | TrainRelational
    objectives: int
    slack: int
    root: Path
    directory: Path


def train(root: Path, name: str) -> None:
    """Train the policies of a case: ``data/studies/<case>/<seed>``.

    Raises:
        InputError: bad parameters, an unknown case, or an output of the pipeline is missing.
    """
    study, params = load_study(root)
    if name not in study.cases:
        raise InputError(f"case {name!r}", "is unknown", ", ".join(study.cases))
    case = study.cases[name]
    settings = _settings(case, params)
    networks = ["relational"] if isinstance(settings, TrainRelational) else list(CHAINS)
    tasks = [
        _Training(
            case=case,
            seed=seed,
            network=network,
            settings=settings.model_copy(update={"seed": seed}),
            objectives=_objectives(case, params),
            slack=params.enumerate_sequences.slack,
            root=root,
            directory=root / POLICIES / name / str(seed),
        )
        for seed in study.seeds
        for network in networks
    ]
    parallel.run(_train, tasks, params.parallel, f"training {name}")


def _objectives(case: Case, params: Params) -> int:
    return case.objectives or params.build_dataset.training_objectives


def _settings(case: Case, params: Params) -> TrainPolicy | TrainRelational:
    stages: dict[str, TrainPolicy | TrainRelational] = {
        "paper": params.train_policy,
        "improved": params.train_improved,
        "relational": params.train_relational,
    }
    settings = stages[case.policy]
    if case.patience is not None:
        settings = settings.model_copy(update={"patience": case.patience})
    if case.dropout is not None:
        networks = {
            network: getattr(settings, network).model_copy(update={"dropout": case.dropout})
            for network in CHAINS
        }
        settings = settings.model_copy(update=networks)
    return settings


def _train(task: _Training) -> None:
    dataset = _dataset(task)
    if isinstance(task.settings, TrainRelational):
        train_split(dataset, task.settings, task.case.split).save(task.directory)
    else:
        model = train_model(task.network, dataset, task.settings, task.case.split)
        model.save(task.directory)


def _dataset(task: _Training) -> Dataset:
    scenes = load_scenes(task.root / SCENES / "training.json").scenes
    dataset = build_dataset(
        scenes[: task.case.configurations],
        task.root / SEQUENCES / "training.parquet",
        task.root / SEQUENCES / "training_shortest.parquet",
        training_objectives(scenes[0].symbols, task.objectives, task.seed),
        task.slack,
        task.case.variant,
        task.seed,
    )
    if not task.case.shuffled:
        return dataset
    rng = np.random.default_rng(np.random.SeedSequence(task.seed))
    return replace(dataset, actions=rng.permutation(dataset.actions))


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


def shortest_lengths(root: Path, scenes: Sequence[Scene]) -> dict[str, dict[str, int | None]]:
    """Shortest feasible length by test configuration and objective.

    Raises:
        InputError: the output of enumerate_sequences is missing or of other scenes.
    """
    path = root / SEQUENCES / "test_shortest.parquet"
    lengths: dict[str, dict[str, int | None]] = {}
    for row in read_table(path, "enumerate_sequences", ["configuration", "objective", "length"]):
        lengths.setdefault(row["configuration"], {})[row["objective"]] = row["length"]
    for scene in scenes:
        if scene.name not in lengths:
            raise InputError(str(path), f"lacks {scene.name}", "the sequences of the same scenes")
    return lengths


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
        kind = "relational" if case.policy == "relational" else "paper"  # the kind of files
        policy = load_policy(task.root / POLICIES / name / str(seed), kind)
        seen = set(training_objectives(symbols, _objectives(case, task.params), seed))
        for objective in problems(task.scene):
            result = PLANNERS[planner](
                task.scene, objective, symbols, bounds, policy, task.study.limits
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
