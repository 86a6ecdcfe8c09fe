"""The relational network in training."""

from collections.abc import Iterator
from dataclasses import dataclass
from math import ceil

import numpy as np
import torch
from torch import Tensor
from torch.optim import Adam, Optimizer
from torch.optim.lr_scheduler import CosineAnnealingLR

from guided_lgp.params import TrainRelational
from guided_lgp.policy.arrays import IntArray
from guided_lgp.policy.relational.encoding import Range, graphs
from guided_lgp.policy.relational.geometry import BLIND, Sight
from guided_lgp.policy.relational.heads import heads
from guided_lgp.policy.relational.model import Weights
from guided_lgp.policy.relational.network import RelationalNetwork
from guided_lgp.policy.relational.samples import Examples
from guided_lgp.policy.training import (
    Learning,
    PolicyModule,
    confusion_matrix,
    one_quiet_thread,
    train,
)

Batch = tuple[Tensor, Tensor, Tensor, Tensor, Tensor, Tensor]
"""Nodes, edges, held; applicable, right and wrong actions, the applicable ones by head, too."""


class Batches:
    """All examples in mini-batches, in an order drawn anew for every epoch if given a generator."""

    def __init__(
        self,
        examples: Examples,
        limits: Range,
        size: int,
        rng: np.random.Generator | None = None,
        sight: Sight = BLIND,
    ) -> None:
        inputs = graphs(examples.situations, limits, sight)
        wrong = np.zeros_like(examples.right) if examples.wrong is None else examples.wrong
        allowed = [
            head.applicable(examples.situations, inputs) for head in heads(examples.domain).values()
        ]
        labels = np.stack(allowed, 1), examples.right, wrong
        arrays = (inputs.nodes, inputs.edges, inputs.held, *labels)
        self._tensors = [torch.from_numpy(array) for array in arrays]
        self._count, self._size, self._rng = len(examples), size, rng

    def __len__(self) -> int:
        return ceil(self._count / self._size)

    def __iter__(self) -> Iterator[Batch]:
        order = np.arange(self._count) if self._rng is None else self._rng.permutation(self._count)
        for rows in torch.split(torch.from_numpy(order), self._size):
            nodes, edges, held, allowed, right, wrong = (tensor[rows] for tensor in self._tensors)
            yield nodes, edges, held, allowed, right, wrong


class RelationalModule(PolicyModule):
    """Adam on the cross-entropy between the right actions, each as probable, and the policy.

    Where actions are known to be infeasible, the logarithm of the probability that the policy
    chooses none of them is added.
    """

    def __init__(self, network: RelationalNetwork, settings: TrainRelational) -> None:
        super().__init__()
        self.network = network
        self._settings = settings

    def configure_optimizers(self) -> tuple[list[Optimizer], list[CosineAnnealingLR]]:
        """Adam with L2 regularisation; the learning rate falls to zero along a cosine."""
        optimizer = Adam(
            self.network.parameters(), self._settings.lr, weight_decay=self._settings.l2, fused=True
        )
        schedule = CosineAnnealingLR(optimizer, self._settings.epochs)
        return [optimizer], [schedule]

    def training_step(self, batch: Batch, index: int) -> Tensor:
        """Loss of a mini-batch."""
        return self._loss("training", batch)

    def validation_step(self, batch: Batch, index: int) -> None:
        """Loss and accuracy on the validation examples."""
        self._loss("validation", batch)

    def _loss(self, split: str, batch: Batch) -> Tensor:
        log_p, (right, wrong) = log_probabilities(self.network, batch), batch[-2:]
        right, wrong = right.flatten(1), wrong.flatten(1)
        shares = right / right.sum(1, keepdim=True)
        loss = -(shares * log_p.masked_fill(~right, 0)).sum(1).mean()
        if wrong.any():
            failing = log_p.exp().masked_fill(~wrong, 0).sum(1).clamp(max=_SURE)
            loss = loss - torch.log1p(-failing).mean()
        hits = right.gather(1, log_p.argmax(1, keepdim=True)).float().sum()
        self.count(split, len(right), loss.item(), hits.item())
        return loss


_SURE = 0.999
"""More probable than this, an infeasible action costs no more: the logarithm has no end."""


def log_probabilities(network: RelationalNetwork, batch: Batch) -> Tensor:
    """(B, G · T) log-probability of every action; minus infinity where it is not applicable."""
    nodes, edges, held, allowed, *_ = batch
    count, grippers = held.shape
    per_gripper = edges[:, None].expand(-1, grippers, -1, -1, -1)
    scores = network(nodes.flatten(0, 1), per_gripper.flatten(0, 1), held.flatten())
    by_head = scores.view(count, grippers, *scores.shape[1:]).transpose(1, 2)
    chosen = by_head[:, 0]  # no two instructions are applicable to one target at a time
    for head in range(1, allowed.shape[1]):
        chosen = torch.where(allowed[:, head], by_head[:, head], chosen)
    masked = chosen.masked_fill(~allowed.any(1), -torch.inf)
    return torch.log_softmax(masked.flatten(1), dim=1)


@dataclass(frozen=True)
class Fit(Learning):
    """A trained network.

    Its accuracy is the share of problems whose most probable action is one of the right ones, its
    classes are the instructions: of the most probable right action, and of the most probable one.
    """

    weights: Weights


def fit(
    training: Examples,
    validation: Examples,
    settings: TrainRelational,
    seed: np.random.SeedSequence,
    sight: Sight = BLIND,
) -> Fit:
    """Train a network until its validation loss stops falling.

    The result depends on the arguments alone: one thread, and random streams of its own.

    Raises:
        InputError: the validation loss was never finite.
    """
    weights, order = seed.spawn(2)
    limits = Range.of(training.situations)
    batches = Batches(training, limits, settings.batch, np.random.default_rng(order), sight)
    held_out = Batches(validation, limits, settings.batch, sight=sight)
    with one_quiet_thread(), torch.random.fork_rng(devices=[]):
        torch.manual_seed(int(weights.generate_state(1)[0]))
        network = RelationalNetwork(settings.width, settings.rounds, heads(training.domain), sight)
        module = RelationalModule(network, settings)
        best_epoch = train(module, batches, held_out, settings.epochs, settings.patience)
        confusion = _confusion(network, held_out, len(network.heads))
    tensors = {name: part.numpy().copy() for name, part in network.state_dict().items()}
    return Fit(
        weights=Weights(limits, tensors, training.domain, sight),
        best_epoch=best_epoch,
        curves=module.curves,
        confusion=confusion,
    )


@torch.no_grad()
def _confusion(network: RelationalNetwork, batches: Batches, count: int) -> IntArray:
    confusion = np.zeros((count, count), dtype=np.int64)
    for batch in batches:
        log_p, allowed, right = log_probabilities(network, batch), batch[3], batch[4]
        head = allowed.int().argmax(1).flatten(1)
        truth = log_p.masked_fill(~right.flatten(1), -torch.inf).argmax(1, keepdim=True)
        chosen = log_p.argmax(1, keepdim=True)
        confusion += confusion_matrix(
            head.gather(1, truth).flatten(), head.gather(1, chosen).flatten(), count
        )
    return confusion
