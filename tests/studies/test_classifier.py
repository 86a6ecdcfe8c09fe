"""The feasibility classifier on a problem with known probabilities, and the policy that uses it."""

import numpy as np
import pytest

from guided_lgp.domains import load_domain
from guided_lgp.errors import InputError
from guided_lgp.logic import State, Symbols, applicable_actions, parse_objective, successor
from guided_lgp.params import Network
from guided_lgp.policy.uniform import Uniform
from guided_lgp.studies.classifier import (
    FEATURES,
    FeasibilityAware,
    FeasibilityClassifier,
    Verdicts,
    calibrated,
    calibration,
    features,
    train_classifier,
)

NETWORK = Network(layers=1, nodes=16, dropout=0.0, l2=0.0, epochs=40, batch=128, lr=1e-2)
POSITIONS = {
    "pr2L": np.array([0.3, 0.7, 0.8]),
    "pr2R": np.array([0.3, -0.7, 0.8]),
    "red": np.array([0.5, 0.3, 0.65]),
    "green": np.array([0.6, 0.4, 0.65]),
    "blue": np.array([0.5, 0.3, 0.75]),
    "tab1": np.array([0.54, 0.33, 0.6]),
    "tab2": np.array([0.54, -0.33, 0.6]),
}
STATE = load_domain().state({"red": "tab1", "green": "tab1", "blue": "red"})


@pytest.fixture
def symbols() -> Symbols:
    names = {
        "gripper": ("pr2L", "pr2R"),
        "box": ("red", "green", "blue"),
        "table": ("tab1", "tab2"),
    }
    return load_domain().symbols(**names)


def out_of_reach(count: int, seed: int) -> tuple[Verdicts, np.ndarray]:
    """Verdicts whose probability falls with y; the other inputs mean nothing."""
    rng = np.random.default_rng(seed)
    inputs = rng.normal(size=(count, len(FEATURES))).astype(np.float32)
    inputs[:, 1] = 0.5  # never changes
    p = 1 / (1 + np.exp(3 * inputs[:, 2] - 2))
    feasible = (rng.random(count) < p).astype(int)
    return Verdicts(inputs, feasible, rng.integers(10, size=count)), p


@pytest.fixture(scope="module")
def classifier() -> FeasibilityClassifier:
    return train_classifier(out_of_reach(6000, 1)[0], NETWORK, 0.2, 5, 0)


def test_features_are_those_of_the_gripper_and_its_target(symbols: Symbols) -> None:
    def after(state: State, text: str) -> tuple[list[float], State]:
        action = next(a for a in applicable_actions(state, symbols) if str(a) == text)
        return features(state, symbols, POSITIONS, action), successor(state, action)

    left, holding = after(STATE, "(grasp pr2L red)")
    assert left == pytest.approx([1, 0.5, 0.3, 0.65, 1, 0, 1, 0, 0, 1])
    right, _ = after(STATE, "(grasp pr2R red)")
    assert right == pytest.approx([1, 0.5, -0.3, 0.65, 1, 0, 1, 0, 0, 1])
    carrying, _ = after(holding, "(place pr2L red tab1)")
    assert carrying == pytest.approx([0, 0.54, 0.33, 0.6, 0, 0, 1, 0.06, 0.07, 1])
    _, both = after(holding, "(grasp pr2R green)")
    on_held, _ = after(both, "(place pr2R green red)")
    assert on_held == pytest.approx([0, 0.5, -0.3, 0.65, 1, 1, 1, 0, 0, 0])


def test_probabilities_are_calibrated(classifier: FeasibilityClassifier) -> None:
    verdicts, truth = out_of_reach(4000, 2)
    p = np.exp(classifier.log_probabilities(verdicts.inputs))
    assert np.abs(p - truth).mean() < 0.05
    quality = calibration(p, verdicts.feasible)
    best = calibration(truth, verdicts.feasible)
    assert quality["brier"] < best["brier"] + 0.005 < quality["brier_base"] - 0.05
    assert quality["ece"] < 0.04
    assert np.sum(quality["confusion"]) == len(p)


def test_temperature_repairs_overconfidence(classifier: FeasibilityClassifier) -> None:
    *hidden, (weight, bias) = classifier.layers
    overconfident = FeasibilityClassifier((*hidden, (3 * weight, 3 * bias)), 1.0)
    repaired = calibrated(overconfident, out_of_reach(4000, 3)[0])
    assert repaired.temperature == pytest.approx(3, rel=0.1)
    new, _ = out_of_reach(4000, 4)
    errors = [
        calibration(np.exp(one.log_probabilities(new.inputs)), new.feasible)["ece"]
        for one in (overconfident, repaired)
    ]
    assert errors[1] < errors[0] / 2


def test_shuffled_labels_leave_the_base_rate() -> None:
    verdicts, _ = out_of_reach(3000, 5)
    rng = np.random.default_rng(6)
    shuffled = Verdicts(verdicts.inputs, rng.permutation(verdicts.feasible), verdicts.configuration)
    classifier = train_classifier(shuffled, NETWORK, 0.2, 5, 0)
    new, _ = out_of_reach(4000, 7)
    quality = calibration(np.exp(classifier.log_probabilities(new.inputs)), new.feasible)
    assert quality["brier"] == pytest.approx(quality["brier_base"], abs=0.01)


def test_calibration_of_known_predictions() -> None:
    p = np.array([0.9, 0.9, 0.1, 0.6], dtype=np.float32)
    quality = calibration(p, np.array([1, 1, 1, 0]))
    assert quality["brier"] == pytest.approx((0.01 + 0.01 + 0.81 + 0.36) / 4)
    assert quality["brier_base"] == pytest.approx(3 / 16)
    assert quality["ece"] == pytest.approx((2 * 0.1 + 0.9 + 0.6) / 4)
    assert quality["confusion"] == [[0, 1], [1, 2]]
    assert [row["n"] for row in quality["bins"]] == [1, 1, 2]


def test_order_changes_and_no_action_is_lost(
    classifier: FeasibilityClassifier, symbols: Symbols
) -> None:
    """Far on the other side means infeasible here; even there the score stays finite."""
    actions = list(applicable_actions(STATE, symbols))
    objective = parse_objective(["(held red)"])
    far = POSITIONS | {"green": np.array([0.5, 400.0, 0.65])}
    scores = FeasibilityAware(Uniform(), classifier).log_probabilities(
        objective, STATE, symbols, far, actions
    )
    uniform = Uniform().log_probabilities(objective, STATE, symbols, far, actions)
    assert scores.shape == uniform.shape == (6,)
    assert np.isfinite(scores).all()
    assert (scores <= uniform).all()
    assert str(actions[int(scores.argmin())]) == "(grasp pr2L green)"
    assert len(set(scores.round(6))) > len(set(uniform))


def test_the_same_seed_gives_the_same_classifier(classifier: FeasibilityClassifier) -> None:
    again = train_classifier(out_of_reach(6000, 1)[0], NETWORK, 0.2, 5, 0)
    assert again.temperature == classifier.temperature
    for ours, theirs in zip(again.layers, classifier.layers, strict=True):
        assert all((a == b).all() for a, b in zip(ours, theirs, strict=True))


def test_one_configuration_cannot_be_split() -> None:
    verdicts, _ = out_of_reach(50, 1)
    alone = Verdicts(verdicts.inputs, verdicts.feasible, np.zeros(50, dtype=int))
    with pytest.raises(InputError, match="holds out 1 of 1 configurations"):
        train_classifier(alone, NETWORK, 0.2, 5, 0)
