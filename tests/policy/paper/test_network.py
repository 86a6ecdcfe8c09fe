import numpy as np
import pytest
import torch
from torch import Tensor, nn
from torch.nn import functional

from guided_lgp.policy.paper.network import Classifier

SIZES = (7, 6, 5, 4, 3)


def classifier(dropout: float, seed: int = 0) -> Classifier:
    return Classifier(SIZES, dropout, np.random.Generator(np.random.SFC64(seed)))


def torch_layers(model: Classifier) -> list[tuple[Tensor, Tensor]]:
    return [
        (torch.from_numpy(w).requires_grad_(), torch.from_numpy(b).requires_grad_())
        for w, b in model.layers()
    ]


@pytest.mark.parametrize("dropout", [0.0, 0.3])
def test_gradient_agrees_with_automatic_differentiation(dropout: float) -> None:
    inputs = torch.randn(50, 7, generator=torch.Generator().manual_seed(0))
    targets = functional.one_hot(torch.arange(50) % 3, 3).float()
    model = classifier(dropout)
    masks = classifier(dropout).dropout_masks(50)  # the same stream: the masks of the next call
    with torch.inference_mode():
        logits = model.descend(inputs, targets)

    layers = torch_layers(model)
    hidden = inputs
    for (weight, bias), mask in zip(layers, masks, strict=False):
        hidden = torch.relu(functional.linear(hidden, weight, bias)) * mask
    expected = functional.linear(hidden, *layers[-1])
    functional.cross_entropy(expected, targets).backward()
    gradient = torch.cat([part.grad.ravel() for layer in layers for part in layer])
    assert gradient.abs().max() > 0.01
    torch.testing.assert_close(logits, expected.detach())
    torch.testing.assert_close(model.gradient, gradient)


def test_forward_is_a_feed_forward_network_without_dropout() -> None:
    model = classifier(dropout=0.5)
    modules: list[nn.Module] = []
    for weight, bias in model.layers():
        linear = nn.Linear(*weight.shape[::-1])
        linear.load_state_dict({"weight": torch.from_numpy(weight), "bias": torch.from_numpy(bias)})
        modules += [linear, nn.ReLU()]
    inputs = torch.randn(9, 7)
    with torch.inference_mode():
        torch.testing.assert_close(model(inputs), nn.Sequential(*modules[:-1])(inputs))


def test_dropout_leaves_out_its_share_and_keeps_the_mean() -> None:
    for dropout in (0.1, 0.3):
        for mask in classifier(dropout).dropout_masks(20_000):
            left_out = (mask == 0).float().mean(dim=0)
            assert (left_out - dropout).abs().max() < 0.02
            assert (mask.mean(dim=0) - 1).abs().max() < 0.02
            correlation = torch.corrcoef(mask.t()) - torch.eye(mask.shape[1])
            assert correlation.abs().max() < 0.05


def test_initial_weights_follow_the_seed_and_the_width_of_their_layer() -> None:
    one, same, other = (classifier(0.3, seed).layers() for seed in (1, 1, 2))
    for (weight, bias), inputs in zip(one, SIZES[:-1], strict=True):
        assert np.abs(weight).max() <= inputs**-0.5
        assert np.abs(bias).max() <= inputs**-0.5
    assert all((a[0] == b[0]).all() for a, b in zip(one, same, strict=True))
    assert not any((a[0] == b[0]).all() for a, b in zip(one, other, strict=True))
