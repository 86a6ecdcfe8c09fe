"""The domain in STRIPS, as classical planners want it, without delete effects.

Facts are the atoms that some precondition or goal asks for; what is not held is ``standing``.
"""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

from guided_lgp.logic.actions import Action
from guided_lgp.logic.domain import Domain, GroundInstruction
from guided_lgp.logic.grounding import ground_instructions
from guided_lgp.logic.objectives import Objective
from guided_lgp.logic.state import Fact, GroundAtom, State
from guided_lgp.logic.symbols import Symbols


@dataclass(frozen=True)
class RelaxedOperator:
    """An action by the facts that it needs and the facts that it adds."""

    action: Action
    preconditions: frozenset[Fact]
    additions: frozenset[Fact]


def relaxed_operators(symbols: Symbols) -> list[RelaxedOperator]:
    """Delete relaxation of all actions.

    Conditions that are no STRIPS facts, such as what a table stands on, are left out, too. Both
    only ever make plans shorter, so heuristics that are admissible for this relaxation are
    admissible for the domain.
    """
    used = _used(symbols.domain)
    return [
        RelaxedOperator(
            one.action,
            frozenset(_strips_facts(one.precondition)),
            frozenset(fact for fact in _additions(one, symbols) if fact[0] in used),
        )
        for one in ground_instructions(symbols)
    ]


def facts(state: State, symbols: Symbols) -> frozenset[Fact]:
    """What holds in a state."""
    busy = {gripper for _, gripper in state.held}
    carrying = {parent for _, parent in state.support}
    every: list[Fact] = [("free", gripper) for gripper in symbols.grippers if gripper not in busy]
    every += [fact for body, support in state.support for fact in _standing(body, support)]
    every += [fact for body, gripper in state.held for fact in _in_hand(body, gripper)]
    every += [("clear", name) for name in symbols.names if name not in busy | carrying]
    every += state.facts
    every += [_absent(fact) for fact in _domain_facts(symbols) if fact not in state.facts]
    used = _used(symbols.domain)
    return frozenset(fact for fact in every if fact[0] in used)


def goal_facts(objective: Objective, symbols: Symbols) -> frozenset[Fact]:
    """The facts that an objective asks for."""
    conditions = [atom for goal in objective for atom in symbols.domain.conditions(goal)]
    if GroundAtom("idle", (), False) in conditions:
        conditions += [GroundAtom("free", (gripper,), False) for gripper in symbols.grippers]
    return frozenset(_strips_facts(conditions))


def _strips_facts(atoms: Iterable[GroundAtom]) -> Iterator[Fact]:
    """Atoms as facts, as far as there are such facts."""
    for predicate, names, negated in atoms:
        if predicate in ("same", "carries", "idle"):
            continue
        if predicate == "held":
            yield ("standing" if negated else "held", *names)
        elif not negated:
            yield (predicate, *names)
        elif predicate not in ("holds", "free", "on", "clear"):
            yield _absent((predicate, *names))


def _additions(one: GroundInstruction, symbols: Symbols) -> Iterator[Fact]:
    """Whatever may be true after an action that was not true before."""
    yield from (_in_hand if one.into_hand else _standing)(one.body, one.parent)
    for parent in _left(one, symbols):
        yield ("free" if parent in symbols.grippers else "clear", parent)
    for predicate, names, negated in one.facts:
        fact = (predicate, *names)
        yield _absent(fact) if negated else fact


def _left(one: GroundInstruction, symbols: Symbols) -> Sequence[str]:
    """What the body may have hung on before, by the precondition."""
    for predicate, names, negated in one.precondition:
        if not negated and (predicate, names[-1]) == ("holds", one.body):
            return names[:1]
        if not negated and (predicate, names[0]) == ("on", one.body):
            return names[1:]
        if negated and (predicate, names[0]) == ("held", one.body):
            return [name for name in symbols.names if name not in symbols.grippers]
    return symbols.names


def _in_hand(body: str, gripper: str) -> tuple[Fact, ...]:
    return ("holds", gripper, body), ("held", body)


def _standing(body: str, support: str) -> tuple[Fact, ...]:
    return ("on", body, support), ("standing", body)


def _absent(fact: Fact) -> Fact:
    return (f"not {fact[0]}", *fact[1:])


def _domain_facts(symbols: Symbols) -> Iterator[Fact]:
    """The facts that actions speak of."""
    declared = {fact.name for fact in symbols.domain.facts}
    for one in ground_instructions(symbols):
        for predicate, names, _ in (*one.precondition, *one.facts):
            if predicate in declared:
                yield (predicate, *names)


def _used(domain: Domain) -> frozenset[str]:
    """The predicates of the facts that conditions ask for."""
    asked = [atom for one in domain.instructions for atom in one.precondition]
    goal_types = (*domain.goal_types, *domain.further_goals)
    asked += [atom for one in goal_types for atom in one.condition]
    atoms = (GroundAtom(atom.predicate, ("",), atom.negated) for atom in asked)
    return frozenset(predicate for predicate, _ in _strips_facts(atoms))
