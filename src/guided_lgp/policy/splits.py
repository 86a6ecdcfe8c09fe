"""Trainings of a policy with either choice of validation samples, and the report on them."""

import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from guided_lgp.documents import write_json
from guided_lgp.errors import InputError
from guided_lgp.parallel import run
from guided_lgp.params import Parallel, TrainPolicy, TrainRelational
from guided_lgp.policy.arrays import BoolArray
from guided_lgp.policy.training import Learning

SPLITS = ("random", "configuration")
"""How validation samples are chosen. The paper's random choice decides about the weights that are
saved; since it puts copies and neighbours of a sample on both sides, the same training is repeated
with whole configurations held out, for the report alone."""

Result = TypeVar("Result", bound=Learning, covariant=True)
Fits = Mapping[str, Mapping[str, Result]]
"""By split, then by sub-policy."""

logger = logging.getLogger(__name__)


class Training(Protocol[Result]):
    """One network to train: a picklable value, so that it can run in any process."""

    @property
    def network(self) -> str:
        """The network that it belongs to."""
        ...

    @property
    def sub_policy(self) -> str:
        """The part of the network."""
        ...

    @property
    def split(self) -> str:
        """One of :data:`SPLITS`."""
        ...

    def fit(self) -> Result:
        """Train; the result depends on this value alone."""
        ...


def fit(training: Training[Result]) -> Result:
    """Train, and log how it went."""
    result = training.fit()
    name = f"{training.network}.{training.sub_policy}.{training.split}"
    logger.info("%s: %s", name, result)
    return result


def fit_all(trainings: Iterable[Training[Result]], parallel: Parallel, name: str) -> Fits[Result]:
    """Train all in one pool of processes; the result does not depend on their number."""
    trainings = list(trainings)
    fits: dict[str, dict[str, Result]] = {}
    for training, result in zip(
        trainings, run(fit, trainings, parallel, f"training {name}"), strict=True
    ):
        fits.setdefault(training.split, {})[training.sub_policy] = result
    return fits


def held_out_samples(
    configuration: NDArray[np.integer], split: str, settings: TrainPolicy | TrainRelational
) -> BoolArray:
    """(N,) the samples for validation, of N samples of which (N,) configurations are given."""
    rng = np.random.default_rng(np.random.SeedSequence([settings.seed, SPLITS.index(split)]))
    unit = np.arange(len(configuration)) if split == "random" else configuration
    units = np.unique(unit)
    count = max(1, round(settings.validation_share * len(units)))
    return np.isin(unit, rng.permutation(units)[:count])


def require_both_sides(held_out: BoolArray, stage: str, samples: str, split: str) -> None:
    """Check that there are samples to train on and others to validate with.

    Raises:
        InputError: all or none are held out.
    """
    if held_out.all() or not held_out.any():
        raise InputError(
            f"{stage}.validation_share",
            f"{np.count_nonzero(held_out)} of {len(held_out)} {samples} for validation "
            f"(split: {split})",
            "a share that leaves samples on both sides; or more configurations",
        )


@dataclass(frozen=True)
class TrainingReport:
    """What came out of training one network."""

    network: str
    seed: int
    samples: int
    """Of this network, training and validation."""
    sub_policies: Mapping[str, Mapping[str, Any]]
    """By sub-policy: classes, accuracy and loss (nats) on validation at the best epoch, epochs
    trained, best epoch, curves, confusion; the same under ``by_configuration`` for that split."""

    @classmethod
    def of(
        cls,
        network: str,
        seed: int,
        samples: int,
        classes: Mapping[str, Sequence[str]],
        fits: Fits[Learning],
    ) -> "TrainingReport":
        """Report on trainings with both splits; ``classes`` are the names by sub-policy."""
        figures = {
            name: {
                "classes": names,
                **fits["random"][name].figures(),
                "by_configuration": fits["configuration"][name].figures(),
            }
            for name, names in classes.items()
        }
        return cls(network, seed, samples, figures)

    def save(self, path: Path) -> None:
        """Write the report as JSON."""
        document = {
            "version": 1,
            "network": self.network,
            "seed": self.seed,
            "samples": self.samples,
            "sub_policies": self.sub_policies,
        }
        write_json(path, document)
