"""What the networks decide about, in which order, and what they see, by a domain's declarations.

One network chooses the instruction; one per instruction chooses its symbols, one after another, in
a classifier chain (paper, Sec. II-A). For pick-and-place these are the chains gripper → box and
gripper → box → table.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

from guided_lgp.domains import load_domain
from guided_lgp.errors import InputError
from guided_lgp.logic import Action, Domain, Goal, Symbols
from guided_lgp.logic.declarations import GoalType, Instruction, Type, Variable
from guided_lgp.logic.symbols import GRIPPER

INSTRUCTION = "instruction"
"""The network, and its one decision, that comes before all others."""


@dataclass(frozen=True)
class Signature:
    """Names and orders that follow from a domain."""

    domain: Domain

    @classmethod
    def of(cls, name: str) -> "Signature":
        """That of a declared domain.

        Raises:
            InputError: there is no such domain, or it gives a name to parameters of two types.
        """
        signature = cls(load_domain(name))
        for declared in signature._declared:
            for variable in declared.parameters:
                if signature.variables[variable.name] != variable:
                    fault = f"{declared.name}: {variable.name!r} has two types"
                    raise InputError(f"domain {name}", fault, "one type for every name")
        return signature

    @cached_property
    def instructions(self) -> tuple[str, ...]:
        """The names of the instructions: the classes of the first decision."""
        return tuple(instruction.name for instruction in self.domain.instructions)

    @cached_property
    def goal_kinds(self) -> tuple[str, ...]:
        """The names of the goal types."""
        return tuple(goal.name for goal in self.domain.goal_types)

    @cached_property
    def chains(self) -> Mapping[str, tuple[str, ...]]:
        """The sub-policies of each network in the order of its classifier chain."""
        return {INSTRUCTION: (INSTRUCTION,)} | {
            instruction.name: tuple(variable.name for variable in instruction.parameters)
            for instruction in self.domain.instructions
        }

    @cached_property
    def decisions(self) -> tuple[str, ...]:
        """All sub-policies: the instruction, then the parameters of the instructions."""
        return tuple(dict.fromkeys(name for chain in self.chains.values() for name in chain))

    @cached_property
    def variables(self) -> Mapping[str, Variable]:
        """The parameters of instructions and goal types by their names."""
        return {v.name: v for v in _distinct_variables(self._declared)}

    @cached_property
    def _declared(self) -> tuple[Instruction | GoalType, ...]:
        return (*self.domain.instructions, *self.domain.goal_types)

    @cached_property
    def goal_variables(self) -> tuple[str, ...]:
        """The parameters of the goal types."""
        return tuple(variable.name for variable in _distinct_variables(self.domain.goal_types))

    @cached_property
    def kinds(self) -> tuple[str, ...]:
        """The names of all types, in the order in which the instructions name them."""
        variables = _distinct_variables(self.domain.instructions)
        return _names(*(v.type for v in variables), *self.domain.types)

    @cached_property
    def kinds_of(self) -> Mapping[str, tuple[str, ...]]:
        """For each parameter, its type and those whose symbols are of it, too."""
        return {name: self._within(variable.type) for name, variable in self.variables.items()}

    @cached_property
    def movable(self) -> tuple[str, ...]:
        """The types of what has a parent."""
        return tuple(kind for kind in self.kinds if self._types[kind].parents)

    @cached_property
    def holders(self) -> tuple[str, ...]:
        """The types of parents that hold ..."""
        return self._within(*(kind for kind in self._parents if kind.name == GRIPPER))

    @cached_property
    def supports(self) -> tuple[str, ...]:
        """... and of those that support."""
        return self._within(*(kind for kind in self._parents if kind.name != GRIPPER))

    @cached_property
    def _types(self) -> Mapping[str, Type]:
        return {kind.name: kind for kind in self.domain.types}

    @property
    def _parents(self) -> Iterable[Type]:
        return (parent for kind in self.movable for parent in self._types[kind].parents)

    def _within(self, *wanted: Type) -> tuple[str, ...]:
        """Types, each followed by those whose symbols are of it, too."""
        return _names(
            *(
                kind
                for one in wanted
                for kind in (one, *(other for other in self.domain.types if other.is_a(one)))
            )
        )

    def own(self, kind: str, symbols: Symbols) -> tuple[str, ...]:
        """The symbols of a type that are of no narrower type."""
        narrower = {name for other in self._narrower[kind] for name in symbols.of(other)}
        return tuple(name for name in symbols.of(kind) if name not in narrower)

    @cached_property
    def _narrower(self) -> Mapping[str, tuple[str, ...]]:
        return {kind: self._within(declared)[1:] for kind, declared in self._types.items()}

    def arguments(self, named: Action | Goal) -> Mapping[str, str]:
        """The symbols of an action or goal by the names of the parameters."""
        declared: Instruction | GoalType
        if isinstance(named, Action):
            declared = self.domain.instruction(named)
        else:
            declared = self.domain.goal_type(named)
        return dict(zip((v.name for v in declared.parameters), named.symbols, strict=True))


def _names(*kinds: Type) -> tuple[str, ...]:
    return tuple(dict.fromkeys(kind.name for kind in kinds))


def _distinct_variables(declared: Iterable[Instruction | GoalType]) -> tuple[Variable, ...]:
    return tuple(dict.fromkeys(variable for one in declared for variable in one.parameters))
