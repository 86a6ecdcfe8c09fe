"""Objectives: sets of goals, their enumeration for setup a, and their validation (DESIGN §2)."""

from collections.abc import Iterable
from itertools import combinations

from guided_lgp.errors import InputError
from guided_lgp.logic.actions import Goal
from guided_lgp.logic.domain import signatures
from guided_lgp.logic.state import State
from guided_lgp.logic.symbols import Symbols

Objective = tuple[Goal, ...]
"""A logic state objective g: the goals that must hold together."""


def satisfied(state: State, objective: Objective) -> bool:
    """Whether every goal of the objective holds."""
    return all(state.satisfies(goal) for goal in objective)


def unsatisfied(state: State, objective: Objective) -> Objective:
    """The goals that do not hold yet: the adapted objective (paper, Sec. III-A)."""
    return tuple(goal for goal in objective if not state.satisfies(goal))


def least_actions(state: State, objective: Objective) -> int:
    """A lower bound on the number of actions to an objective: those on its own boxes.

    A box that must be held needs a grasp, one that must stand elsewhere a place, too, unless it is
    in a gripper already. No action serves two boxes, and a box has one goal.
    """
    return sum(
        1 if goal.kind == "held" or state.holder(goal.box) is not None else 2
        for goal in unsatisfied(state, objective)
    )


def format_objective(objective: Objective) -> str:
    """Write an objective as one line, readable by :func:`parse_objective`."""
    return " ".join(map(str, objective))


def parse_objective(goals: Iterable[str]) -> Objective:
    """Read goals such as ``(on red green)``; a goal given twice counts once.

    Raises:
        InputError: a goal cannot be read.
    """
    return tuple(dict.fromkeys(Goal.parse(text) for text in goals))


def all_goals(symbols: Symbols) -> list[Goal]:
    """Every goal over the symbols: held for each box, then on for each box and other table."""
    held = [Goal("held", (box,)) for box in symbols.boxes]
    on = [
        Goal("on", (box, table))
        for box in symbols.boxes
        for table in symbols.tables
        if table != box
    ]
    return held + on


def one_goal_objectives(symbols: Symbols) -> list[Objective]:
    """All objectives of one goal (15 in setup a)."""
    return [(goal,) for goal in all_goals(symbols)]


def two_goal_objectives(symbols: Symbols) -> list[Objective]:
    """All unordered pairs of goals that do not contradict each other (72 in setup a)."""
    return [pair for pair in combinations(all_goals(symbols), 2) if contradiction(pair) is None]


def contradiction(objective: Objective) -> str | None:
    """Why the goals cannot all hold, or None if nothing speaks against them."""
    place: dict[str, Goal] = {}
    for goal in objective:
        other = place.setdefault(goal.box, goal)
        if other != goal:
            return f"{other} and {goal} contradict each other: {goal.box} is in one place only"
    for goal in place.values():
        seen = [goal.box]
        step: Goal | None = goal
        while step is not None and step.kind == "on":
            if step.table in seen:
                return f"{goal} is part of a cycle: a box cannot stand on itself through others"
            assert step.table is not None
            seen.append(step.table)
            step = place.get(step.table)
    return None


def validate_objective(objective: Objective, symbols: Symbols, state: State) -> None:
    """Check an objective before any search.

    Raises:
        InputError: unknown symbol, contradictory goals, more boxes held than grippers, or nothing
            left to do.
    """
    if not objective:
        accepted = signatures(symbols.domain.goal_types)
        raise InputError("goal", "none given", f"one or more of {accepted}")
    for goal in objective:
        symbols.domain.check_goal(goal)
        if goal.box not in symbols.boxes:
            raise InputError(f"goal {goal}", f"unknown box {goal.box!r}", ", ".join(symbols.boxes))
        if goal.kind == "on" and goal.table not in symbols.tables:
            raise InputError(
                f"goal {goal}", f"unknown table {goal.table!r}", ", ".join(symbols.tables)
            )
    fault = contradiction(objective)
    if fault is not None:
        raise InputError("objective", fault)
    held = sum(goal.kind == "held" for goal in objective)
    if held > len(symbols.grippers):
        raise InputError(
            "objective",
            f"{held} boxes to hold",
            f"at most {len(symbols.grippers)}, one per gripper",
        )
    if satisfied(state, objective):
        raise InputError("objective", f"{format_objective(objective)} already holds in the scene")
