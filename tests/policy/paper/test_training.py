import numpy as np
import pytest
import torch

from guided_lgp.errors import InputError
from guided_lgp.params import Network
from guided_lgp.policy.paper.training import Fit, Samples, fit

SETTINGS = Network(layers=2, nodes=32, dropout=0.1, l2=1e-4, epochs=60, batch=32, lr=3e-3)


def problem(samples: int, seed: int = 0) -> Samples:
    """Three classes that the inputs decide about."""
    rng = np.random.default_rng(seed)
    inputs = rng.normal(size=(samples, 5)).astype(np.float32)
    return inputs, (inputs @ rng.normal(size=(5, 3))).argmax(axis=1)


def train(training: Samples, validation: Samples, patience: int = 60, **changes: float) -> Fit:
    settings = SETTINGS.model_copy(update=changes)
    return fit(training, validation, 3, settings, patience, np.random.SeedSequence(1))


def test_overfits_a_few_samples() -> None:
    few = problem(30)
    result = train(few, few, dropout=0.0, l2=0.0, epochs=200)
    assert result.curves["validation_accuracy"][result.best_epoch - 1] == 1
    assert result.curves["validation_loss"][result.best_epoch - 1] < 0.02
    assert np.trace(result.confusion) == 30


def test_learns_what_can_be_learnt_and_nothing_from_shuffled_labels() -> None:
    inputs, classes = problem(1500)
    shuffled = np.random.default_rng(1).permutation(classes)
    accuracy = []
    for labels in (classes, shuffled):
        result = train((inputs[:1000], labels[:1000]), (inputs[1000:], labels[1000:]), patience=15)
        accuracy.append(result.confusion.trace() / 500)
        chance = (np.bincount(labels[1000:]) / 500).max()
        assert result.confusion.sum() == 500
        assert result.confusion.sum(axis=1).tolist() == np.bincount(labels[1000:]).tolist()
    assert accuracy[0] > 0.9
    assert abs(accuracy[1] - chance) < 0.08


def test_early_stopping_returns_the_best_parameters() -> None:
    inputs, classes = problem(400)
    noisy = np.where(np.random.default_rng(2).random(400) < 0.4, 0, classes)
    validation = inputs[200:], noisy[200:]
    result = train((inputs[:200], noisy[:200]), validation, patience=5, l2=0.0, dropout=0.0)
    losses = result.curves["validation_loss"]
    assert result.best_epoch == 1 + int(np.argmin(losses))
    assert len(losses) == result.best_epoch + 5 < SETTINGS.epochs
    assert all(len(curve) == len(losses) for curve in result.curves.values())

    logits = torch.from_numpy(validation[0])
    for index, (weight, bias) in enumerate(result.layers):
        logits = torch.relu(logits) if index else logits
        logits = logits @ torch.from_numpy(weight.T) + torch.from_numpy(bias)
    loss = torch.nn.functional.cross_entropy(logits, torch.from_numpy(validation[1]))
    assert loss.item() == pytest.approx(min(losses), abs=1e-5)


def test_l2_regularisation_shrinks_the_parameters() -> None:
    few = problem(100)
    sizes = []
    for l2 in (0.0, 1e-2):
        layers = train(few, few, l2=l2, dropout=0.0).layers
        sizes.append(sum(float((weight**2).sum()) for weight, _ in layers))
    assert sizes[1] < 0.6 * sizes[0]


def test_the_seed_decides_about_everything() -> None:
    data, torch_state = problem(100), torch.get_rng_state()
    first, again = (train(data, data, epochs=3) for _ in range(2))
    assert first.curves == again.curves
    assert all((a[0] == b[0]).all() for a, b in zip(first.layers, again.layers, strict=True))
    other = fit(data, data, 3, SETTINGS, 60, np.random.SeedSequence(2))
    assert other.curves["training_loss"][0] != first.curves["training_loss"][0]
    assert (torch.get_rng_state() == torch_state).all(), "no global random state is used"


def test_a_training_that_diverges_says_so() -> None:
    inputs, classes = problem(100)
    inputs[0, 0] = np.inf
    with pytest.raises(InputError, match=r"lr: the loss is not finite"):
        train((inputs, classes), (inputs, classes), epochs=2)
