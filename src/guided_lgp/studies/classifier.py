"""Whether the coarse NLP will be feasible: a classifier of states and actions (paper, outlook).

Where it says that an action will hardly be feasible, a search tries others first. It orders and
never prunes: a search that is complete without the classifier is complete with it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from guided_lgp.errors import InputError
from guided_lgp.logic import Action, Objective, State, Symbols
from guided_lgp.params import Network
from guided_lgp.policy.arrays import FloatArray
from guided_lgp.policy.paper.inference import chain_log_probabilities
from guided_lgp.policy.paper.model import Layers
from guided_lgp.policy.relational.encoding import sides
from guided_lgp.search.policy import Policy

FEATURES = (
    "is a grasp",
    "target: x",
    "target: y, positive on the gripper's own side",
    "target: z",
    "target is a box",
    "target is held",
    "how many boxes stand on the target",
    "their mean x, relative to the target",
    "their mean y, relative to the target, positive on the gripper's own side",
    "the box carries others",
)
"""Inputs. The target is what the gripper reaches for: the box of a grasp, the support of a place;
positions in m. No input names a symbol, and their number is the same for any number of boxes."""

BINS = 10
"""Of equal width between the probabilities 0 and 1."""

_TEMPERATURES = (0.1, 10.0)
_LEAST_DEVIATION = 1e-3  # less is no information, and scaling it up would be noise


def features(
    state: State, symbols: Symbols, positions: Mapping[str, NDArray[np.float64]], action: Action
) -> list[float]:
    """:data:`FEATURES` of one action.

    Args:
        state: a symbolic state in which the action is applicable.
        symbols: of the problem.
        positions: world position (3,) in m of every symbol.
        action: the action.
    """
    ground = state.domain.bind(action)
    side = float(sides(len(symbols.grippers))[symbols.grippers.index(ground.actor)])
    target = ground.body if ground.into_hand else ground.parent
    standing = state.standing_on(target)
    x, y, z = positions[target].tolist()
    dx = sum(float(positions[box][0]) - x for box in standing) / max(len(standing), 1)
    dy = sum(float(positions[box][1]) - y for box in standing) / max(len(standing), 1)
    return [
        ground.into_hand,
        x,
        side * y,
        z,
        any(target == box for box, _ in state.support + state.held),
        state.holder(target) is not None,
        len(standing),
        dx,
        side * dy,
        len(state.standing_on(ground.body)) > 0,
    ]


@dataclass(frozen=True)
class Verdicts:
    """Verdicts of the coarse bound on sequences whose prefix is feasible."""

    inputs: FloatArray
    """(N, inputs) :data:`FEATURES` of the last action, before it."""
    feasible: NDArray[np.int64]
    """(N,) 1 where the sequence is feasible, else 0."""
    configuration: NDArray[np.int64]
    """(N,) number of the configuration."""

    def __getitem__(self, rows: NDArray[np.bool_]) -> "Verdicts":
        return Verdicts(self.inputs[rows], self.feasible[rows], self.configuration[rows])


@dataclass(frozen=True)
class FeasibilityClassifier:
    """p(feasible | s_k, a_k+1), calibrated."""

    layers: Layers
    """Of the network; normalisation of the inputs and temperature are part of them."""
    temperature: float
    """By which its logits were divided, for the record."""

    def log_probabilities(self, inputs: FloatArray) -> FloatArray:
        """(n,) log p(feasible), finite, of (n, inputs) features."""
        log_p: FloatArray = chain_log_probabilities([self.layers], inputs)[:, 1]
        return log_p


class FeasibilityAware:
    """A policy that also asks whether an action will be feasible: log p(action) + log p(feasible).

    Every action keeps a finite score; none is excluded.
    """

    def __init__(self, policy: Policy, classifier: FeasibilityClassifier) -> None:
        self._policy = policy
        self._classifier = classifier

    def log_probabilities(
        self,
        objective: Objective,
        state: State,
        symbols: Symbols,
        positions: Mapping[str, NDArray[np.float64]],
        actions: Sequence[Action],
    ) -> NDArray[np.float64]:
        """Score applicable actions; see :class:`guided_lgp.search.policy.Policy`."""
        inputs = [features(state, symbols, positions, action) for action in actions]
        feasible = self._classifier.log_probabilities(np.array(inputs, dtype=np.float32))
        log_p = self._policy.log_probabilities(objective, state, symbols, positions, actions)
        return log_p + feasible


def train_classifier(
    verdicts: Verdicts, settings: Network, validation_share: float, patience: int, seed: int
) -> FeasibilityClassifier:
    """Train on most configurations; the others stop the training and set the temperature.

    Args:
        verdicts: of the training configurations.
        settings: architecture and optimiser.
        validation_share: share of the configurations that is held out.
        patience: epochs without a lower loss on these before training stops.
        seed: of the choice of these, the weights and the order of the samples.

    Raises:
        InputError: too few configurations to hold one out, or a training that diverges at once.
    """
    from guided_lgp.policy.paper.training import fit  # torch, which planning does not need

    choice, training = np.random.SeedSequence(seed).spawn(2)
    units = np.random.default_rng(choice).permutation(np.unique(verdicts.configuration))
    count = max(1, round(validation_share * len(units)))
    if count >= len(units):
        raise InputError(
            "feasibility.validation_share",
            f"holds out {count} of {len(units)} configurations",
            "a share that leaves some on both sides; or more configurations",
        )
    held_out = np.isin(verdicts.configuration, units[:count])
    mean = verdicts.inputs[~held_out].mean(axis=0)
    deviation = verdicts.inputs[~held_out].std(axis=0)
    deviation[deviation < _LEAST_DEVIATION] = 1
    normalised = (verdicts.inputs - mean) / deviation
    fitted = fit(
        (normalised[~held_out], verdicts.feasible[~held_out]),
        (normalised[held_out], verdicts.feasible[held_out]),
        2,
        settings,
        patience,
        training,
    )
    (weight, bias), *others = fitted.layers
    first = (weight / deviation, bias - (weight / deviation) @ mean)
    return calibrated(FeasibilityClassifier((first, *others), 1.0), verdicts[held_out])


def calibrated(classifier: FeasibilityClassifier, verdicts: Verdicts) -> FeasibilityClassifier:
    """The classifier with its logits divided by the temperature with the lowest loss.

    Args:
        classifier: of any calibration.
        verdicts: others than those that it was trained on (Guo et al., ICML 2017, Sec. 4.2).
    """
    *hidden, (weight, bias) = classifier.layers

    def at(temperature: float) -> FeasibilityClassifier:
        last = ((weight / temperature).astype(np.float32), (bias / temperature).astype(np.float32))
        return FeasibilityClassifier((*hidden, last), temperature)

    def loss(logarithm: float) -> float:
        log_p = chain_log_probabilities([at(np.exp(logarithm)).layers], verdicts.inputs)
        return -float(np.take_along_axis(log_p, verdicts.feasible[:, None], axis=1).mean())

    best = minimize_scalar(loss, bounds=np.log(_TEMPERATURES), method="bounded")
    return at(float(np.exp(best.x)))


def calibration(p: FloatArray, feasible: NDArray[np.int64]) -> dict[str, object]:
    """How far predicted probabilities can be trusted.

    Args:
        p: (n,) predicted probabilities of being feasible.
        feasible: (n,) 1 where the sequence is feasible, else 0.

    Returns:
        ``brier``: mean squared error of the probabilities, and ``brier_base`` that of the share of
        the feasible; ``ece``: expected calibration error, the mean distance between predicted and
        observed share over the bins; ``confusion``: rows infeasible and feasible in truth, columns
        as predicted at 0.5; ``bins``: those that are not empty.
    """
    bin_of = np.minimum((p * BINS).astype(int), BINS - 1)
    shares = [
        {
            "from": index / BINS,
            "n": int((bin_of == index).sum()),
            "predicted": float(p[bin_of == index].mean()),
            "feasible": float(feasible[bin_of == index].mean()),
        }
        for index in np.unique(bin_of).tolist()
    ]
    gaps = [row["n"] * abs(row["predicted"] - row["feasible"]) for row in shares]
    cells = np.bincount(2 * feasible + (p >= 0.5), minlength=4).reshape(2, 2)
    return {
        "n": len(p),
        "brier": float(((p - feasible) ** 2).mean()),
        "brier_base": float(feasible.mean() * (1 - feasible.mean())),
        "ece": sum(gaps) / len(p),
        "confusion": cells.tolist(),
        "bins": shares,
    }
