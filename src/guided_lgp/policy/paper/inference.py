"""The trained policy: a probability over high-level actions (paper, Sec. II-A)."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from guided_lgp.errors import InputError
from guided_lgp.logic import Action, Objective, State, Symbols
from guided_lgp.policy.arrays import FloatArray
from guided_lgp.policy.paper.encoding import Encoding
from guided_lgp.policy.paper.model import Layers, Model, load_model
from guided_lgp.policy.paper.signature import INSTRUCTION

FLOOR = np.log(1e-6)
"""Log-probability of an action on a symbol that fills no slot: the networks cannot see it, and a
complete search must be able to take it."""


class HierarchicalPolicy:
    """Instruction policy, and one classifier chain per instruction.

    p(action) = p(instruction) · p(gripper | instruction) · p(box | gripper) [· p(table | gripper,
    box)], each given (g, s_k). Over all actions on the slots this sums to 1.
    """

    def __init__(self, models: Mapping[str, Model]) -> None:
        self._chains = {network: tuple(m.sub_policies.values()) for network, m in models.items()}
        self.encoding: Encoding = models[INSTRUCTION].encoding

    @property
    def instructions(self) -> Collection[str]:
        """The instructions that there are networks for."""
        return self.encoding.signature.instructions

    def log_probabilities(
        self,
        objective: Objective,
        state: State,
        symbols: Symbols,
        positions: Mapping[str, NDArray[np.float64]],
        actions: Sequence[Action],
    ) -> NDArray[np.float64]:
        """Score applicable actions; see :class:`guided_lgp.search.policy.Policy`."""
        slots = self.encoding.fill(objective, state, symbols)
        code = np.concatenate(
            [
                self.encoding.encode_goals(slots, state),
                self.encoding.encode_state(slots, state, positions),
            ]
        )
        instruction = _log_softmax(_forward(self._chains[INSTRUCTION][0], code[None]))[0]
        joint = {
            name: chain_log_probabilities(self._chains[name], code[None])[0]
            for name in self.encoding.signature.instructions
        }
        scores = np.full(len(actions), FLOOR)
        encoded = self.encoding.encode_actions(slots, actions)
        for row, (action, classes) in enumerate(zip(actions, encoded, strict=True)):
            if classes is not None:
                decided = dict(zip(self.encoding.signature.decisions, classes, strict=True))
                chosen = tuple(decided[name] for name in self.encoding.chains[action.instruction])
                scores[row] = instruction[classes[0]] + joint[action.instruction][chosen]
        return scores


def load_networks(directory: Path, stage: str) -> HierarchicalPolicy:
    """Read the trained networks of a hierarchical policy; torch is not needed.

    Args:
        directory: the folder of their files.
        stage: the stage that makes them, for the message.

    Raises:
        InputError: a file is missing, damaged, of another version, or the networks were trained
            with different encodings.
    """
    first = load_model(directory, INSTRUCTION, stage)
    others = [name for name in first.encoding.chains if name != INSTRUCTION]
    models = {INSTRUCTION: first} | {n: load_model(directory, n, stage) for n in others}
    if len({model.encoding for model in models.values()}) > 1:
        raise InputError(
            str(directory),
            "the networks were trained with different encodings",
            f"models of one run of the stage {stage}",
        )
    return HierarchicalPolicy(models)


def chain_log_probabilities(chain: Sequence[Layers], inputs: FloatArray) -> FloatArray:
    """Log-probability of every choice of symbols by a classifier chain.

    Args:
        chain: the layers of each sub-policy.
        inputs: (n, inputs) encoded objectives and states.

    Returns:
        (n, c1, c2, ...): one axis of classes per sub-policy.
    """
    shape = [len(inputs)]
    log_p = np.zeros((len(inputs), 1), dtype=np.float32)
    for layers in chain:
        width = layers[0][0].shape[1]  # without a chain, the input without the decisions
        conditional = _log_softmax(_forward(layers, inputs[:, :width]))
        rows, classes = conditional.shape
        log_p = log_p.reshape(-1, 1) + conditional
        decisions = np.tile(np.eye(classes, dtype=np.float32), (rows, 1))
        inputs = np.concatenate([np.repeat(inputs, classes, axis=0), decisions], axis=1)
        shape.append(classes)
    return log_p.reshape(shape)


def _forward(layers: Layers, inputs: FloatArray) -> FloatArray:
    for weight, bias in layers[:-1]:
        inputs = np.maximum(inputs @ weight.T + bias, 0)
    weight, bias = layers[-1]
    logits: FloatArray = inputs @ weight.T + bias
    return logits


def _log_softmax(logits: FloatArray) -> FloatArray:
    shifted: FloatArray = logits - logits.max(axis=-1, keepdims=True)
    log_p: FloatArray = shifted - np.log(np.exp(shifted).sum(axis=-1, keepdims=True))
    return log_p
