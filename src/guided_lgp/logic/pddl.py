"""A domain and its problems in PDDL, for classical planners, and the plans that they return.

The mode tree is one predicate, ``(parent ?body ?parent)``; all others are derived from it by
axioms, so that actions need no more than their declarations. Planners have to know axioms, negated
preconditions and universal effects, as Fast Downward does.
"""

import re
from collections.abc import Iterable, Sequence

from guided_lgp.errors import InputError
from guided_lgp.logic.actions import Action, Skeleton
from guided_lgp.logic.declarations import Atom, Attach, Instruction, Variable
from guided_lgp.logic.domain import Domain
from guided_lgp.logic.objectives import Objective
from guided_lgp.logic.state import GroundAtom, State
from guided_lgp.logic.symbols import Symbols

_HEAD = """(define (domain {name})
 (:requirements :adl :derived-predicates)
 (:predicates
  (parent ?x ?y) (holds ?g ?x) (held ?x) (free ?g) (on ?x ?y) (clear ?x) (carries ?x ?y) (idle)
  {own})
 (:derived (holds ?g ?x) (and (is-gripper ?g) (parent ?x ?g)))
 (:derived (held ?x) (exists (?g) (holds ?g ?x)))
 (:derived (free ?g) (and (is-gripper ?g) (not (exists (?x) (parent ?x ?g)))))
 (:derived (on ?x ?y) (and (parent ?x ?y) (not (is-gripper ?y))))
 (:derived (clear ?y) (not (exists (?x) (parent ?x ?y))))
 (:derived (carries ?x ?y) (or (= ?x ?y) (exists (?z) (and (on ?z ?x) (carries ?z ?y)))))
 (:derived (idle) (not (exists (?g ?x) (holds ?g ?x))))
"""


def domain_text(domain: Domain) -> str:
    """The domain file."""
    own = [f"(is-{declared.name} ?x)" for declared in domain.types]
    own += [_phrase(fact.name, map(_variable, fact.parameters)) for fact in domain.facts]
    actions = "".join(map(_action, domain.instructions))
    return _HEAD.format(name=domain.name, own=" ".join(own)) + actions + ")\n"


def problem_text(state: State, objective: Objective, symbols: Symbols) -> str:
    """The problem file of a start and goals.

    Raises:
        InputError: two names differ in case only, which PDDL ignores.
    """
    _names(symbols)
    facts = [f"(parent {body} {parent})" for body, parent in (*state.support, *state.held)]
    facts += [_phrase(fact[0], fact[1:]) for fact in state.facts]
    facts += [f"(is-{kind} {name})" for kind, names in symbols.members.items() for name in names]
    atoms = (atom for goal in objective for atom in symbols.domain.conditions(goal))
    return f"""(define (problem task) (:domain {symbols.domain.name})
 (:objects {" ".join(symbols.names)})
 (:init {" ".join(facts)})
 (:goal (and {" ".join(map(_ground, atoms))})))
"""


def read_plan(text: str, symbols: Symbols) -> Skeleton:
    """The skeleton of a plan, one action a line, comments after a semicolon.

    Raises:
        InputError: a line is no action of the domain, or names an unknown symbol.
    """
    names = _names(symbols)
    instructions = {one.name.lower(): one.name for one in symbols.domain.instructions}
    skeleton = []
    for line in re.sub(";.*", "", text).splitlines():
        if line.strip():
            found = Action.parse(line.lower())
            for name in found.symbols:
                if name not in names:
                    accepted = ", ".join(symbols.names)
                    raise InputError(f"action {found}", f"unknown symbol {name!r}", accepted)
            instruction = instructions.get(found.instruction, found.instruction)
            skeleton.append(Action(instruction, tuple(names[name] for name in found.symbols)))
            symbols.domain.bind(skeleton[-1])
    return tuple(skeleton)


def _names(symbols: Symbols) -> dict[str, str]:
    """The symbols by their names in PDDL."""
    names = {name.lower(): name for name in symbols.names}
    if len(names) < len(symbols.names):
        raise InputError("symbols", "names that differ in case only are one in PDDL")
    return names


def _action(one: Instruction) -> str:
    conditions = [f"(is-{v.type.name} {_variable(v)})" for v in one.parameters]
    conditions += map(_atom, one.precondition)
    effects = []
    for effect in one.effect:
        if isinstance(effect, Attach):
            body, parent = _variable(effect.body), _variable(effect.parent)
            conditions.append(f"(not (= {body} {parent}))")
            effects.append(f"(forall (?p) (not (parent {body} ?p))) (parent {body} {parent})")
        else:
            effects.append(_atom(effect))
    return f""" (:action {one.name}
  :parameters ({" ".join(map(_variable, one.parameters))})
  :precondition (and {" ".join(conditions)})
  :effect (and {" ".join(effects)}))
"""


def _variable(variable: Variable) -> str:
    return f"?{variable.name}"


def _atom(atom: Atom) -> str:
    return _literal(atom.predicate, list(map(_variable, atom.arguments)), atom.negated)


def _ground(atom: GroundAtom) -> str:
    return _literal(*atom)


def _literal(predicate: str, arguments: Sequence[str], negated: bool) -> str:
    phrase = _phrase("=" if predicate == "same" else predicate, arguments)
    return f"(not {phrase})" if negated else phrase


def _phrase(name: str, arguments: Iterable[str]) -> str:
    return f"({' '.join((name, *arguments))})"
