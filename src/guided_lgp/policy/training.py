"""One sub-policy in Lightning: mini-batches, early stopping, learning curves (paper, Appendix)."""

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
from numpy.typing import NDArray
from torch import Tensor
from torch.nn import functional
from torch.optim.adam import adam

from guided_lgp.errors import InputError
from guided_lgp.params import Network
from guided_lgp.policy.models import Layers
from guided_lgp.policy.networks import Classifier

_CURVES = ("training_loss", "training_accuracy", "validation_loss", "validation_accuracy")
Split = tuple[NDArray[np.float32], NDArray[np.int64]]
"""Inputs (n, inputs) and classes (n,)."""


class WholeTensors:
    """Yields all samples at once, shuffled anew for every epoch if given a generator.

    A DataLoader would fetch and collate 128 samples at a time in Python; here an epoch is one
    gather, and :class:`SubPolicy` takes views of it as mini-batches.
    """

    def __init__(self, samples: Split, rng: np.random.Generator | None = None) -> None:
        self._inputs, self._classes = (torch.from_numpy(array) for array in samples)
        self._rng = rng

    def __len__(self) -> int:
        return 1

    def __iter__(self) -> Iterator[tuple[Tensor, Tensor]]:
        if self._rng is None:
            yield self._inputs, self._classes
        else:
            order = torch.from_numpy(self._rng.permutation(len(self._classes)))
            yield self._inputs[order], self._classes[order]


class SubPolicy(lightning.LightningModule):
    """A classifier trained by Adam on the cross-entropy with L2 regularisation.

    The L2 term is w/2 · |parameters|², added to the loss before Adam scales the gradient
    (``weight_decay`` of Adam; AdamW's decoupled decay would be another method than the paper's).
    """

    def __init__(self, classifier: Classifier, settings: Network) -> None:
        super().__init__()
        self.automatic_optimization = False
        self.classifier = classifier
        self.curves: dict[str, list[float]] = {name: [] for name in _CURVES}
        self._settings = settings
        self._moments = [torch.zeros_like(classifier.parameter) for _ in range(2)]
        self._step = torch.zeros(())

    def configure_optimizers(self) -> None:
        """None: :meth:`training_step` updates the parameters itself."""

    @torch.inference_mode()
    def training_step(self, batch: tuple[Tensor, Tensor], index: int) -> None:
        """One epoch of mini-batches; the curves are computed once from the collected logits."""
        inputs, classes = batch
        targets = functional.one_hot(classes, self.classifier.sizes[-1]).to(inputs.dtype)
        logits = torch.empty_like(targets)
        size = self._settings.batch
        parts = (torch.split(tensor, size) for tensor in (inputs, targets, logits))
        for batch_inputs, batch_targets, batch_logits in zip(*parts, strict=True):
            batch_logits.copy_(self.classifier.descend(batch_inputs, batch_targets))
            self._update()
        self._record("training", logits, classes)

    def validation_step(self, batch: tuple[Tensor, Tensor], index: int) -> None:
        """Loss and accuracy on the validation samples, without dropout."""
        inputs, classes = batch
        self._record("validation", self.classifier(inputs), classes)

    def _update(self) -> None:
        mean, square = self._moments
        adam(  # the functional form: the optimiser object costs as much again per step
            [self.classifier.parameter.data],
            [self.classifier.gradient],
            [mean],
            [square],
            [],
            [self._step],
            fused=True,
            amsgrad=False,
            beta1=0.9,
            beta2=0.999,
            lr=self._settings.lr,
            weight_decay=self._settings.l2,
            eps=1e-8,
            maximize=False,
        )

    def _record(self, split: str, logits: Tensor, classes: Tensor) -> None:
        figures = {
            f"{split}_loss": functional.cross_entropy(logits, classes),
            f"{split}_accuracy": (logits.argmax(1) == classes).float().mean(),
        }
        self.log_dict(figures, on_step=False, on_epoch=True, batch_size=len(classes))
        for name, value in figures.items():
            self.curves[name].append(value.item())


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


@dataclass(frozen=True)
class Learning:
    """How a training went."""

    best_epoch: int
    """From 1; the epoch of the lowest validation loss, whose weights are kept."""
    curves: Mapping[str, list[float]]
    """Loss (nats) and accuracy per epoch; of training with dropout, of validation without."""
    confusion: NDArray[np.int64]
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


@dataclass(frozen=True)
class Fit(Learning):
    """A trained classifier."""

    layers: Layers


def fit(
    training: Split,
    validation: Split,
    classes: int,
    settings: Network,
    patience: int,
    seed: np.random.SeedSequence,
) -> Fit:
    """Train one classifier until its validation loss stops falling.

    The result depends on the arguments alone: one thread, and random streams of its own.

    Args:
        training: samples to learn from.
        validation: samples for early stopping.
        classes: number of classes.
        settings: architecture and optimiser (paper, Table IV).
        patience: epochs without a lower validation loss before training stops.
        seed: of the weights, dropout and the order of the samples.

    Raises:
        InputError: the validation loss was never finite.
    """
    weights, order = (np.random.Generator(np.random.SFC64(child)) for child in seed.spawn(2))
    sizes = [training[0].shape[1], *[settings.nodes] * settings.layers, classes]
    module = SubPolicy(Classifier(sizes, settings.dropout, weights), settings)
    with one_quiet_thread():
        samples = WholeTensors(training, order), WholeTensors(validation)
        best_epoch = train(module, *samples, settings.epochs, patience)
        inputs, truth = map(torch.from_numpy, validation)
        chosen = module.classifier(inputs).argmax(1)
    confusion = torch.bincount(truth * classes + chosen, minlength=classes**2)
    return Fit(
        layers=module.classifier.layers(),
        best_epoch=best_epoch,
        curves=module.curves,
        confusion=confusion.view(classes, classes).numpy(),
    )


def train(
    module: lightning.LightningModule,
    training: Iterable[Any],
    validation: Iterable[Any],
    epochs: int,
    patience: int,
) -> int:
    """Train a module until its ``validation_loss`` stops falling; it gets its best parameters back.

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
