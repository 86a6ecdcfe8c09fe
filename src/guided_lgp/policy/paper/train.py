"""Trains a network: its sub-policies, side by side (paper, Sec. II-A and Appendix)."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from guided_lgp.errors import InputError
from guided_lgp.params import Network, Parallel, TrainPolicy
from guided_lgp.policy import splits
from guided_lgp.policy.arrays import BoolArray
from guided_lgp.policy.paper.dataset import Dataset
from guided_lgp.policy.paper.model import Model
from guided_lgp.policy.paper.training import Fit, fit
from guided_lgp.policy.splits import SPLITS, TrainingReport


@dataclass(frozen=True)
class _Training:
    """One sub-policy to train."""

    network: str
    sub_policy: str
    split: str
    dataset: Dataset
    validation: BoolArray
    """(N,) the samples of the data set that are for validation."""
    settings: Network
    patience: int
    seed: np.random.SeedSequence

    def fit(self) -> Fit:
        samples = self.dataset.of_network(self.network)
        held_out = self.validation[samples]
        return fit(
            training=self.dataset.tensors(self.network, self.sub_policy, samples[~held_out]),
            validation=self.dataset.tensors(self.network, self.sub_policy, samples[held_out]),
            classes=self.dataset.encoding.classes(self.sub_policy),
            settings=self.settings,
            patience=self.patience,
            seed=self.seed,
        )


def train_network(
    network: str,
    dataset: Dataset,
    settings: TrainPolicy,
    parallel: Parallel,
    directory: Path,
) -> TrainingReport:
    """Train the sub-policies of a network and save it.

    Args:
        network: ``instruction``, or the name of one.
        dataset: the training samples.
        settings: of training (paper, Table IV).
        parallel: back end and workers; the result does not depend on them.
        directory: for ``<network>.safetensors`` and ``<network>.json``.

    Raises:
        InputError: too few samples to split, or a training that diverges at once.
    """
    trainings = [t for split in SPLITS for t in _trainings(network, dataset, settings, split)]
    fits = splits.fit_all(trainings, parallel, network)
    _model(network, dataset, settings, fits["random"]).save(directory)
    classes = {name: dataset.class_names(name) for name in dataset.encoding.chains[network]}
    samples = len(dataset.of_network(network))
    return TrainingReport.of(network, settings.seed, samples, classes, fits)


def train_model(network: str, dataset: Dataset, settings: TrainPolicy, split: str) -> Model:
    """One network in this process; for studies, which train many side by side.

    Args:
        network: ``instruction``, or the name of one.
        dataset: the training samples.
        settings: of training.
        split: the one of :data:`SPLITS` that decides about the weights.

    Raises:
        InputError: too few samples to split, or a training that diverges at once.
    """
    trainings = _trainings(network, dataset, settings, split)
    fits = {training.sub_policy: splits.fit(training) for training in trainings}
    return _model(network, dataset, settings, fits)


def _trainings(
    network: str, dataset: Dataset, settings: TrainPolicy, split: str
) -> list[_Training]:
    networks = list(dataset.encoding.chains)
    if sorted(settings.networks) != sorted(networks):
        found = ", ".join(settings.networks)
        raise InputError(
            "params.yaml: train_policy", f"has the networks {found}", ", ".join(networks)
        )
    configuration = dataset.configuration[dataset.sample_state]
    validation = splits.held_out_samples(configuration, split, settings)
    samples = f"samples of the network {network}"
    held_out = validation[dataset.of_network(network)]
    splits.require_both_sides(held_out, "train_policy", samples, split)
    return [
        _Training(
            network=network,
            sub_policy=sub_policy,
            split=split,
            dataset=dataset,
            validation=validation,
            settings=settings.networks[network],
            patience=settings.patience,
            seed=np.random.SeedSequence([settings.seed, networks.index(network), index]),
        )
        for index, sub_policy in enumerate(dataset.encoding.chains[network])
    ]


def _model(network: str, dataset: Dataset, settings: TrainPolicy, fits: Mapping[str, Fit]) -> Model:
    own = settings.networks[network]
    samples = len(dataset.of_network(network))
    return Model(
        network=network,
        encoding=dataset.encoding,
        sub_policies={name: fits[name].layers for name in dataset.encoding.chains[network]},
        training={"seed": settings.seed, "samples": samples, **own.model_dump()},
    )
