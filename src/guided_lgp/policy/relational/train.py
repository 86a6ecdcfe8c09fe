"""Trains the relational policy from the samples of the paper's networks."""

import logging
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from guided_lgp.errors import InputError
from guided_lgp.parallel import run
from guided_lgp.params import Parallel, TrainRelational
from guided_lgp.policy.dataset import Dataset
from guided_lgp.policy.encoding import INSTRUCTIONS
from guided_lgp.policy.relational.encoding import BoolArray
from guided_lgp.policy.relational.model import NAME, Model
from guided_lgp.policy.relational.samples import Examples, examples
from guided_lgp.policy.relational.training import Fit, fit
from guided_lgp.policy.train import SPLITS, TrainingReport, held_out_samples

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class _Task:
    split: str
    problems: Examples
    validation: BoolArray
    """(N,) the problems for validation."""
    settings: TrainRelational


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
    tasks = [_task(problems, split, settings) for split in SPLITS]
    fits = dict(zip(SPLITS, run(_train, tasks, parallel, "training relational"), strict=True))
    _model(tasks[0], fits["random"]).save(directory)
    return TrainingReport(
        network=NAME,
        seed=settings.seed,
        samples=len(problems),
        sub_policies={
            "action": {
                "classes": INSTRUCTIONS,
                **fits["random"].figures(),
                "by_configuration": fits["configuration"].figures(),
            }
        },
    )


def train_split(dataset: Dataset, settings: TrainRelational, split: str) -> Model:
    """The network with one split, in this process; for studies, which train many policies.

    Raises:
        InputError: too few problems to split, or a training that diverges at once.
    """
    task = _task(examples(dataset), split, settings)
    return _model(task, _train(task))


def _task(problems: Examples, split: str, settings: TrainRelational) -> _Task:
    task = _Task(
        split, problems, held_out_samples(problems.configuration, split, settings), settings
    )
    held_out = np.count_nonzero(task.validation)
    if not 0 < held_out < len(problems):
        raise InputError(
            "train_relational.validation_share",
            f"{held_out} of {len(problems)} problems for validation (split: {split})",
            "a share that leaves problems on both sides; or more configurations",
        )
    return task


def _model(task: _Task, result: Fit) -> Model:
    training = {"samples": len(task.problems), **task.settings.model_dump()}
    return Model(result.weights, training)


def _train(task: _Task) -> Fit:
    result = fit(
        task.problems[~task.validation],
        task.problems[task.validation],
        task.settings,
        np.random.SeedSequence([task.settings.seed, len(SPLITS)]),
    )
    logger.info("%s.%s: %s", NAME, task.split, result)
    return result
