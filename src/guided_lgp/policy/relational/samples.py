"""The samples of the data set as graphs with all right actions."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from guided_lgp.errors import InputError
from guided_lgp.logic import Domain
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
    Range,
    Situations,
    graphs,
    is_held,
    sides,
)
from guided_lgp.policy.relational.heads import heads


@dataclass(frozen=True)
class Examples:
    """Distinct problems (configuration, symbolic state, goals), each with all right actions."""

    situations: Situations
    right: BoolArray
    """(N, G, T) whether grasping a box, or placing what is held on a table, by a gripper begins
    the rest of a shortest sequence."""
    configuration: NDArray[np.int32]
    """(N,) index of the configuration."""
    domain: Domain
    wrong: BoolArray | None = None
    """(N, G, T) whether the action is known to be infeasible, if failures are known."""

    def __len__(self) -> int:
        return len(self.configuration)

    def __getitem__(self, rows: IntArray | BoolArray) -> "Examples":
        right, configuration = self.right[rows], self.configuration[rows]
        wrong = None if self.wrong is None else self.wrong[rows]
        return Examples(self.situations[rows], right, configuration, self.domain, wrong)


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
    if encoding != Encoding(domain=encoding.domain, slots=encoding.slots, goals=encoding.goals):
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

    actor, target = _actor_and_target(dataset)
    right = np.zeros((len(first), encoding.holders, encoding.supports), dtype=bool)
    right[group, actor[state], target[state]] = True
    positions = dataset.states[state[first]].reshape(len(first), -1, 3)[:, encoding.holders :]
    boxes, fixed = np.split(positions, [encoding.bodies], axis=1)
    situations = Situations(
        np.concatenate([fixed, boxes], axis=1),
        dataset.supports[state[first]].astype(np.int64),
        goals[first],
        encoding.holders,
    )
    for preference in (supports_first(situations), own_side(situations)):
        right = preferred(right, preference)
    return Examples(situations, right, configuration[first], encoding.signature.domain)


def preferred(right: BoolArray, preference: BoolArray) -> BoolArray:
    """(N, G, T) of the right actions those that are preferred, where there are such."""
    both = right & preference
    chosen: BoolArray = np.where(both.any(axis=(1, 2), keepdims=True), both, right)
    return chosen


def _actor_and_target(dataset: Dataset) -> tuple[IntArray, IntArray]:
    """(M,) each the acting gripper and the node that is the target, of every action."""
    encoding, signature = dataset.encoding, dataset.encoding.signature
    actor, target = np.zeros((2, len(dataset.actions)), dtype=np.int64)
    for name, head in heads(signature.domain).items():
        rows = dataset.actions[:, 0] == signature.instructions.index(name)
        first = signature.decisions.index(head.instruction.parameters[0].name)
        actor[rows] = dataset.actions[rows, first]
        classes = dataset.actions[rows, signature.decisions.index(head.target.name)]
        target[rows] = _nodes(encoding, head.target.name)[classes]
    return actor, target


def _nodes(encoding: Encoding, parameter: str) -> IntArray:
    """The number of the node of every class of a parameter."""
    kinds = np.array([k for k in encoding.signature.supports for _ in range(encoding.count([k]))])
    own = encoding.signature.kinds_of[parameter]
    return np.concatenate([np.flatnonzero(kinds == kind) for kind in own])


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
    domain, kinds = encoding.signature.domain, encoding.signature.goal_kinds
    kind, box, table = np.split(codes, [len(kinds), len(kinds) + encoding.bodies], axis=2)
    held = np.array([is_held(domain, name) for name in kinds])[kind.argmax(axis=2)]
    places = np.where(held, GOAL_HELD, table.argmax(axis=2))
    goals = np.full((len(codes), encoding.bodies), NO_GOAL)
    np.put_along_axis(goals, box.argmax(axis=2), places, axis=1)
    return goals


def own_side(situations: Situations) -> BoolArray:
    """(B, G, T) whether an action is not a grasp of a box on the other side of the middle."""
    held = graphs(situations, Range.of(situations)).held[..., None]
    towards = situations.positions[:, None, :, 1] * sides(situations.grippers)[:, None]
    return (held >= 0) | (towards > 0)


def on_surfaces(situations: Situations) -> BoolArray:
    """(B, G, T) whether an action does not place what is held on a box."""
    held = graphs(situations, Range.of(situations)).held[..., None]
    tables = situations.positions.shape[1]
    surface = np.arange(tables) < tables - situations.supports.shape[1]
    allowed: BoolArray = (held < 0) | surface
    return allowed
