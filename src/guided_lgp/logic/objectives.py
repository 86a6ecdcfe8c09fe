"""Objectives: sets of goals, their enumeration, their lower bounds, and their validation."""

import math
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache
from itertools import combinations

from guided_lgp.errors import InputError
from guided_lgp.logic.actions import Goal
from guided_lgp.logic.domain import signatures
from guided_lgp.logic.grounding import all_goals, ground_instructions
from guided_lgp.logic.state import GroundAtom, State
from guided_lgp.logic.symbols import Symbols

Objective = tuple[Goal, ...]
"""A logic state objective g: the goals that must hold together."""


def satisfied(state: State, objective: Objective) -> bool:
    """Whether every goal of the objective holds."""
    return all(state.satisfies(goal) for goal in objective)


def unsatisfied(state: State, objective: Objective) -> Objective:
    """The goals that do not hold yet: the adapted objective (paper, Sec. III-A)."""
    return tuple(goal for goal in objective if not state.satisfies(goal))


def least_actions(state: State, objective: Objective, symbols: Symbols) -> float:
    """A lower bound on the number of actions to an objective.

    For every body that the goals speak of, the fewest changes of its parent until they hold, all
    else left out of account, and one for every other body in a hand that shall be empty. No action
    moves two bodies, so that these numbers add up.

    Returns:
        Infinity if a body can never get where it should be.
    """
    if satisfied(state, objective):
        return 0
    wanted = _wanted_parents(objective, symbols)
    changes = [
        _changes_of_parent(symbols, body, parents).get(state.parent_of(body), math.inf)
        for body, parents in wanted.items()
    ]
    emptied = _emptied(objective, symbols)
    changes += [1 for body, gripper in state.held if gripper in emptied and body not in wanted]
    return max(1, sum(changes))


@lru_cache(maxsize=4096)
def _wanted_parents(objective: Objective, symbols: Symbols) -> Mapping[str, frozenset[str]]:
    """The parents that the goals leave to each body that they speak of."""
    wanted: dict[str, frozenset[str]] = {}
    for goal in objective:
        for body, parents in parents_wanted_by(goal, symbols).items():
            wanted[body] = wanted.get(body, parents) & parents
    return wanted


@lru_cache(maxsize=4096)
def _emptied(objective: Objective, symbols: Symbols) -> frozenset[str]:
    """The grippers that shall hold nothing."""
    emptied: set[str] = set()
    for goal in objective:
        for predicate, names, negated in symbols.domain.conditions(goal):
            if predicate in ("free", "idle") and not negated:
                emptied.update(names or symbols.grippers)
    return frozenset(emptied)


@lru_cache(maxsize=4096)
def encodable(objective: Objective, symbols: Symbols) -> Objective:
    """What an objective asks for in the goal types that policies encode.

    Of a further goal this is what its conditions imply: ``(heldby red pr2L)`` asks for
    ``(held red)``.
    """
    drawn = {goal_type.name for goal_type in symbols.domain.goal_types}
    found: list[Goal] = []
    for goal in objective:
        found += [goal] if goal.kind in drawn else _implied(goal, symbols)
    return tuple(dict.fromkeys(found))


def _implied(goal: Goal, symbols: Symbols) -> Iterator[Goal]:
    """The goals of one atom each, of the domain's goal types, that hold wherever a goal does."""
    atoms = list(symbols.domain.conditions(goal))
    atoms += [
        GroundAtom("held", atom.symbols[1:], False)
        for atom in atoms
        if (atom.predicate, atom.negated) == ("holds", False)
    ]
    for goal_type in symbols.domain.goal_types:
        if len(goal_type.condition) != 1:
            continue
        (condition,) = goal_type.condition
        for atom in atoms:
            if atom[::2] == (condition.predicate, condition.negated):
                value = dict(zip(condition.arguments, atom.symbols, strict=True))
                yield Goal(goal_type.name, tuple(value[v] for v in goal_type.parameters))


def asks_for_places(objective: Objective, symbols: Symbols) -> bool:
    """Whether a state does not tell whether bodies are where an objective wants them."""
    return any(symbols.domain.final_terms(goal) for goal in objective)


def parents_wanted_by(goal: Goal, symbols: Symbols) -> Mapping[str, frozenset[str]]:
    """The parents that one goal leaves to the body that it speaks of, if it speaks of one."""
    wanted = {}
    for atom in symbols.domain.conditions(goal):
        match atom:
            case GroundAtom("on", (body, parent), False):
                wanted[body] = frozenset({parent})
            case GroundAtom("holds", (gripper, body), False):
                wanted[body] = frozenset({gripper})
            case GroundAtom("held", (body,), False):
                wanted[body] = frozenset(symbols.grippers)
    return wanted


@lru_cache(maxsize=4096)
def _changes_of_parent(symbols: Symbols, body: str, wanted: frozenset[str]) -> Mapping[str, int]:
    """Fewest actions on a body until its parent is one of the wanted ones, from each parent."""
    moves = [one for one in ground_instructions(symbols) if one.body == body]
    steps = dict.fromkeys(wanted, 0)
    for parent in (queue := list(wanted)):  # it grows on the way
        for one in moves:
            if one.parent == parent:
                for before in symbols.names:
                    if before not in steps and may_leave(before, one.precondition, body, symbols):
                        steps[before] = steps[parent] + 1
                        queue.append(before)
    return steps


def may_leave(
    parent: str, precondition: tuple[GroundAtom, ...], body: str, symbols: Symbols
) -> bool:
    """Whether the body may hang on a parent, by what a precondition says of the two."""
    in_hand = parent in symbols.grippers
    for atom in precondition:
        match atom:
            case GroundAtom("held", (other,), negated) if other == body:
                possible = in_hand != negated
            case GroundAtom("holds", (gripper, other), negated) if other == body:
                possible = (gripper == parent) != negated
            case GroundAtom("on", (other, support), negated) if other == body:
                possible = (support == parent) != negated
            case _:
                possible = True
        if not possible:
            return False
    return True


def format_objective(objective: Objective) -> str:
    """Write an objective as one line, readable by :func:`parse_objective`."""
    return " ".join(map(str, objective))


def parse_objective(goals: Iterable[str]) -> Objective:
    """Read goals such as ``(on red green)``; a goal given twice counts once.

    Raises:
        InputError: a goal cannot be read.
    """
    return tuple(dict.fromkeys(Goal.parse(text) for text in goals))


def one_goal_objectives(symbols: Symbols) -> list[Objective]:
    """All objectives of one goal (15 in setup a)."""
    return [(goal,) for goal in all_goals(symbols)]


def two_goal_objectives(symbols: Symbols) -> list[Objective]:
    """All unordered pairs of goals that do not contradict each other (72 in setup a)."""
    return [
        pair for pair in combinations(all_goals(symbols), 2) if contradiction(pair, symbols) is None
    ]


def contradiction(objective: Objective, symbols: Symbols) -> str | None:
    """Why the goals cannot all hold, or None if nothing speaks against them."""
    parents: dict[str, frozenset[str]] = {}
    first: dict[str, Goal] = {}
    for goal in objective:
        for body, wanted in parents_wanted_by(goal, symbols).items():
            other = first.setdefault(body, goal)
            parents[body] = parents.get(body, wanted) & wanted
            if not parents[body]:
                return f"{other} and {goal} contradict each other: {body} is in one place only"
    for body, goal in first.items():
        chain = [body]
        while (below := parents.get(chain[-1])) is not None and len(below) == 1:
            (support,) = below
            if support in chain:
                return f"{goal} is part of a cycle: a box cannot stand on itself through others"
            chain.append(support)
    return None


def validate_objective(objective: Objective, symbols: Symbols, state: State) -> None:
    """Check an objective before any search.

    Raises:
        InputError: see :func:`check_objective`; or nothing is left to do.
    """
    check_objective(objective, symbols)
    if satisfied(state, objective) and not asks_for_places(objective, symbols):
        raise InputError("objective", f"{format_objective(objective)} already holds in the scene")


def check_objective(objective: Objective, symbols: Symbols) -> None:
    """Check that an objective can hold at all.

    Raises:
        InputError: unknown goal or symbol, contradictory goals, or more to hold than grippers.
    """
    domain = symbols.domain
    goal_types = (*domain.goal_types, *domain.further_goals)
    if not objective:
        raise InputError("goal", "none given", f"one or more of {signatures(goal_types)}")
    for goal in objective:
        _check_symbols(goal, symbols)
    fault = contradiction(objective, symbols)
    if fault is not None:
        raise InputError("objective", fault)
    _check_hands(objective, symbols)


def _check_symbols(goal: Goal, symbols: Symbols) -> None:
    parameters = symbols.domain.goal_type(goal).parameters
    for variable, name in zip(parameters, goal.symbols, strict=False):
        kind = variable.type.name
        if not symbols.is_a(name, kind):
            accepted = ", ".join(symbols.of(kind))
            raise InputError(f"goal {goal}", f"unknown {kind} {name!r}", accepted)


def _check_hands(objective: Objective, symbols: Symbols) -> None:
    """A gripper holds one thing; goals may ask for a certain one, or for an empty one."""
    hands = frozenset(symbols.grippers) - _emptied(objective, symbols)
    wanted = _wanted_parents(objective, symbols).values()
    held = [parents & hands for parents in wanted if parents <= frozenset(symbols.grippers)]
    if len(held) > len(hands):
        limit = f"at most {len(hands)}, one per gripper"
        boxes = "1 box" if len(held) == 1 else f"{len(held)} boxes"
        raise InputError("objective", f"{boxes} to hold", limit)
    named = [parents for parents in held if len(parents) == 1 < len(hands)]
    if len(set(named)) < len(named) or frozenset() in held:
        raise InputError("objective", "a gripper is to hold two things, or one while it is empty")
