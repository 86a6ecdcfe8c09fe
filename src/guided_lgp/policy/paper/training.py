"""One sub-policy in training (paper, Appendix).

Lightning runs the epochs, as for every policy. An epoch is one step to it: the mini-batches of a
hundred samples take less time than Lightning and an optimiser object spend around each.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor
from torch.nn import functional
from torch.optim.adam import adam

from guided_lgp.params import Network
from guided_lgp.policy.arrays import FloatArray, IntArray
from guided_lgp.policy.paper.model import Layers
from guided_lgp.policy.paper.network import Classifier
from guided_lgp.policy.training import (
    Learning,
    PolicyModule,
    confusion_matrix,
    one_quiet_thread,
    train,
)

Samples = tuple[FloatArray, IntArray]
"""Inputs (n, inputs) and classes (n,)."""


class WholeTensors:
    """Yields all samples at once, shuffled anew for every epoch if given a generator.

    A DataLoader would fetch and collate 128 samples at a time in Python; here an epoch is one
    gather, and :class:`SubPolicy` takes views of it as mini-batches.
    """

    def __init__(self, samples: Samples, rng: np.random.Generator | None = None) -> None:
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


class SubPolicy(PolicyModule):
    """A classifier trained by Adam on the cross-entropy with L2 regularisation.

    The L2 term is w/2 · |parameters|², added to the loss before Adam scales the gradient
    (``weight_decay`` of Adam; AdamW's decoupled decay would be another method than the paper's).
    """

    def __init__(self, classifier: Classifier, settings: Network) -> None:
        super().__init__()
        self.automatic_optimization = False
        self.classifier = classifier
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
        self._count("training", logits, classes)

    def validation_step(self, batch: tuple[Tensor, Tensor], index: int) -> None:
        """Loss and accuracy on the validation samples, without dropout."""
        inputs, classes = batch
        self._count("validation", self.classifier(inputs), classes)

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

    def _count(self, split: str, logits: Tensor, classes: Tensor) -> None:
        loss = functional.cross_entropy(logits, classes).item()
        accuracy = (logits.argmax(1) == classes).float().mean().item()  # 32 bits are what is kept
        self.count(split, len(classes), loss, accuracy * len(classes))


@dataclass(frozen=True)
class Fit(Learning):
    """A trained classifier."""

    layers: Layers


def fit(
    training: Samples,
    validation: Samples,
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
    return Fit(
        layers=module.classifier.layers(),
        best_epoch=best_epoch,
        curves=module.curves,
        confusion=confusion_matrix(truth, chosen, classes),
    )
