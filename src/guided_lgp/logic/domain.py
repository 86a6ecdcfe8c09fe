"""A domain: types, instructions and goal types, and what a ground action is by its declaration."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

from guided_lgp.errors import InputError
from guided_lgp.logic.actions import Action, Goal
from guided_lgp.logic.declarations import GoalType, Instruction, Term, Type, Variable
from guided_lgp.logic.symbols import Symbols


@dataclass(frozen=True)
class GroundTerm:
    """A term or step of a ground instruction: its variables are symbols."""

    name: str
    symbols: tuple[str, ...]
    options: Mapping[str, str | float] = field(default_factory=dict, hash=False)


@dataclass(frozen=True)
class GroundInstruction:
    """What an action is by its declaration, with symbols in place of variables."""

    action: Action
    actor: str
    """The acting gripper."""
    body: str
    """What changes its parent ..."""
    parent: str
    """... and what it hangs on afterwards."""
    contact: tuple[GroundTerm, ...]
    motion: tuple[GroundTerm, ...]


@dataclass(frozen=True)
class Domain:
    """Types, instructions and goal types; children and goals keep their order."""

    name: str
    types: tuple[Type, ...]
    instructions: tuple[Instruction, ...]
    goal_types: tuple[GoalType, ...]

    def __hash__(self) -> int:
        return hash(self.name)

    def symbols(self, **names: Iterable[str]) -> Symbols:
        """The symbols of a problem, by type: ``symbols(gripper=..., box=..., table=...)``.

        Raises:
            InputError: an unknown type, or a name given twice.
        """
        types = {declared.name: declared for declared in self.types}
        for name in names:
            if name not in types:
                raise InputError("symbols", f"unknown type {name!r}", ", ".join(types))
        own = {kind: tuple(members) for kind, members in names.items()}
        every = [name for members in own.values() for name in members]
        for name in every:
            if every.count(name) > 1:
                raise InputError("symbols", f"name {name!r} is used twice")
        return Symbols(self, {wanted.name: self._members(wanted, own) for wanted in self.types})

    def _members(self, wanted: Type, own: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
        """The symbols of a type: first its own, then those that are of it, too."""
        others = [declared for declared in self.types if declared != wanted]
        kinds = [wanted, *(other for other in others if other.is_a(wanted))]
        return tuple(name for kind in kinds for name in own.get(kind.name, ()))

    def bind(self, action: Action) -> GroundInstruction:
        """What the action is by its declaration.

        Raises:
            InputError: the domain has no such instruction, or it takes other symbols.
        """
        bound = self._bound.get(action)
        if bound is None:
            bound = self._bound[action] = self._bind(action)
        return bound

    @cached_property
    def _bound(self) -> dict[Action, GroundInstruction]:
        return {}

    def _bind(self, action: Action) -> GroundInstruction:
        self.check_action(action)
        instruction = self.instruction(action.instruction)
        assert instruction is not None
        value = dict(zip(instruction.parameters, action.symbols, strict=True))
        (effect,) = instruction.effect
        return GroundInstruction(
            action=action,
            actor=action.symbols[0],
            body=value[effect.body],
            parent=value[effect.parent],
            contact=tuple(_ground(term, value) for term in instruction.contact),
            motion=tuple(_ground(step, value) for step in instruction.motion),
        )

    def instruction(self, name: str) -> Instruction | None:
        """The instruction of a name."""
        return next((known for known in self.instructions if known.name == name), None)

    def goal_type(self, name: str) -> GoalType | None:
        """The goal type of a name."""
        return next((known for known in self.goal_types if known.name == name), None)

    def check_action(self, action: Action) -> None:
        """Check the name of an action and the number of its symbols.

        Raises:
            InputError: they fit none of the instructions.
        """
        known = self.instruction(action.instruction)
        if known is None or len(known.parameters) != len(action.symbols):
            accepted = signatures(self.instructions)
            raise InputError(f"action {str(action)!r}", "is not an action", accepted)

    def check_goal(self, goal: Goal) -> None:
        """Check the name of a goal and the number of its symbols.

        Raises:
            InputError: they fit none of the goal types.
        """
        known = self.goal_type(goal.kind)
        if known is None or len(known.parameters) != len(goal.symbols):
            accepted = signatures(self.goal_types)
            raise InputError(f"goal {str(goal)!r}", "is not a goal", accepted)


def signatures(declared: Iterable[Instruction | GoalType]) -> str:
    """How actions or goals are written: ``(grasp gripper box), (place gripper box table)``."""
    words = ((one.name, *(variable.name for variable in one.parameters)) for one in declared)
    return ", ".join(f"({' '.join(names)})" for names in words)


def _ground(term: Term, value: Mapping[Variable, str]) -> GroundTerm:
    options = {
        name: value[given] if isinstance(given, Variable) else given
        for name, given in term.options.items()
    }
    return GroundTerm(term.name, tuple(value[v] for v in term.arguments), options)
