"""Trains a network: its sub-policies, side by side (paper, Sec. II-A and Appendix)."""

import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from guided_lgp.documents import write_json
from guided_lgp.errors import InputError
from guided_lgp.parallel import run
from guided_lgp.params import Network, Parallel, TrainPolicy, TrainRelational
from guided_lgp.policy.dataset import Dataset
from guided_lgp.policy.encoding import CHAINS
from guided_lgp.policy.models import Model
from guided_lgp.policy.training import Fit, fit

SPLITS = ("random", "configuration")
"""How validation samples are chosen. The paper's random choice decides about the weights that are
saved; since it puts copies and neighbours of a sample on both sides, the same training is repeated
with whole configurations held out, for the report alone."""

BoolArray = NDArray[np.bool_]

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class TrainingReport:
    """What came out of training one network."""

    network: str
    seed: int
    samples: int
    """Of this network, training and validation."""
    sub_policies: Mapping[str, Mapping[str, Any]]
    """By sub-policy: accuracy and loss (nats) on validation at the best epoch, epochs trained,
    best epoch, curves, confusion; the same under ``by_configuration`` for that split."""

    def document(self) -> dict[str, Any]:
        """The JSON document of the report."""
        return {
            "version": 1,
            "network": self.network,
            "seed": self.seed,
            "samples": self.samples,
            "sub_policies": self.sub_policies,
        }

    def save(self, path: Path) -> None:
        """Write the report as JSON."""
        write_json(path, self.document())


@dataclass(frozen=True)
class _Task:
    network: str
    sub_policy: str
    split: str
    dataset: Dataset
    validation: BoolArray
    """(N,) the samples of the data set that are for validation."""
    settings: Network
    patience: int
    seed: np.random.SeedSequence

    @property
    def name(self) -> str:
        return f"{self.network}.{self.sub_policy}.{self.split}"


def train_network(
    network: str,
    dataset: Dataset,
    settings: TrainPolicy,
    parallel: Parallel,
    directory: Path,
) -> TrainingReport:
    """Train the sub-policies of a network and save it.

    Args:
        network: ``instruction``, ``grasp`` or ``place``.
        dataset: the training samples.
        settings: of training (paper, Table IV).
        parallel: back end and workers; the result does not depend on them.
        directory: for ``<network>.safetensors`` and ``<network>.json``.

    Raises:
        InputError: too few samples to split, or a training that diverges at once.
    """
    tasks = [task for split in SPLITS for task in _tasks(network, dataset, settings, split)]
    fits = run(_train, tasks, parallel, f"training {network}")
    results = {(task.split, task.sub_policy): f for task, f in zip(tasks, fits, strict=True)}
    model = _model(network, dataset, settings, {n: results["random", n] for n in CHAINS[network]})
    model.save(directory)
    return TrainingReport(
        network=network,
        seed=settings.seed,
        samples=len(dataset.of_network(network)),
        sub_policies={
            name: {
                "classes": dataset.class_names(name),
                **results["random", name].figures(),
                "by_configuration": results["configuration", name].figures(),
            }
            for name in CHAINS[network]
        },
    )


def train_model(network: str, dataset: Dataset, settings: TrainPolicy, split: str) -> Model:
    """One network in this process; for studies, which train many side by side.

    Args:
        network: ``instruction``, ``grasp`` or ``place``.
        dataset: the training samples.
        settings: of training.
        split: the one of :data:`SPLITS` that decides about the weights.

    Raises:
        InputError: too few samples to split, or a training that diverges at once.
    """
    tasks = _tasks(network, dataset, settings, split)
    return _model(network, dataset, settings, {task.sub_policy: _train(task) for task in tasks})


def _tasks(network: str, dataset: Dataset, settings: TrainPolicy, split: str) -> list[_Task]:
    configuration = dataset.configuration[dataset.sample_state]
    validation = held_out_samples(configuration, split, settings)
    held_out = validation[dataset.of_network(network)]
    if held_out.all() or not held_out.any():
        raise InputError(
            "train_policy.validation_share",
            f"{np.count_nonzero(held_out)} of {len(held_out)} samples of the network {network} "
            f"for validation (split: {split})",
            "a share that leaves samples on both sides; or more configurations",
        )
    return [
        _Task(
            network=network,
            sub_policy=sub_policy,
            split=split,
            dataset=dataset,
            validation=validation,
            settings=getattr(settings, network),
            patience=settings.patience,
            seed=np.random.SeedSequence([settings.seed, list(CHAINS).index(network), index]),
        )
        for index, sub_policy in enumerate(CHAINS[network])
    ]


def _model(network: str, dataset: Dataset, settings: TrainPolicy, fits: Mapping[str, Fit]) -> Model:
    own: Network = getattr(settings, network)
    samples = len(dataset.of_network(network))
    return Model(
        network=network,
        encoding=dataset.encoding,
        sub_policies={name: fits[name].layers for name in CHAINS[network]},
        training={"seed": settings.seed, "samples": samples, **own.model_dump()},
    )


def _train(task: _Task) -> Fit:
    samples = task.dataset.of_network(task.network)
    held_out = task.validation[samples]
    result = fit(
        training=task.dataset.tensors(task.network, task.sub_policy, samples[~held_out]),
        validation=task.dataset.tensors(task.network, task.sub_policy, samples[held_out]),
        classes=task.dataset.encoding.classes(task.sub_policy),
        settings=task.settings,
        patience=task.patience,
        seed=task.seed,
    )
    logger.info("%s: %s", task.name, result)
    return result


def held_out_samples(
    configuration: NDArray[np.integer], split: str, settings: TrainPolicy | TrainRelational
) -> BoolArray:
    """(N,) the samples for validation, of N samples of which (N,) configurations are given."""
    rng = np.random.default_rng(np.random.SeedSequence([settings.seed, SPLITS.index(split)]))
    unit = np.arange(len(configuration)) if split == "random" else configuration
    units = np.unique(unit)
    count = max(1, round(settings.validation_share * len(units)))
    return np.isin(unit, rng.permutation(units)[:count])
