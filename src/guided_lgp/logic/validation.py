"""Checks of a declared domain: what cannot be served is refused where it is declared."""

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING

from guided_lgp.errors import InputError
from guided_lgp.logic.declarations import (
    Atom,
    Attach,
    GoalType,
    Instruction,
    Term,
    Type,
    Variable,
)
from guided_lgp.logic.symbols import GRIPPER

if TYPE_CHECKING:
    from guided_lgp.logic.domain import Domain

_MOVABLE, _ANY = "a type with parents", "any type"
PREDICATES = {
    "holds": (GRIPPER, _MOVABLE),
    "held": (_MOVABLE,),
    "free": (GRIPPER,),
    "on": (_MOVABLE, _ANY),
    "clear": (_ANY,),
    "carries": (_MOVABLE, _ANY),
    "same": (_ANY, _ANY),
    "idle": (),
}
"""The predicates of every domain, with what their arguments have to be."""

Refuse = Callable[..., InputError]
"""Makes the error for a field: ``refuse(field, fault, accepted)``."""


def check_declarations(domain: "Domain") -> None:
    """Check types, instructions, goal types and facts of a domain.

    Raises:
        InputError: the first fault, with the domain's file, the field, and what is accepted.
    """

    def refuse(field: str, fault: str, accepted: str = "") -> InputError:
        return InputError(f"{domain.name}.py: {field}", fault, accepted)

    _check_types(domain.types, refuse)
    for field, declared in (
        ("types", domain.types),
        ("instructions", domain.instructions),
        ("goal_types", (*domain.goal_types, *domain.further_goals)),
        ("facts", domain.facts),
    ):
        _check_names(field, [one.name for one in declared], refuse)
    for fact in domain.facts:
        _check_parameters(f"fact {fact.name}", fact.parameters, domain, refuse)
        if fact.name in PREDICATES:
            raise refuse(f"fact {fact.name}", "is a predicate of every domain", "another name")
    for instruction in domain.instructions:
        _check_instruction(instruction, domain, refuse)
    for goal_type in (*domain.goal_types, *domain.further_goals):
        _check_goal_type(goal_type, domain, refuse)
    if domain.extends is not None:
        _check_names_kept(domain, domain.extends, refuse)


def _check_names_kept(domain: "Domain", base: "Domain", refuse: Refuse) -> None:
    for field in ("types", "instructions", "goal_types", "further_goals", "facts"):
        for one in getattr(base, field):
            if one not in getattr(domain, field):
                raise refuse("extends", f"{one.name} of {base.name} is missing", f"all its {field}")


def _check_types(types: Sequence[Type], refuse: Refuse) -> None:
    known = [declared.name for declared in types]
    if GRIPPER not in known:
        raise refuse("types", f"no type {GRIPPER!r}", "one for the robot's hands")
    for declared in types:
        for other in (*declared.also, *declared.parents):
            if other not in types:
                raise refuse(f"type {declared.name}", f"unknown type {other.name!r}", _list(known))


def _check_names(field: str, names: Sequence[str], refuse: Refuse) -> None:
    for name in names:
        if not name or any(character in "() \t\n" for character in name):
            raise refuse(field, f"{name!r} is not a name", "one word without brackets")
        if names.count(name) > 1:
            raise refuse(field, f"{name!r} is declared twice", "different names")


def _check_parameters(
    field: str, parameters: Sequence[Variable], domain: "Domain", refuse: Refuse
) -> None:
    _check_names(f"{field}, parameters", [variable.name for variable in parameters], refuse)
    for variable in parameters:
        if variable.type not in domain.types:
            known = _list(declared.name for declared in domain.types)
            fault = f"{variable.name} is of unknown type {variable.type.name!r}"
            raise refuse(f"{field}, parameters", fault, known)


def _check_instruction(one: Instruction, domain: "Domain", refuse: Refuse) -> None:
    field = f"instruction {one.name}"
    _check_parameters(field, one.parameters, domain, refuse)
    if not one.parameters or GRIPPER not in one.parameters[0].type.kinds:
        raise refuse(f"{field}, parameters", "the first is not a gripper", "the acting gripper")
    _check_atoms(f"{field}, precondition", one.precondition, one, domain, refuse)
    actor = one.parameters[0]
    if not any(_tells_of(atom, actor) for atom in one.precondition):
        name = actor.name
        accepted = f"free({name}) or holds({name}, ...)"
        raise refuse(f"{field}, precondition", f"does not say what {name} holds", accepted)
    _check_effect(f"{field}, effect", one, domain, refuse)
    _check_place(f"{field}, precondition", one, domain, refuse)
    for part, terms in (("contact", one.contact), ("motion", one.motion)):
        _check_terms(f"{field}, {part}", terms, one, refuse)


def _check_terms(
    field: str, terms: Iterable[Term], owner: Instruction | GoalType, refuse: Refuse
) -> None:
    for term in terms:
        options = [value for value in term.options.values() if isinstance(value, Variable)]
        _check_arguments(f"{field}, {term.name}", (*term.arguments, *options), owner, refuse)


def _check_goal_type(one: GoalType, domain: "Domain", refuse: Refuse) -> None:
    field = f"goal type {one.name}"
    _check_parameters(field, one.parameters, domain, refuse)
    _check_names(f"{field}, numbers", [number.name for number in one.numbers], refuse)
    _check_atoms(f"{field}, condition", one.condition, one, domain, refuse)
    for part in ("final", "postures", "lasting"):
        _check_terms(f"{field}, {part}", getattr(one, part), one, refuse)
    terms = (*one.final, *one.postures, *one.lasting)
    if not (one.condition or terms):
        raise refuse(f"{field}, condition", "is empty", "one or more atoms")
    if (one.numbers or one.series) and not terms:
        raise refuse(f"{field}, final", "is empty", "one or more terms, for the numbers")
    if one.derived is not None:
        _check_arguments(f"{field}, derived", [one.derived], one, refuse)


def _tells_of(atom: Atom, gripper: Variable) -> bool:
    return atom.predicate in ("free", "holds") and not atom.negated and atom.arguments[0] == gripper


def _check_effect(field: str, one: Instruction, domain: "Domain", refuse: Refuse) -> None:
    attached = [effect for effect in one.effect if isinstance(effect, Attach)]
    if len(attached) != 1:
        raise refuse(field, f"{len(attached)} of attach", "one: an action moves one body")
    (attach,) = attached
    body, parent = attach.body, attach.parent
    _check_arguments(f"{field}, attach", (body, parent), one, refuse)
    if not body.type.parents:
        movable = _list(declared.name for declared in domain.types if declared.parents)
        raise refuse(
            field, f"{body.name} is of type {body.type.name!r}, which has no parent", movable
        )
    accepted = [declared.name for declared in body.type.parents]
    if not set(parent.type.kinds) & set(accepted):
        fault = f"a {body.type.name} does not hang on a {parent.type.name}"
        raise refuse(field, fault, _list(accepted))
    if GRIPPER in parent.type.kinds and Atom("free", (parent,)) not in one.precondition:
        fault = f"{parent.name} may hold something already"
        raise refuse(field, fault, f"free({parent.name}) among the preconditions")
    facts = [effect for effect in one.effect if isinstance(effect, Atom)]
    _check_atoms(field, facts, one, domain, refuse)
    for fact in facts:
        if fact.predicate in PREDICATES:
            fault = f"{fact.predicate} follows from what hangs on what"
            declared = _list(known.name for known in domain.facts) or "none declared"
            raise refuse(field, fault, f"attach, and the facts of the domain: {declared}")


def _check_place(field: str, one: Instruction, domain: "Domain", refuse: Refuse) -> None:
    """That an instruction says where its body is before, and never hangs it below itself."""
    body, parent = one.attached.body, one.attached.parent
    if not any(_says_where(atom, body) for atom in one.precondition):
        accepted = f"holds(..., {body.name}), on({body.name}, ...) or ~held({body.name})"
        raise refuse(field, f"does not say what {body.name} hangs on", accepted)
    if _may_carry_its_parent(one, domain.types):
        accepted = f"~carries({body.name}, {parent.name})"
        raise refuse(field, f"{parent.name} may be {body.name}, or on it", accepted)


def _says_where(atom: Atom, body: Variable) -> bool:
    """Whether an atom says in which hand a body is, or that it is in none."""
    if atom.predicate == "holds":
        return atom.arguments[-1] == body and not atom.negated
    if atom.predicate == "on":
        return atom.arguments[0] == body and not atom.negated
    return atom == Atom("held", (body,), negated=True)


def _may_carry_its_parent(one: Instruction, types: Sequence[Type]) -> bool:
    body, parent = one.attached.body, one.attached.parent
    movable = [kind for kind in types if kind.parents and kind.is_a(parent.type)]
    if not movable or Atom("carries", (body, parent), negated=True) in one.precondition:
        return False
    same = any(kind.is_a(body.type) for kind in movable)
    return same or Atom("clear", (body,)) not in one.precondition


def _check_atoms(
    field: str,
    atoms: Sequence[Atom],
    owner: Instruction | GoalType,
    domain: "Domain",
    refuse: Refuse,
) -> None:
    facts = {fact.name: tuple(v.type.name for v in fact.parameters) for fact in domain.facts}
    known = PREDICATES | facts
    for atom in atoms:
        name = atom.predicate
        if name not in known:
            raise refuse(field, f"unknown predicate {name!r}", _list(known))
        _check_arguments(f"{field}, {name}", atom.arguments, owner, refuse)
        if len(atom.arguments) != len(known[name]):
            raise refuse(field, f"{name} of {len(atom.arguments)}", f"of {len(known[name])}")
        for variable, wanted in zip(atom.arguments, known[name], strict=True):
            fits = {_ANY, *variable.type.kinds} | ({_MOVABLE} if variable.type.parents else set())
            if wanted not in fits:
                fault = f"{variable.name} is of type {variable.type.name!r}"
                raise refuse(f"{field}, {name}", fault, wanted)


def _check_arguments(
    field: str,
    arguments: Iterable[object],
    owner: Instruction | GoalType,
    refuse: Refuse,
) -> None:
    for argument in arguments:
        if argument not in owner.parameters:
            name = argument.name if isinstance(argument, Variable) else repr(argument)
            accepted = _list(variable.name for variable in owner.parameters)
            raise refuse(field, f"{name} is not a parameter", accepted)


def _list(names: Iterable[str]) -> str:
    return ", ".join(names)
