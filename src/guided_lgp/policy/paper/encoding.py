"""Input and output encoding of the policy (paper, Sec. II-B; DESIGN §5 and §6).

The networks have a fixed number of slots per logic type. A :class:`Slots` says which symbol of a
problem fills which slot and which goals are encoded; an :class:`Encoding` turns goals, positions
and actions into numbers once the slots are filled.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray

from guided_lgp.errors import InputError
from guided_lgp.logic import Action, Goal, Objective, State, Symbols, satisfied, unsatisfied
from guided_lgp.policy.arrays import FloatArray

VERSION = 1
"""Version of the encoding and of the files that hold it."""

INSTRUCTIONS = ("grasp", "place")
GOAL_KINDS = ("held", "on")

CHAINS: Mapping[str, tuple[str, ...]] = {
    "instruction": ("instruction",),
    "grasp": ("gripper", "box"),
    "place": ("gripper", "box", "table"),
}
"""The sub-policies of each network in the order of its classifier chain."""

NOWHERE = 127
"""The code of a box that is at no table or gripper of the slots."""

_MOST_SLOTS = 100
_SLOTS = ("grippers", "boxes", "surfaces", "goals")
_FLAGS = {
    "chain": "chain",
    "named_first": "named_first",
    "relative": "relative",
    "symbolic_state": "meaning",
}
"""The fields that are true or false, and their keys in files."""


@dataclass(frozen=True)
class Slots:
    """The symbols and goals of a problem that the networks see; None is an empty slot."""

    grippers: tuple[str | None, ...]
    boxes: tuple[str | None, ...]
    surfaces: tuple[str | None, ...]
    goals: Objective

    @property
    def tables(self) -> tuple[str | None, ...]:
        """The slots of logic type table: surfaces, then boxes."""
        return self.surfaces + self.boxes

    @property
    def symbols(self) -> tuple[str | None, ...]:
        """All slots in the order of the state: grippers, boxes, surfaces."""
        return self.grippers + self.boxes + self.surfaces


@dataclass(frozen=True)
class Encoding:
    """The numbers of slots and the scaling of positions, and the encoding that follows from them.

    The input (g, s_k) is: per goal the one-hots of its type, box and table (zeros where a goal has
    no table), then the world x, y, z in m of every gripper, box and surface. With the default
    numbers of slots these are 2 · (2 + 3 + 5) + 7 · 3 = 41 numbers. An empty slot is zero.

    The paper takes positions as they are. What other recipes change is listed here; see
    :class:`guided_lgp.params.SampleRecipe`. One that normalises positions gives ``centre`` and
    ``scale``, one number each per coordinate: (position - centre) / scale. One that adds what the
    state means has one more number per goal, whether it holds, and, after the positions, for every
    box the one-hot of the table or gripper that it is at.
    """

    grippers: int = 2
    boxes: int = 3
    surfaces: int = 2
    goals: int = 2
    chain: bool = True
    """Whether sub-policies see the decisions before them in the chain."""
    named_first: bool = False
    """Whether the boxes that goals name fill the first slots, in the order of the goals."""
    relative: bool = False
    """Whether positions are relative to the box in the first slot."""
    symbolic_state: bool = False
    """Whether the input says what the state means."""
    centre: tuple[float, ...] = ()
    scale: tuple[float, ...] = ()

    @property
    def goal_size(self) -> int:
        """Length of one encoded goal."""
        return len(GOAL_KINDS) + self.boxes + self.surfaces + self.boxes + self.symbolic_state

    @property
    def position_size(self) -> int:
        """Number of coordinates in the encoded state."""
        return 3 * (self.grippers + self.boxes + self.surfaces)

    @property
    def state_size(self) -> int:
        """Length of the encoded state."""
        places = self.surfaces + self.boxes + self.grippers
        return self.position_size + self.symbolic_state * self.boxes * places

    @property
    def input_size(self) -> int:
        """Length of the input of the first sub-policy of a chain."""
        return self.goals * self.goal_size + self.state_size

    @property
    def input_names(self) -> tuple[str, ...]:
        """What every input stands for, in order."""
        boxes = [f"box{index}" for index in range(1, self.boxes + 1)]
        surfaces = [f"surface{index}" for index in range(1, self.surfaces + 1)]
        grippers = [f"gripper{index}" for index in range(1, self.grippers + 1)]
        goal = [
            *GOAL_KINDS,
            *(f"box={name}" for name in boxes),
            *(f"table={name}" for name in surfaces + boxes),
            *["holds"] * self.symbolic_state,
        ]
        places = (surfaces + boxes + grippers) * self.symbolic_state
        return (
            *(f"goal{index} {name}" for index in range(1, self.goals + 1) for name in goal),
            *(f"{name} {axis}" for name in grippers + boxes + surfaces for axis in "xyz"),
            *(f"{box} at {place}" for box in boxes for place in places),
        )

    def classes(self, sub_policy: str) -> int:
        """The number of classes of a sub-policy: its slots."""
        return {
            "instruction": len(INSTRUCTIONS),
            "gripper": self.grippers,
            "box": self.boxes,
            "table": self.surfaces + self.boxes,
        }[sub_policy]

    def chain_inputs(self, network: str) -> list[int]:
        """The input length of each sub-policy: the input, then the previous one-hots."""
        sizes = [self.input_size]
        for sub_policy in CHAINS[network][:-1]:
            sizes.append(sizes[-1] + (self.classes(sub_policy) if self.chain else 0))
        return sizes

    def fill(self, objective: Objective, state: State, symbols: Symbols) -> Slots:
        """Choose the goals to encode and fill the slots (DESIGN §6, "More goals or boxes").

        As many goals as there are slots are encoded as they are. Of more goals, a subset of the
        unsatisfied ones is, supports before what stands on them; if those goals name more boxes
        than there are slots, only the first of them. The slots then take the symbols that these
        goals name, the boxes that are held, and the others as declared, until they are full. A
        symbol whose place in the declaration is a slot keeps that slot, so that nothing moves
        in a problem that fits; unless boxes that are named come first. Of more boxes than slots
        they always do, lower ones first; the paper leaves the order open.
        """
        goals = objective
        if len(goals) > self.goals or len(_boxes(goals, symbols)) > self.boxes:
            remaining = objective if satisfied(state, objective) else unsatisfied(state, objective)
            goals = _supports_first(remaining)[: self.goals]
            if len(_boxes(goals, symbols)) > self.boxes:
                goals = goals[:1]
        in_order = self.named_first or len(symbols.boxes) > self.boxes
        held = [box for box in symbols.boxes if state.holder(box) is not None]
        named = [goal.table for goal in goals if goal.table in symbols.surfaces]
        return Slots(
            grippers=_fill(self.grippers, symbols.grippers, ()),
            boxes=_fill(self.boxes, symbols.boxes, [*_boxes(goals, symbols), *held], in_order),
            surfaces=_fill(self.surfaces, symbols.surfaces, [name for name in named if name]),
            goals=goals,
        )

    def encode_goals(self, slots: Slots, state: State) -> FloatArray:
        """The encoded objective g; one goal is encoded as the same goal twice (DESIGN §5).

        Args:
            slots: which symbol fills which slot, and the goals to encode.
            state: the symbolic state, for an encoding that says which goals hold.

        Returns:
            (goals · goal_size,) zeros and ones.
        """
        code = np.zeros((self.goals, self.goal_size), dtype=np.float32)
        for row in range(self.goals):
            goal = slots.goals[min(row, len(slots.goals) - 1)]
            code[row, GOAL_KINDS.index(goal.kind)] = 1
            code[row, len(GOAL_KINDS) + slots.boxes.index(goal.box)] = 1
            if goal.table is not None:
                code[row, len(GOAL_KINDS) + self.boxes + slots.tables.index(goal.table)] = 1
            if self.symbolic_state:
                code[row, -1] = satisfied(state, (goal,))
        return code.ravel()

    def encode_state(
        self, slots: Slots, state: State, positions: Mapping[str, NDArray[np.float64]]
    ) -> FloatArray:
        """The encoded state s_k.

        Args:
            slots: which symbol fills which slot.
            state: the symbolic state, for an encoding that says what the state means.
            positions: world position (3,) in m of every symbol.

        Returns:
            (state_size,) positions in m unless normalised; zeros for an empty slot.
        """
        empty = [name is None for name in slots.symbols]
        world = [np.zeros(3) if name is None else positions[name] for name in slots.symbols]
        code = self.coordinates(np.concatenate(world).astype(np.float32)).reshape(-1, 3)
        code[empty] = 0
        if not self.symbolic_state:
            return code.ravel()
        supports = np.array(self.encode_supports(slots, state))
        return np.concatenate([code.ravel(), self.encode_places(supports)])

    def coordinates(self, positions: FloatArray) -> FloatArray:
        """World positions (..., position_size) in m as this encoding has them."""
        if self.relative:
            symbols = positions.reshape(*positions.shape[:-1], -1, 3)
            first, surface = self.grippers, self.grippers + self.boxes
            moved = symbols - symbols[..., first : first + 1, :]
            moved[..., first, :] = symbols[..., first, :] - symbols[..., surface, :]
            positions = moved.reshape(positions.shape)
        if not self.scale:
            return positions
        centre, scale = (np.array(part, dtype=np.float32) for part in (self.centre, self.scale))
        return (positions - centre) / scale

    def encode_places(self, supports: NDArray[np.integer[Any]]) -> FloatArray:
        """One-hots of what :meth:`encode_supports` returns: of tables, then of grippers.

        Args:
            supports: (..., boxes).

        Returns:
            (..., boxes · (tables + grippers)); zeros for a box at none of them.
        """
        tables = self.surfaces + self.boxes
        codes = np.array([*range(tables), *(-1 - gripper for gripper in range(self.grippers))])
        one_hot: FloatArray = np.equal(supports[..., None], codes).astype(np.float32)
        return one_hot.reshape(*supports.shape[:-1], -1)

    def encode_action(self, slots: Slots, action: Action) -> tuple[int, int, int, int] | None:
        """The classes of an action: instruction, gripper, box, table (-1 for a grasp).

        Returns:
            None if one of its symbols fills no slot.
        """
        if action.gripper not in slots.grippers or action.box not in slots.boxes:
            return None
        if action.table is not None and action.table not in slots.tables:
            return None
        return (
            INSTRUCTIONS.index(action.instruction),
            slots.grippers.index(action.gripper),
            slots.boxes.index(action.box),
            -1 if action.table is None else slots.tables.index(action.table),
        )

    def encode_supports(self, slots: Slots, state: State) -> tuple[int, ...]:
        """What each box stands on or is held by.

        Returns:
            (boxes,) the class of the table that a box stands on, or -1 - g if gripper g holds it;
            :data:`NOWHERE` for an empty slot or a support that fills none.
        """
        codes = {name: row for row, name in enumerate(slots.tables) if name is not None}
        codes |= {name: -1 - row for row, name in enumerate(slots.grippers) if name is not None}
        at = dict(state.support + state.held)
        return tuple(
            NOWHERE if name is None else codes.get(at[name], NOWHERE) for name in slots.boxes
        )

    def document(self) -> dict[str, Any]:
        """What is saved as JSON with the data set and the weights."""
        return {
            "version": VERSION,
            "slots": {name: getattr(self, name) for name in _SLOTS},
            **{key: getattr(self, name) for name, key in _FLAGS.items()},
            "normalisation": {"centre": list(self.centre), "scale": list(self.scale)},
            "inputs": list(self.input_names),
        }

    def _possible(self) -> bool:
        """Whether the values, which a file may have made up, are of the right types and sizes."""
        slots = [getattr(self, name) for name in _SLOTS]
        flags = [getattr(self, name) for name in _FLAGS]
        numbers = self.centre + self.scale
        return (
            all(type(count) is int and 1 <= count <= _MOST_SLOTS for count in slots)
            and all(type(flag) is bool for flag in flags)
            and all(type(number) is float and isfinite(number) for number in numbers)
            and all(scale > 0 for scale in self.scale)
            and len(self.scale) == len(self.centre)
            and len(self.scale) in (0, self.position_size)
        )

    @classmethod
    def parse(cls, document: object, where: str, stage: str) -> "Encoding":
        """Read what :meth:`document` wrote.

        Args:
            document: the value read from JSON.
            where: the file, for the message.
            stage: the stage that writes the file, for the message.

        Raises:
            InputError: another version, or a document that does not describe this encoding.
        """
        remedy = f"the encoding of version {VERSION}; run the stage {stage} again"
        if not isinstance(document, dict) or document.get("version") != VERSION:
            version = document.get("version") if isinstance(document, dict) else None
            raise InputError(f"{where}: encoding.version", f"is {version!r}", remedy)
        try:
            encoding = cls(
                **document["slots"],
                **{name: document[key] for name, key in _FLAGS.items()},
                centre=tuple(document["normalisation"]["centre"]),
                scale=tuple(document["normalisation"]["scale"]),
            )
            faithful = encoding._possible() and document == encoding.document()
        except (KeyError, TypeError, ValueError):
            faithful = False
        if not faithful:
            raise InputError(f"{where}: encoding", "is not what this program encodes", remedy)
        return encoding


def _boxes(goals: Iterable[Goal], symbols: Symbols) -> list[str]:
    """The boxes that goals name, as what moves or as what it shall stand on."""
    names = [name for goal in goals for name in (goal.box, goal.table)]
    return list(dict.fromkeys(name for name in names if name in symbols.boxes))


def _supports_first(goals: Objective) -> Objective:
    """The goals in their order, except that the goal of a support precedes what stands on it."""
    by_box = {goal.box: goal for goal in goals}
    ordered: dict[Goal, None] = {}

    def add(goal: Goal) -> None:
        if goal not in ordered:
            support = by_box.get(goal.table) if goal.table is not None else None
            if support is not None:
                add(support)
            ordered[goal] = None

    for goal in goals:
        add(goal)
    return tuple(ordered)


def _fill(
    count: int, declared: Sequence[str], first: Iterable[str], in_order: bool = False
) -> tuple[str | None, ...]:
    """Fill slots with ``first``, then with the others; whoever has a slot of its own keeps it.

    Args:
        count: the number of slots.
        declared: all symbols.
        first: those that are to have a slot in any case.
        in_order: leave nobody where it is; the slots are taken in order.
    """
    chosen = list(dict.fromkeys((*first, *declared)))[:count]
    slots = [None if in_order or name not in chosen else name for name in declared[:count]]
    slots += [None] * (count - len(slots))
    moved = iter([name for name in chosen if name not in slots])
    return tuple(name if name is not None else next(moved, None) for name in slots)
