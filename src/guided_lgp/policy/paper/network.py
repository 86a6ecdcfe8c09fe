"""The sub-policies: feed-forward classifiers (paper, Table IV).

Training them takes about a million small optimiser steps, in which the overhead of automatic
differentiation and the random numbers of dropout outweigh the arithmetic. :class:`Classifier`
therefore keeps its parameters in one vector and computes the gradient of its few layers in closed
form; the tests compare it with automatic differentiation.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import torch
from torch import Tensor, nn

from guided_lgp.policy.paper.model import Layers

_RESOLUTION = 1 << 16
"""Dropout compares 16 random bits per node with its rate."""


class Classifier(nn.Module):
    """Layers of rectified linear nodes with dropout, and a linear layer to the logits."""

    def __init__(self, sizes: Sequence[int], dropout: float, rng: np.random.Generator) -> None:
        """Initialise uniformly within ± 1/sqrt(inputs of the layer).

        Args:
            sizes: inputs, nodes of each hidden layer, classes.
            dropout: the share of hidden nodes that a training step leaves out.
            rng: for the initial weights and for dropout.
        """
        super().__init__()
        self.sizes = tuple(sizes)
        self._dropout = dropout
        self._threshold = round(dropout * _RESOLUTION) - _RESOLUTION // 2
        self._rng = rng
        bounds = [
            np.full((inputs + 1) * outputs, inputs**-0.5) for inputs, outputs in pairwise(sizes)
        ]
        initial = rng.uniform(-1, 1, size=sum(map(len, bounds))) * np.concatenate(bounds)
        self.parameter = nn.Parameter(torch.from_numpy(initial.astype(np.float32)))
        self.gradient = torch.zeros_like(self.parameter.data)
        self._layers = self._views(self.parameter.data)
        self._gradients = self._views(self.gradient)

    def _views(self, vector: Tensor) -> list[tuple[Tensor, Tensor]]:
        """The weight (outputs, inputs) and bias (outputs,) of every layer within a vector."""
        views = []
        start = 0
        for inputs, outputs in pairwise(self.sizes):
            middle, end = start + inputs * outputs, start + (inputs + 1) * outputs
            views.append((vector[start:middle].view(outputs, inputs), vector[middle:end]))
            start = end
        return views

    def forward(self, inputs: Tensor) -> Tensor:
        """Logits (n, classes) without dropout."""
        for weight, bias in self._layers[:-1]:
            inputs = torch.addmm(bias, inputs, weight.t()).relu_()
        weight, bias = self._layers[-1]
        return torch.addmm(bias, inputs, weight.t())

    def dropout_masks(self, count: int) -> list[Tensor]:
        """Per hidden layer (count, nodes): 0 for a node left out, else 1 / (1 - dropout)."""
        nodes = self.sizes[1:-1]
        words = self._rng.bit_generator.random_raw(-(-count * sum(nodes) // 4))
        bits = torch.from_numpy(words.view(np.int16))[: count * sum(nodes)]
        masks = torch.empty(len(bits))
        torch.ge(bits, self._threshold, out=masks)
        masks.mul_(1 / (1 - self._dropout))
        parts = torch.split(masks, [count * width for width in nodes])
        return [part.view(count, width) for part, width in zip(parts, nodes, strict=True)]

    def descend(self, inputs: Tensor, classes: Tensor) -> Tensor:
        """Fill ``gradient`` with the gradient of the mean cross-entropy of a batch.

        To be called in ``torch.inference_mode``, which saves a sixth of the time.

        Args:
            inputs: (n, inputs).
            classes: (n, classes) one-hot.

        Returns:
            (n, classes) logits with dropout.
        """
        masks = self.dropout_masks(len(inputs))
        activations = [inputs]
        for (weight, bias), mask in zip(self._layers[:-1], masks, strict=True):
            hidden = torch.addmm(bias, activations[-1], weight.t())
            activations.append(hidden.relu_().mul_(mask))
        weight, bias = self._layers[-1]
        logits = torch.addmm(bias, activations[-1], weight.t())
        delta = torch.softmax(logits, 1).sub_(classes).div_(len(inputs))
        for layer in reversed(range(len(self._layers))):
            weight_gradient, bias_gradient = self._gradients[layer]
            torch.mm(delta.t(), activations[layer], out=weight_gradient)
            torch.sum(delta, 0, out=bias_gradient)
            if layer > 0:
                delta = torch.mm(delta, self._layers[layer][0]).mul_(masks[layer - 1])
                delta = torch.ops.aten.threshold_backward(delta, activations[layer], 0)
        return logits

    def layers(self) -> Layers:
        """Copies of the weight and bias of every layer."""
        return tuple((weight.numpy().copy(), bias.numpy().copy()) for weight, bias in self._layers)
