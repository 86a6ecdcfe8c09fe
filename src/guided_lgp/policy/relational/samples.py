"""The samples of the data set as graphs with all right actions."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guided_lgp.errors import InputError
from guided_lgp.policy.arrays import BoolArray, IntArray
from guided_lgp.policy.paper.dataset import Dataset
from guided_lgp.policy.paper.encoding import Encoding
from guided_lgp.policy.relational.encoding import (
    CARRIES,
    ELSEWHERE,
    GOAL_HELD,
    NO_GOAL,
    NODE_FEATURES,
    READY,
    SETTLED,
    SIDES,
    Range,
    Situations,
    graphs,
)


@dataclass(frozen=True)
class Examples:
    """Distinct problems (configuration, symbolic state, goals), each with all right actions."""

    situations: Situations
    right: BoolArray
    """(N, G, T) whether grasping a box, or placing what is held on a table, by a gripper begins
    the rest of a shortest sequence."""
    configuration: NDArray[np.int32]
    """(N,) index of the configuration."""

    def __len__(self) -> int:
        return len(self.configuration)

    def __getitem__(self, rows: IntArray | BoolArray) -> "Examples":
        return Examples(self.situations[rows], self.right[rows], self.configuration[rows])


def examples(dataset: Dataset) -> Examples:
    """Group the samples by problem; of those in one group, the first gives the positions.

    Where goals hold already, a second problem has the others alone: that is what objective
    adaptation asks for. Of several right actions, those are taught that put supports first and,
    of these, those that grasp a box on the gripper's own side, if there are such: carrying a
    stack, holding a box until its support is ready or reaching across the middle is as short, but
    what then still works with three boxes often fails with ten.

    Raises:
        InputError: the samples are encoded otherwise than the paper's.
    """
    encoding = dataset.encoding
    if encoding != Encoding():
        raise InputError("data set", "is encoded otherwise", "the samples of the paper's networks")
    supports = dataset.supports[dataset.sample_state].astype(np.int64)
    goals = _goals(dataset)[dataset.sample_goals]
    kept = np.where((goals == supports) | ((goals == GOAL_HELD) & (supports < 0)), NO_GOAL, goals)
    sample = np.tile(np.arange(len(dataset)), 2)
    goals = np.concatenate([goals, kept])
    state = dataset.sample_state[sample]
    configuration = dataset.configuration[state]
    keys = np.column_stack([configuration, dataset.supports[state], goals])
    _, first, group = np.unique(keys, axis=0, return_index=True, return_inverse=True)

    instruction, gripper, box, table = dataset.actions[state].T.astype(np.int64)
    tables = encoding.supports
    surfaces = tables - encoding.bodies
    target = np.where(instruction == 0, surfaces + box, table)
    right = np.zeros((len(first), len(SIDES), tables), dtype=bool)
    right[group, gripper, target] = True
    positions = dataset.states[state[first]].reshape(len(first), -1, 3)[:, encoding.holders :]
    boxes, fixed = np.split(positions, [encoding.bodies], axis=1)
    situations = Situations(
        np.concatenate([fixed, boxes], axis=1),
        dataset.supports[state[first]].astype(np.int64),
        goals[first],
    )
    for preference in (supports_first(situations), own_side(situations)):
        preferred = right & preference
        right = np.where(preferred.any(axis=(1, 2), keepdims=True), preferred, right)
    return Examples(situations, right, configuration[first])


def supports_first(situations: Situations) -> BoolArray:
    """(B, G, T) whether an action moves one box at a time, to a place that stays as it is.

    Grasping a box that carries nothing, once what it shall stand on is settled, and placing on
    what is settled.
    """
    inputs = graphs(situations, Range.of(situations))  # only what does not depend on positions
    nodes = inputs.nodes[:, 0]
    settled = nodes[..., NODE_FEATURES.index(SETTLED)] > 0
    alone = nodes[..., NODE_FEATURES.index(CARRIES)] == 0
    ready = nodes[..., NODE_FEATURES.index(READY)] >= nodes[..., NODE_FEATURES.index(ELSEWHERE)]
    return np.where(inputs.held[..., None] < 0, (alone & ready)[:, None], settled[:, None])


def _goals(dataset: Dataset) -> IntArray:
    """(objectives, boxes) the encoded objectives as what each box shall stand on."""
    encoding = dataset.encoding
    codes = dataset.goals.reshape(len(dataset.goals), encoding.goals, encoding.goal_size)
    kind, box, table = np.split(codes, [2, 2 + encoding.bodies], axis=2)
    held = kind.argmax(axis=2) == encoding.signature.goal_kinds.index("held")
    places = np.where(held, GOAL_HELD, table.argmax(axis=2))
    goals = np.full((len(codes), encoding.bodies), NO_GOAL)
    np.put_along_axis(goals, box.argmax(axis=2), places, axis=1)
    return goals


def own_side(situations: Situations) -> BoolArray:
    """(B, G, T) whether an action is not a grasp of a box on the other side of the middle."""
    held = graphs(situations, Range.of(situations)).held[..., None]
    towards = situations.positions[:, None, :, 1] * np.array(SIDES, dtype=np.float32)[:, None]
    return (held >= 0) | (towards > 0)
