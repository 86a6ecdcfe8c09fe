"""Trains the policies of the studies."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from guided_lgp import parallel
from guided_lgp.errors import InputError
from guided_lgp.params import Params, TrainPolicy, TrainRelational
from guided_lgp.paths import SCENES, SEQUENCES
from guided_lgp.policy.paper.dataset import Dataset
from guided_lgp.policy.paper.samples import build_dataset
from guided_lgp.policy.paper.train import train_model
from guided_lgp.policy.registry import TRAINED_POLICIES
from guided_lgp.policy.relational.train import train_split
from guided_lgp.policy.split import training_objectives
from guided_lgp.scene import load_scenes
from guided_lgp.studies.cases import TRAINED, Case, load_study


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
    tasks = [
        _Training(
            case=case,
            seed=seed,
            network=network,
            settings=settings.model_copy(update={"seed": seed}),
            objectives=case.drawn_objectives(params),
            slack=params.enumerate_sequences.slack,
            root=root,
            directory=root / TRAINED / name / str(seed),
        )
        # the instruction's network first: it has all samples and takes longest
        for network in TRAINED_POLICIES[case.policy].networks
        for seed in study.seeds
    ]
    parallel.run(_train, tasks, params.parallel, f"training {name}")


def _settings(case: Case, params: Params) -> TrainPolicy | TrainRelational:
    settings = case.settings(params)
    if case.patience is not None:
        settings = settings.model_copy(update={"patience": case.patience})
    if case.dropout is not None:
        assert isinstance(settings, TrainPolicy), "refused when the study is read"
        settings = settings.with_dropout(case.dropout)
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
        task.case.recipe,
        task.seed,
    )
    if not task.case.shuffled:
        return dataset
    rng = np.random.default_rng(np.random.SeedSequence(task.seed))
    return replace(dataset, actions=rng.permutation(dataset.actions))
