"""One head per instruction of a domain, over the argument that the state leaves open.

A graph has one acting gripper. What it holds, and which other gripper holds something, follow from
the state; over the candidates for the one argument that is left, the head gives scores.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache

import numpy as np

from guided_lgp.logic import Action, Domain
from guided_lgp.logic.declarations import Atom, Instruction, Variable
from guided_lgp.policy.arrays import BoolArray
from guided_lgp.policy.relational.encoding import CARRIED, EDGE_FEATURES, Graphs, Situations

ACTOR, IN_HAND, OTHER, TARGET = "actor", "in hand", "other gripper", "target"
"""What an argument is: the acting gripper, what it holds, another gripper, or what is open."""

_READABLE = {
    ("free", ACTOR),
    ("holds", ACTOR, IN_HAND),
    ("holds", OTHER, TARGET),
    ("held", TARGET),
    ("carries", IN_HAND, TARGET),
    ("clear", TARGET),
    ("same", ACTOR, OTHER),
}
"""The statements of preconditions that :func:`_truth` reads off the graphs."""


@dataclass(frozen=True)
class Head:
    """Scores of one instruction: one per graph and node that its target may be."""

    instruction: Instruction
    roles: tuple[str, ...]
    """What each parameter is."""

    @property
    def holds(self) -> bool:
        """Whether the acting gripper must hold something."""
        return IN_HAND in self.roles

    @property
    def target(self) -> Variable:
        """The parameter that is open."""
        return self.instruction.parameters[self.roles.index(TARGET)]

    def target_of(self, action: Action) -> str:
        """The symbol that an action has for it."""
        return action.symbols[self.roles.index(TARGET)]

    def applicable(self, situations: Situations, inputs: Graphs) -> BoolArray:
        """(B, G, T) where the precondition holds."""
        boxes = situations.supports.shape[1]
        tables = situations.positions.shape[1]
        allowed = np.ones((len(situations.supports), situations.grippers, tables), dtype=bool)
        if self.target.type.parents:
            allowed[..., : tables - boxes] = False
        for atom in self.instruction.precondition:
            allowed &= _truth(self._named(atom), situations, inputs) != atom.negated
        return allowed

    def _named(self, atom: Atom) -> tuple[str, ...]:
        role = dict(zip(self.instruction.parameters, self.roles, strict=True))
        return atom.predicate, *(role[variable] for variable in atom.arguments)

    def readable(self) -> bool:
        """Whether its precondition can be read off the graphs."""
        return all(self._named(atom) in _READABLE for atom in self.instruction.precondition)


@cache
def heads(domain: Domain) -> Mapping[str, Head]:
    """The heads for the instructions of a domain; none for one that leaves more than a target."""
    found = {one.name: _head(one) for one in domain.instructions}
    return {name: head for name, head in found.items() if head is not None}


def _head(instruction: Instruction) -> Head | None:
    actor = instruction.parameters[0]
    held = {
        atom.arguments
        for atom in instruction.precondition
        if atom.predicate == "holds" and not atom.negated
    }

    def role(variable: Variable) -> str:
        if variable == actor:
            return ACTOR
        if (actor, variable) in held:
            return IN_HAND
        return OTHER if any(variable == holder for holder, _ in held) else TARGET

    head = Head(instruction, tuple(map(role, instruction.parameters)))
    return head if head.roles.count(TARGET) == 1 and head.readable() else None


def _truth(atom: tuple[str, ...], situations: Situations, inputs: Graphs) -> BoolArray:
    """(B, G or 1, T or 1) where a statement about actor, what it holds, and node holds."""
    held = inputs.held[..., None]
    boxes, tables = situations.supports.shape[1], situations.positions.shape[1]
    itself = np.equal(np.arange(tables), held)
    in_hand = np.zeros((len(held), 1, tables), dtype=bool)
    in_hand[:, 0, tables - boxes :] = situations.supports < 0
    carries: BoolArray = np.greater(inputs.edges[..., EDGE_FEATURES.index(CARRIED)], 0)
    truth: dict[tuple[str, ...], BoolArray] = {
        ("free", ACTOR): np.less(held, 0),
        ("holds", ACTOR, IN_HAND): np.greater_equal(held, 0),
        ("holds", OTHER, TARGET): in_hand & ~itself,
        ("held", TARGET): in_hand,
        ("carries", IN_HAND, TARGET): inputs.carried_by(inputs.held) | itself,
        ("clear", TARGET): ~np.logical_or.reduce(carries, axis=2)[:, None],
        ("same", ACTOR, OTHER): np.zeros((1, 1, 1), dtype=bool),
    }
    return truth[atom]
