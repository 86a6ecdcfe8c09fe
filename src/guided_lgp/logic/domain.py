"""A domain, and what a ground action is by its declaration."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache

from guided_lgp.errors import InputError
from guided_lgp.logic.actions import Action, Goal
from guided_lgp.logic.declarations import (
    Atom,
    FactType,
    GoalType,
    Instruction,
    Term,
    Type,
    Variable,
)
from guided_lgp.logic.state import Fact, GroundAtom, State
from guided_lgp.logic.symbols import Symbols
from guided_lgp.logic.validation import check_declarations


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
    into_hand: bool
    """Whether that parent is a gripper."""
    precondition: tuple[GroundAtom, ...]
    facts: tuple[GroundAtom, ...]
    """What else is true afterwards."""
    contact: tuple[GroundTerm, ...]
    motion: tuple[GroundTerm, ...]

    def facts_after(self, state: State) -> tuple[Fact, ...]:
        """The facts that hold after it."""
        if not self.facts:
            return state.facts
        facts = set(state.facts)
        for predicate, symbols, negated in self.facts:
            (facts.discard if negated else facts.add)((predicate, *symbols))
        return tuple(sorted(facts))


@dataclass(frozen=True)
class Domain:
    """Types, instructions, goal types and facts; children and goals keep their order.

    Raises:
        InputError: something is declared that cannot be served.
    """

    name: str
    types: tuple[Type, ...]
    instructions: tuple[Instruction, ...]
    goal_types: tuple[GoalType, ...]
    """Those from which objectives are drawn, and which policies encode."""
    further_goals: tuple[GoalType, ...] = ()
    """Others that users may ask for."""
    facts: tuple[FactType, ...] = ()
    extends: "Domain | None" = None
    """The domain to which this one adds instructions, for goals that need them."""

    def __post_init__(self) -> None:
        check_declarations(self)

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
        members = {wanted.name: self._members(wanted, own) for wanted in self.types}
        return Symbols(self, members, tuple(every))

    def _members(self, wanted: Type, own: Mapping[str, tuple[str, ...]]) -> tuple[str, ...]:
        """The symbols of a type: first its own, then those that are of it, too."""
        others = [declared for declared in self.types if declared != wanted]
        kinds = [wanted, *(other for other in others if other.is_a(wanted))]
        return tuple(name for kind in kinds for name in own.get(kind.name, ()))

    def state(
        self,
        support: Mapping[str, str],
        held: Mapping[str, str] | None = None,
        facts: Iterable[Fact] = (),
    ) -> State:
        """A state: what everything that stands stands on, and the gripper of all that is held."""
        standing, in_hand = sorted(support.items()), sorted((held or {}).items())
        return State(tuple(standing), tuple(in_hand), tuple(sorted(facts)), self)

    def bind(self, action: Action) -> GroundInstruction:
        """What the action is by its declaration.

        Raises:
            InputError: the domain has no such instruction, or it takes other symbols.
        """
        return _bind(self, action)

    def conditions(self, goal: Goal) -> tuple[GroundAtom, ...]:
        """What must be true for a goal to hold.

        Raises:
            InputError: the domain has no such goal type, or it takes other symbols.
        """
        return _conditions(self, goal)

    def instruction(self, action: Action) -> Instruction:
        """The instruction of an action.

        Raises:
            InputError: the domain has no such instruction, or it takes other symbols.
        """
        for known in self.instructions:
            if known.name == action.instruction and _fits(known, action.symbols):
                return known
        accepted = signatures(self.instructions)
        raise InputError(f"action {str(action)!r}", "is not an action", accepted)

    def goal_type(self, goal: Goal) -> GoalType:
        """The type of a goal.

        Raises:
            InputError: the domain has no such goal type, or it takes other symbols.
        """
        every = (*self.goal_types, *self.further_goals)
        for known in every:
            if known.name == goal.kind and _fits(known, goal.symbols):
                return known
        raise InputError(f"goal {str(goal)!r}", "is not a goal", signatures(every))

    def final_terms(self, goal: Goal) -> tuple[GroundTerm, ...]:
        """The terms on bodies that a goal adds to the end of a plan.

        Raises:
            InputError: as for ``goal_type``, or a number cannot be read.
        """
        return _goal_terms(self, goal, self.goal_type(goal).final)

    def posture_terms(self, goal: Goal) -> tuple[GroundTerm, ...]:
        """The terms on arms that a goal adds to the end of a plan; see ``final_terms``."""
        return _goal_terms(self, goal, self.goal_type(goal).postures)

    def lasting_terms(self, goal: Goal) -> tuple[GroundTerm, ...]:
        """The terms that a goal adds to every moment; see ``final_terms``."""
        return _goal_terms(self, goal, self.goal_type(goal).lasting)


def signatures(declared: Iterable[Instruction | GoalType]) -> str:
    """How actions or goals are written: ``(grasp gripper box), (place gripper box table)``."""
    return ", ".join(map(_signature, declared))


def _signature(declared: Instruction | GoalType) -> str:
    words = [variable.name for variable in declared.parameters]
    if isinstance(declared, GoalType):
        words = [f"[{word}]" if _is_derived(declared, word) else word for word in words]
        words += [n.name if n.default is None else f"[{n.name}]" for n in declared.numbers]
        words += [f"{declared.series} ..."] if declared.series else []
    return f"({' '.join((declared.name, *words))})"


def _is_derived(declared: GoalType, name: str) -> bool:
    return declared.derived is not None and declared.derived.name == name


def _fits(declared: Instruction | GoalType, symbols: tuple[str, ...]) -> bool:
    beyond = len(symbols) - len(declared.parameters)
    if isinstance(declared, Instruction):
        return beyond == 0
    required = sum(number.default is None for number in declared.numbers)
    if declared.series:
        return beyond > len(declared.numbers)
    return required <= beyond <= len(declared.numbers)


@cache
def _bind(domain: Domain, action: Action) -> GroundInstruction:
    instruction = domain.instruction(action)
    value = dict(zip(instruction.parameters, action.symbols, strict=True))
    facts = [effect for effect in instruction.effect if isinstance(effect, Atom)]
    return GroundInstruction(
        action=action,
        actor=action.symbols[0],
        body=value[instruction.attached.body],
        parent=value[instruction.attached.parent],
        into_hand=instruction.into_hand,
        precondition=tuple(_ground_atom(atom, value) for atom in instruction.precondition),
        facts=tuple(_ground_atom(atom, value) for atom in facts),
        contact=tuple(_ground_term(term, value) for term in instruction.contact),
        motion=tuple(_ground_term(step, value) for step in instruction.motion),
    )


@cache
def _conditions(domain: Domain, goal: Goal) -> tuple[GroundAtom, ...]:
    goal_type = domain.goal_type(goal)
    value = dict(zip(goal_type.parameters, goal.symbols, strict=False))
    return tuple(_ground_atom(atom, value) for atom in goal_type.condition)


@cache
def _goal_terms(domain: Domain, goal: Goal, terms: tuple[Term, ...]) -> tuple[GroundTerm, ...]:
    goal_type = domain.goal_type(goal)
    value = dict(zip(goal_type.parameters, goal.symbols, strict=False))
    options = _numbers(goal, goal_type)
    ground = (_ground_term(term, value) for term in terms)
    return tuple(GroundTerm(one.name, one.symbols, {**one.options, **options}) for one in ground)


def _numbers(goal: Goal, goal_type: GoalType) -> dict[str, float]:
    given = goal.symbols[len(goal_type.parameters) :]
    values = {number.name: number.default for number in goal_type.numbers}
    if goal_type.series:
        beyond = len(given) - len(values)
        values |= {f"{goal_type.series}{place + 1}": None for place in range(beyond)}
    for name, text in zip(values, given, strict=False):
        try:
            values[name] = float(text)
        except ValueError:
            values[name] = math.nan
        if not math.isfinite(values[name] or 0.0):
            raise InputError(f"goal {goal}", f"{name} is {text!r}", "a number in m or rad")
    return {name: value for name, value in values.items() if value is not None}


def _ground_atom(atom: Atom, value: Mapping[Variable, str]) -> GroundAtom:
    return GroundAtom(atom.predicate, tuple(value[v] for v in atom.arguments), atom.negated)


def _ground_term(term: Term, value: Mapping[Variable, str]) -> GroundTerm:
    options = {
        name: value[given] if isinstance(given, Variable) else given
        for name, given in term.options.items()
    }
    return GroundTerm(term.name, tuple(value[v] for v in term.arguments), options)
