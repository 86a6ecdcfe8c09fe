"""Whether the terms of :mod:`guided_lgp.bounds.terms` serve what a domain declares."""

from collections.abc import Iterable
from inspect import BoundArguments, Parameter, signature

from guided_lgp.bounds.terms import find_term, term_names
from guided_lgp.errors import InputError
from guided_lgp.logic import Domain
from guided_lgp.logic.declarations import GoalType, Instruction, Term, Variable, on


def check_terms(domain: Domain) -> None:
    """Check every term that a domain declares, and that none is missing.

    A term is known, stands where it may and takes its arguments. An instruction has all terms that
    its attachment needs, by what those say of themselves; a goal about the place of a body on a
    support has the condition that it stands there.

    Raises:
        InputError: the first fault, with the domain's file, the field, and what is accepted.
    """
    for instruction in domain.instructions:
        where = f"{domain.name}.py: instruction {instruction.name}"
        for term in instruction.contact:
            _check_term(f"{where}, contact", "contact", term, {})
        _check_attachment(where, instruction)
    for goal_type in (*domain.goal_types, *domain.further_goals):
        _check_goal_type(f"{domain.name}.py: goal type {goal_type.name}", goal_type)


def _check_goal_type(where: str, goal_type: GoalType) -> None:
    names = [number.name for number in goal_type.numbers]
    names += [f"{goal_type.series}1"] if goal_type.series else []
    options = dict.fromkeys(names, 0.0)
    for part in ("lasting", "postures", "final"):
        for term in getattr(goal_type, part):
            _check_term(f"{where}, {part}", part, term, options)
    for term in goal_type.final:
        if on(*term.arguments) not in goal_type.condition:
            needed = _written("on", term.arguments)
            raise InputError(f"{where}, condition", f"lacks {needed}", f"what {term.name} needs")


def _check_term(where: str, part: str, term: Term, numbers: dict[str, float]) -> None:
    """One term where it is named, with the numbers of its goal."""
    where = f"{where}: {term.name}"
    accepted = [name for name in term_names() if find_term(name).part == part]
    if term.name not in accepted:
        raise InputError(where, "is an unknown term", ", ".join(accepted))
    bound = _bound(where, term, numbers)
    for name, argument in bound.arguments.items():
        fits = not isinstance(argument, Variable) or name in argument.type.kinds
        if name in _TYPES and not fits:
            raise InputError(where, f"{argument.name} is of type {argument.type.name!r}", name)


_TYPES = ("gripper", "box")
"""Names of terms' parameters that are the types of what they take."""


def _bound(where: str, term: Term, numbers: dict[str, float]) -> BoundArguments:
    """The arguments of a term by the names of its parameters."""
    takes = signature(find_term(term.name).add)
    parameters = list(takes.parameters.values())[1:]
    series = any(parameter.kind is Parameter.VAR_KEYWORD for parameter in parameters)
    try:
        if series and not numbers:
            raise TypeError("missing its numbers, a series")
        return takes.bind(None, *term.arguments, **term.options, **numbers)
    except TypeError as error:
        accepted = ", ".join(parameter.name for parameter in parameters)
        raise InputError(where, str(error), accepted) from None


def _check_attachment(where: str, instruction: Instruction) -> None:
    """That all terms are there which the effect on the mode tree needs."""
    body, parent = instruction.attached.body, instruction.attached.parent
    terms = {name: find_term(name) for name in term_names()}
    kinds = {term.attaches: name for name, term in terms.items() if term.attaches}
    if not kinds.keys() & set(parent.type.kinds):
        fault = f"no term attaches a {body.type.name} to a {parent.type.name}"
        accepted = ", ".join(f"a {kind} by {name}" for kind, name in kinds.items())
        raise InputError(f"{where}, effect", fault, accepted)
    needed = [(name, given) for name, term in terms.items() for given in term.needed(instruction)]
    named = {(term.name, term.arguments) for term in instruction.contact}
    for name, arguments in needed:
        if (name, arguments) not in named:
            accepted = ", ".join(_written(*term) for term in needed)
            raise InputError(f"{where}, contact", f"lacks {_written(name, arguments)}", accepted)


def _written(name: str, arguments: Iterable[Variable]) -> str:
    return f"{name}({', '.join(argument.name for argument in arguments)})"
