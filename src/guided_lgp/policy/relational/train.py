"""Trains the relational policy from the samples of the paper's networks."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from guided_lgp.params import Parallel, TrainRelational
from guided_lgp.policy import splits
from guided_lgp.policy.arrays import BoolArray
from guided_lgp.policy.paper.dataset import Dataset
from guided_lgp.policy.relational.model import NAME, Model
from guided_lgp.policy.relational.samples import Examples, examples
from guided_lgp.policy.relational.training import Fit, fit
from guided_lgp.policy.splits import SPLITS, TrainingReport

ACTION = "action"
"""The one sub-policy: the whole action."""


@dataclass(frozen=True)
class _Training:
    split: str
    problems: Examples
    validation: BoolArray
    """(N,) the problems for validation."""
    settings: TrainRelational
    network: str = NAME
    sub_policy: str = ACTION

    def fit(self) -> Fit:
        return fit(
            self.problems[~self.validation],
            self.problems[self.validation],
            self.settings,
            np.random.SeedSequence([self.settings.seed, len(SPLITS)]),
        )


def train_relational(
    dataset: Dataset, settings: TrainRelational, parallel: Parallel, directory: Path
) -> TrainingReport:
    """Train the relational network and save it.

    As for the paper's networks, a random choice of validation problems decides about the weights,
    and the training is repeated with whole configurations held out, for the report alone.

    Args:
        dataset: the training samples, as the paper's networks get them.
        settings: of the network and its training.
        parallel: back end and workers; the result does not depend on them.
        directory: for ``relational.safetensors`` and ``relational.json``.

    Returns:
        The report, with the whole action as its one sub-policy.

    Raises:
        InputError: too few problems to split, or a training that diverges at once.
    """
    problems = examples(dataset)
    trainings = [_training(problems, split, settings) for split in SPLITS]
    fits = splits.fit_all(trainings, parallel, NAME)
    _model(trainings[0], fits["random"][ACTION]).save(directory)
    classes = {ACTION: dataset.encoding.signature.instructions}
    return TrainingReport.of(NAME, settings.seed, len(problems), classes, fits)


def train_split(dataset: Dataset, settings: TrainRelational, split: str) -> Model:
    """The network with one split, in this process; for studies, which train many policies.

    Raises:
        InputError: too few problems to split, or a training that diverges at once.
    """
    training = _training(examples(dataset), split, settings)
    return _model(training, splits.fit(training))


def _training(problems: Examples, split: str, settings: TrainRelational) -> _Training:
    validation = splits.held_out_samples(problems.configuration, split, settings)
    splits.require_both_sides(validation, "train_relational", "problems", split)
    return _Training(split, problems, validation, settings)


def _model(training: _Training, result: Fit) -> Model:
    settings = {"samples": len(training.problems), **training.settings.model_dump()}
    return Model(result.weights, settings)
