"""The training loop of all policies: mini-batches, early stopping, learning curves, in Lightning.

A policy gives a :class:`PolicyModule`, which knows its network, its step and its loss, and its
samples in batches; :func:`train` does the rest.
"""

import logging
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import lightning
import numpy as np
import torch
from lightning.pytorch.callbacks import Callback, EarlyStopping
from torch import Tensor

from guided_lgp.errors import InputError
from guided_lgp.policy.arrays import IntArray

CURVES = ("training_loss", "training_accuracy", "validation_loss", "validation_accuracy")


class PolicyModule(lightning.LightningModule):
    """A network in training: keeps the curves, and logs the loss by which training stops.

    A subclass has the steps ``training_step`` and ``validation_step`` and hands what comes out of
    each batch to :meth:`count`.
    """

    def __init__(self) -> None:
        super().__init__()
        self.curves: dict[str, list[float]] = {name: [] for name in CURVES}
        self._sums = {"training": np.zeros(3), "validation": np.zeros(3)}

    def count(self, split: str, samples: int, loss: float, hits: float) -> None:
        """Add a batch to the curves.

        Args:
            split: ``training`` or ``validation``.
            samples: in the batch.
            loss: its mean over them (nats).
            hits: how many of them are decided correctly.
        """
        self._sums[split] += (samples, loss * samples, hits)

    def on_train_epoch_end(self) -> None:
        """Note the curves; Lightning validates before this is called."""
        self._note("training")

    def on_validation_epoch_end(self) -> None:
        """Note the curves, and log the loss."""
        self._note("validation")
        self.log("validation_loss", self.curves["validation_loss"][-1])

    def _note(self, split: str) -> None:
        samples, loss, hits = self._sums[split].tolist()
        self.curves[f"{split}_loss"].append(loss / samples)
        self.curves[f"{split}_accuracy"].append(hits / samples)
        self._sums[split][:] = 0


class BestParameters(Callback):
    """Keeps the parameters of the epoch with the lowest validation loss and restores them."""

    def __init__(self) -> None:
        self.epoch = -1
        self._loss = np.inf
        self._parameters: dict[str, Tensor] = {}

    def on_validation_end(self, trainer: lightning.Trainer, module: Any) -> None:
        """Keep the parameters if they are the best so far."""
        loss = module.curves["validation_loss"][-1]
        if loss < self._loss:
            self._loss, self.epoch = loss, len(module.curves["validation_loss"]) - 1
            self._parameters = {name: part.clone() for name, part in module.state_dict().items()}

    def on_train_end(self, trainer: lightning.Trainer, module: Any) -> None:
        """Restore the best parameters."""
        if self.epoch >= 0:
            module.load_state_dict(self._parameters)


def train(
    module: PolicyModule,
    training: Iterable[Any],
    validation: Iterable[Any],
    epochs: int,
    patience: int,
) -> int:
    """Train a module until its validation loss stops falling; it gets its best parameters back.

    Args:
        module: the network in training.
        training: batches; iterated anew in every epoch.
        validation: batches.
        epochs: at most.
        patience: epochs without a lower validation loss before training stops.

    Returns:
        The best epoch, from 1.

    Raises:
        InputError: the validation loss was never finite.
    """
    best = BestParameters()
    lightning.Trainer(
        accelerator="cpu",
        devices=1,
        max_epochs=epochs,
        callbacks=[best, EarlyStopping("validation_loss", patience=patience)],
        logger=False,  # the curves are part of the result, and MLflow gets them from there
        num_sanity_val_steps=0,
        enable_checkpointing=False,
        enable_progress_bar=False,
        enable_model_summary=False,
    ).fit(module, training, validation)
    if best.epoch < 0:
        raise InputError("params.yaml: lr", "the loss is not finite", "a smaller learning rate")
    return best.epoch + 1


@dataclass(frozen=True)
class Learning:
    """How a training went."""

    best_epoch: int
    """From 1; the epoch of the lowest validation loss, whose weights are kept."""
    curves: Mapping[str, list[float]]
    """Loss (nats) and accuracy per epoch; of training with dropout, of validation without."""
    confusion: IntArray
    """(classes, classes) validation samples by true class (row) and most probable class."""

    def figures(self) -> dict[str, Any]:
        """The JSON document: accuracy and loss on validation at the best epoch, and all else."""
        return {
            "accuracy": self.curves["validation_accuracy"][self.best_epoch - 1],
            "loss": self.curves["validation_loss"][self.best_epoch - 1],
            "epochs": len(self.curves["validation_loss"]),
            "best_epoch": self.best_epoch,
            "confusion": self.confusion.tolist(),
            "curves": self.curves,
        }

    def __str__(self) -> str:
        return (
            "validation loss {loss:.3f}, accuracy {accuracy:.4f} at epoch {best_epoch} of {epochs}"
        ).format(**self.figures())


def confusion_matrix(truth: Tensor, chosen: Tensor, classes: int) -> IntArray:
    """(classes, classes) how often a class was true (row) and chosen (column)."""
    cells = torch.bincount(truth * classes + chosen, minlength=classes**2)
    matrix: IntArray = cells.view(classes, classes).numpy()
    return matrix


@contextmanager
def one_quiet_thread() -> Iterator[None]:
    """One thread, and no hints from Lightning about hardware, data loaders or its services."""
    threads, messages = torch.get_num_threads(), logging.getLogger("lightning.pytorch")
    level = messages.level
    torch.set_num_threads(1)
    messages.setLevel(logging.WARNING)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", module="lightning")
            yield
    finally:
        messages.setLevel(level)
        torch.set_num_threads(threads)
