"""Input and output encoding of the policy (paper, Sec. II-B; DESIGN §5 and §6).

The networks have a fixed number of slots per logic type. A :class:`Slots` says which symbol of a
problem fills which slot and which goals are encoded; an :class:`Encoding` turns goals, positions
and actions into numbers once the slots are filled.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from guided_lgp.errors import InputError
from guided_lgp.logic import Action, Goal, Objective, State, Symbols, satisfied, unsatisfied

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

_SLOTS = ("grippers", "boxes", "surfaces", "goals")

FloatArray = NDArray[np.float32]


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

    The paper takes positions as they are. A variant that normalises them gives ``centre`` and
    ``scale``, one number each per coordinate of the state: (position - centre) / scale.
    """

    grippers: int = 2
    boxes: int = 3
    surfaces: int = 2
    goals: int = 2
    chain: bool = True
    """Whether sub-policies see the decisions before them in the chain."""
    centre: tuple[float, ...] = ()
    scale: tuple[float, ...] = ()

    @property
    def goal_size(self) -> int:
        """Length of one encoded goal."""
        return len(GOAL_KINDS) + self.boxes + self.surfaces + self.boxes

    @property
    def state_size(self) -> int:
        """Length of the encoded state."""
        return 3 * (self.grippers + self.boxes + self.surfaces)

    @property
    def input_size(self) -> int:
        """Length of the input of the first sub-policy of a chain."""
        return self.goals * self.goal_size + self.state_size

    @property
    def input_names(self) -> tuple[str, ...]:
        """The meaning of every input, in order."""
        boxes = [f"box{index}" for index in range(1, self.boxes + 1)]
        surfaces = [f"surface{index}" for index in range(1, self.surfaces + 1)]
        grippers = [f"gripper{index}" for index in range(1, self.grippers + 1)]
        goal = [
            *GOAL_KINDS,
            *(f"box={name}" for name in boxes),
            *(f"table={name}" for name in surfaces + boxes),
        ]
        return (
            *(f"goal{index} {name}" for index in range(1, self.goals + 1) for name in goal),
            *(f"{name} {axis}" for name in grippers + boxes + surfaces for axis in "xyz"),
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
        in a problem that fits.
        """
        goals = objective
        if len(goals) > self.goals or len(_boxes(goals, symbols)) > self.boxes:
            remaining = objective if satisfied(state, objective) else unsatisfied(state, objective)
            goals = _supports_first(remaining)[: self.goals]
            if len(_boxes(goals, symbols)) > self.boxes:
                goals = goals[:1]
        held = [box for box in symbols.boxes if state.holder(box) is not None]
        named = [goal.table for goal in goals if goal.table in symbols.surfaces]
        return Slots(
            grippers=_fill(self.grippers, symbols.grippers, ()),
            boxes=_fill(self.boxes, symbols.boxes, [*_boxes(goals, symbols), *held]),
            surfaces=_fill(self.surfaces, symbols.surfaces, [name for name in named if name]),
            goals=goals,
        )

    def encode_goals(self, slots: Slots) -> FloatArray:
        """The encoded objective g; one goal is encoded as the same goal twice (DESIGN §5).

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
        return code.ravel()

    def encode_state(
        self, slots: Slots, positions: Mapping[str, NDArray[np.float64]]
    ) -> FloatArray:
        """The encoded state s_k.

        Args:
            slots: which symbol fills which slot.
            positions: world position (3,) in m of every symbol.

        Returns:
            (state_size,) positions in m, or normalised; zeros for an empty slot.
        """
        empty = [name is None for name in slots.symbols]
        world = [np.zeros(3) if name is None else positions[name] for name in slots.symbols]
        code = self.scaled(np.concatenate(world).astype(np.float32)).reshape(-1, 3)
        code[empty] = 0
        return code.ravel()

    def scaled(self, states: FloatArray) -> FloatArray:
        """Normalise positions (..., state_size), if this encoding does."""
        if not self.scale:
            return states
        centre, scale = (np.array(part, dtype=np.float32) for part in (self.centre, self.scale))
        return (states - centre) / scale

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
        """What each box stands on or is held by, for boxes and supports that all have slots.

        Returns:
            (boxes,) the class of the table that a box stands on, or -1 - g if gripper g holds it.
        """
        below = {name: slots.tables.index(table) for name, table in state.support}
        below |= {name: -1 - slots.grippers.index(gripper) for name, gripper in state.held}
        return tuple(below[name] for name in slots.boxes if name is not None)

    def document(self) -> dict[str, Any]:
        """What is saved as JSON with the data set and the weights."""
        return {
            "version": VERSION,
            "slots": {name: getattr(self, name) for name in _SLOTS},
            "chain": self.chain,
            "normalisation": {"centre": list(self.centre), "scale": list(self.scale)},
            "inputs": list(self.input_names),
        }

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
                chain=document["chain"],
                centre=tuple(document["normalisation"]["centre"]),
                scale=tuple(document["normalisation"]["scale"]),
            )
            faithful = document == encoding.document()
            faithful &= len(encoding.scale) in (0, encoding.state_size)
            faithful &= len(encoding.scale) == len(encoding.centre)
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


def _fill(count: int, declared: Sequence[str], first: Iterable[str]) -> tuple[str | None, ...]:
    """Fill slots with ``first``, then with the others; whoever has a slot of its own keeps it."""
    chosen = list(dict.fromkeys((*first, *declared)))[:count]
    slots = [name if name in chosen else None for name in declared[:count]]
    slots += [None] * (count - len(slots))
    moved = iter([name for name in chosen if name not in slots])
    return tuple(name if name is not None else next(moved, None) for name in slots)
