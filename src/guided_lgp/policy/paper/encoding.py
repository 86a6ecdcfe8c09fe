"""Input and output encoding of the paper's policy (paper, Sec. II-B).

The networks have a fixed number of slots per logic type. A :class:`Slots` says which symbol of a
problem fills which slot and which goals are encoded; an :class:`Encoding` turns goals, positions
and actions into numbers once the slots are filled.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from guided_lgp.domains import PAPER
from guided_lgp.errors import InputError
from guided_lgp.faults import validated
from guided_lgp.logic import Action, Objective, State, Symbols, satisfied, unsatisfied
from guided_lgp.policy.arrays import FloatArray
from guided_lgp.policy.paper.documents import EncodingDocument, in_files
from guided_lgp.policy.paper.filling import Slots, fill, named, supports_first
from guided_lgp.policy.paper.signature import INSTRUCTION, Signature

VERSION = 1
"""Version of the encoding and of the files that hold it."""

NOWHERE = 127
"""The code of a body that is at no support or gripper of the slots."""

PAPER_SLOTS = (("gripper", 2), ("box", 3), ("table", 2))
"""The slots of the paper's networks, by logic type."""

_FLAGS = {
    "chain": "chain",
    "named_first": "named_first",
    "relative": "relative",
    "symbolic_state": "meaning",
}
"""The fields that are true or false, and their keys in files."""


@dataclass(frozen=True)
class Encoding:
    """The numbers of slots and the scaling of positions, and the encoding that follows from them.

    The input (g, s_k) is: per goal the one-hots of its type and of each of its symbols (zeros where
    a goal type has no such parameter), then the world x, y, z in m of every symbol. With the
    paper's domain and slots these are 2 · (2 + 3 + 5) + 7 · 3 = 41 numbers. An empty slot is zero.

    The paper takes positions as they are. What other recipes change is listed here; see
    :class:`guided_lgp.params.SampleRecipe`. One that normalises positions gives ``centre`` and
    ``scale``, one number each per coordinate: (position - centre) / scale. One that adds the
    symbolic state has one more number per goal, whether it holds, and, after the positions, for
    every body the one-hot of the support or gripper that it is at.
    """

    domain: str = PAPER
    """The name of the domain that declares instructions, goal types and logic types."""
    slots: tuple[tuple[str, int], ...] = PAPER_SLOTS
    """The number of slots for the own symbols of each logic type, in the order of the state."""
    goals: int = 2
    chain: bool = True
    """Whether sub-policies see the decisions before them in the chain."""
    named_first: bool = False
    """Whether the bodies that goals name fill the first slots, in the order of the goals."""
    relative: bool = False
    """Whether positions are relative to the body in the first slot."""
    symbolic_state: bool = False
    """Whether the input says what stands on what, what is held and which goals hold."""
    centre: tuple[float, ...] = ()
    scale: tuple[float, ...] = ()

    @cached_property
    def signature(self) -> Signature:
        """What the domain says about networks, chains and goals."""
        return Signature.of(self.domain)

    @property
    def chains(self) -> Mapping[str, tuple[str, ...]]:
        """The sub-policies of each network in the order of its classifier chain."""
        return self.signature.chains

    def count(self, kinds: Iterable[str]) -> int:
        """The number of slots for the own symbols of these types."""
        slots = dict(self.slots)
        return sum(slots.get(kind, 0) for kind in kinds)

    def counts(self, symbols: Symbols) -> tuple[tuple[str, int], ...]:
        """The number of own symbols of each logic type, to compare with the slots."""
        return tuple((kind, len(self.signature.own(kind, symbols))) for kind, _ in self.slots)

    @property
    def bodies(self) -> int:
        """The number of slots for what moves."""
        return self.count(self.signature.movable)

    @property
    def supports(self) -> int:
        """The number of slots for what bodies can stand on."""
        return self.count(self.signature.supports)

    @property
    def holders(self) -> int:
        """The number of slots for what can hold them."""
        return self.count(self.signature.holders)

    @property
    def goal_size(self) -> int:
        """Length of one encoded goal."""
        signature = self.signature
        arguments = sum(self.count(signature.kinds_of[name]) for name in signature.goal_variables)
        return len(signature.goal_kinds) + arguments + self.symbolic_state

    @property
    def position_size(self) -> int:
        """Number of coordinates in the encoded state."""
        return 3 * sum(count for _, count in self.slots)

    @property
    def state_size(self) -> int:
        """Length of the encoded state."""
        places = self.supports + self.holders
        return self.position_size + self.symbolic_state * self.bodies * places

    @property
    def input_size(self) -> int:
        """Length of the input of the first sub-policy of a chain."""
        return self.goals * self.goal_size + self.state_size

    @property
    def input_names(self) -> tuple[str, ...]:
        """What every input stands for, in order."""
        labels = {kind: "surface" if kind == "table" else kind for kind, _ in self.slots}
        slots = Slots(
            tuple(
                (kind, tuple(f"{labels[kind]}{index}" for index in range(1, count + 1)))
                for kind, count in self.slots
            ),
            goals=(),
        )
        signature = self.signature
        goal = [
            *signature.goal_kinds,
            *(
                f"{variable}={name}"
                for variable in signature.goal_variables
                for name in slots.of(signature.kinds_of[variable])
            ),
            *["holds"] * self.symbolic_state,
        ]
        bodies = slots.of(signature.movable) * self.symbolic_state
        places = slots.of((*signature.supports, *signature.holders))
        return (
            *(f"goal{index} {name}" for index in range(1, self.goals + 1) for name in goal),
            *(f"{name} {axis}" for name in slots.symbols for axis in "xyz"),
            *(f"{body} at {place}" for body in bodies for place in places),
        )

    def classes(self, sub_policy: str) -> int:
        """The number of classes of a sub-policy: its slots."""
        if sub_policy == INSTRUCTION:
            return len(self.signature.instructions)
        return self.count(self.signature.kinds_of[sub_policy])

    def chain_inputs(self, network: str) -> list[int]:
        """The input length of each sub-policy: the input, then the previous one-hots."""
        sizes = [self.input_size]
        for sub_policy in self.chains[network][:-1]:
            sizes.append(sizes[-1] + (self.classes(sub_policy) if self.chain else 0))
        return sizes

    def fill(self, objective: Objective, state: State, symbols: Symbols) -> Slots:
        """Choose the goals to encode and fill the slots.

        As many goals as there are slots are encoded as they are. Of more goals, a subset of the
        unsatisfied ones is, supports before what stands on them; if those goals name more symbols
        than there are slots, only the first of them. The slots then take the symbols that these
        goals name, the bodies that are held, and the others as declared, until they are full. A
        symbol whose place in the declaration is a slot keeps that slot, so that nothing moves
        in a problem that fits; unless bodies that are named come first. Of more bodies than slots
        they always do, lower ones first; the paper leaves the order open.
        """
        declared = {kind: self.signature.own(kind, symbols) for kind, _ in self.slots}
        goals = objective
        if len(goals) > self.goals or not self._fits(goals, declared):
            remaining = objective if satisfied(state, objective) else unsatisfied(state, objective)
            goals = supports_first(remaining)[: self.goals]
            if not self._fits(goals, declared):
                goals = goals[:1]
        filled = []
        for kind, count in self.slots:
            first, in_order = named(goals, declared[kind]), False
            if kind in self.signature.movable:
                first += [body for body in declared[kind] if state.holder(body) is not None]
                in_order = self.named_first or len(declared[kind]) > count
            filled.append((kind, fill(count, declared[kind], first, in_order)))
        return Slots(tuple(filled), goals)

    def _fits(self, goals: Objective, declared: Mapping[str, Sequence[str]]) -> bool:
        """Whether there are slots for all that the goals name."""
        return all(len(named(goals, declared[kind])) <= count for kind, count in self.slots)

    def encode_goals(self, slots: Slots, state: State) -> FloatArray:
        """The encoded objective g; one goal is encoded as the same goal twice.

        Args:
            slots: which symbol fills which slot, and the goals to encode.
            state: the symbolic state, for an encoding that says which goals hold.

        Returns:
            (goals · goal_size,) zeros and ones.
        """
        code = np.zeros((self.goals, self.goal_size), dtype=np.float32)
        for row in range(self.goals):
            goal = slots.goals[min(row, len(slots.goals) - 1)]
            code[row, self.signature.goal_kinds.index(goal.kind)] = 1
            arguments = self.signature.arguments(goal)
            column = len(self.signature.goal_kinds)
            for variable in self.signature.goal_variables:
                members = slots.of(self.signature.kinds_of[variable])
                if variable in arguments:
                    code[row, column + members.index(arguments[variable])] = 1
                column += len(members)
            if self.symbolic_state:
                code[row, -1] = satisfied(state, (goal,))
        return code.ravel()

    def encode_state(
        self, slots: Slots, state: State, positions: Mapping[str, NDArray[np.float64]]
    ) -> FloatArray:
        """The encoded state s_k.

        Args:
            slots: which symbol fills which slot.
            state: the symbolic state, for an encoding that has it.
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
            first = self._first(self.signature.movable[0])
            support = self._first(self.signature.supports[0])
            moved = symbols - symbols[..., first : first + 1, :]
            moved[..., first, :] = symbols[..., first, :] - symbols[..., support, :]
            positions = moved.reshape(positions.shape)
        if not self.scale:
            return positions
        centre, scale = (np.array(part, dtype=np.float32) for part in (self.centre, self.scale))
        return (positions - centre) / scale

    def _first(self, wanted: str) -> int:
        """The number of the first slot of a type among all."""
        return [kind for kind, count in self.slots for _ in range(count)].index(wanted)

    def encode_places(self, supports: NDArray[np.integer[Any]]) -> FloatArray:
        """One-hots of what :meth:`encode_supports` returns: of supports, then of grippers.

        Args:
            supports: (..., bodies).

        Returns:
            (..., bodies · (supports + grippers)); zeros for a body at none of them.
        """
        codes = np.array([*range(self.supports), *(-1 - holder for holder in range(self.holders))])
        one_hot: FloatArray = np.equal(supports[..., None], codes).astype(np.float32)
        return one_hot.reshape(*supports.shape[:-1], -1)

    def encode_actions(
        self, slots: Slots, actions: Iterable[Action]
    ) -> list[tuple[int, ...] | None]:
        """The classes of actions: the instruction, then one per parameter of any instruction.

        Returns:
            For each action, in the order of the signature's decisions; -1 where the instruction has
            no such parameter. None for an action on a symbol that fills no slot.
        """
        signature = self.signature
        rows = {name: _rows(slots.of(signature.kinds_of[name])) for name in signature.decisions[1:]}

        def encode(action: Action) -> tuple[int, ...] | None:
            arguments = signature.arguments(action)
            if any(symbol not in rows[name] for name, symbol in arguments.items()):
                return None
            symbols = (
                row[arguments[name]] if name in arguments else -1 for name, row in rows.items()
            )
            return signature.instructions.index(action.instruction), *symbols

        return [encode(action) for action in actions]

    def encode_supports(self, slots: Slots, state: State) -> tuple[int, ...]:
        """What each body stands on or is held by.

        Returns:
            (bodies,) the class of the support that a body stands on, or -1 - g if gripper g holds
            it; :data:`NOWHERE` for an empty slot or a support that fills none.
        """
        supports = slots.of(self.signature.supports)
        holders = slots.of(self.signature.holders)
        codes = _rows(supports) | {name: -1 - row for name, row in _rows(holders).items()}
        at = dict(state.support + state.held)
        bodies = slots.of(self.signature.movable)
        return tuple(NOWHERE if name is None else codes.get(at[name], NOWHERE) for name in bodies)

    def document(self) -> dict[str, Any]:
        """What is saved as JSON with the data set and the weights."""
        return {
            "version": VERSION,
            **({} if self.domain == PAPER else {"domain": self.domain}),
            "slots": {in_files(kind): count for kind, count in self.slots} | {"goals": self.goals},
            **{key: getattr(self, name) for name, key in _FLAGS.items()},
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
        validate = EncodingDocument.model_validate
        read = validated(validate, document, where, remedy, within="encoding")
        try:
            encoding = cls(
                domain=read.domain,
                slots=_known_slots(read),
                goals=read.slots["goals"],
                **{name: getattr(read, key) for name, key in _FLAGS.items()},
                centre=tuple(read.normalisation.centre),
                scale=tuple(read.normalisation.scale),
            )
            faithful = encoding._scaled_whole() and document == encoding.document()
        except (KeyError, InputError):
            faithful = False
        if not faithful:
            raise InputError(f"{where}: encoding", "is not what this program encodes", remedy)
        return encoding

    def _scaled_whole(self) -> bool:
        """Whether all coordinates are shifted and scaled, or none."""
        return len(self.centre) == len(self.scale) and len(self.scale) in (0, self.position_size)


def _rows(members: Sequence[str | None]) -> dict[str, int]:
    """The number of each symbol among the slots."""
    return {name: row for row, name in enumerate(members) if name is not None}


def _known_slots(read: EncodingDocument) -> tuple[tuple[str, int], ...]:
    """The slots that a file names, in the order of the domain's types."""
    kinds = Signature.of(read.domain).kinds
    return tuple((kind, read.slots[in_files(kind)]) for kind in kinds)
