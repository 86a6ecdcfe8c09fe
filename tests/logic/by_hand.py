"""Pick-and-place written by hand, as an oracle for what is derived from its declaration."""

from collections.abc import Iterator
from itertools import combinations

from guided_lgp.logic import Action, Goal, Objective, State, Symbols


def applicable_actions(state: State, symbols: Symbols) -> Iterator[Action]:
    """Grippers, then boxes or tables as declared."""
    for gripper in symbols.grippers:
        box = state.held_by(gripper)
        if box is None:
            for candidate in symbols.boxes:
                if state.holder(candidate) is None:
                    yield Action("grasp", (gripper, candidate))
        else:
            barred = {box, *state.carried_by(box)}
            for table in symbols.tables:
                if table not in barred:
                    yield Action("place", (gripper, box, table))


def successor(state: State, action: Action) -> tuple[dict[str, str], dict[str, str]]:
    """What stands where, and what holds what, after an action."""
    support, held = dict(state.support), dict(state.held)
    match action.instruction, action.symbols:
        case "grasp", (gripper, box):
            del support[box]
            held[box] = gripper
        case "place", (_, box, table):
            del held[box]
            support[box] = table
    return support, held


def satisfies(state: State, goal: Goal) -> bool:
    match goal.kind, goal.symbols:
        case "held", (box,):
            return state.holder(box) is not None
        case "on", (box, table):
            return state.support_of(box) == table
    raise AssertionError(goal)


def least_actions(state: State, objective: Objective) -> int:
    return sum(
        1 if goal.kind == "held" or state.holder(goal.symbols[0]) is not None else 2
        for goal in objective
        if not satisfies(state, goal)
    )


Facts = frozenset[tuple[str, ...]]


def relaxed_operators(symbols: Symbols) -> Iterator[tuple[Action, Facts, Facts]]:
    """Actions with the facts that they need and that they add."""
    for gripper in symbols.grippers:
        free = ("free", gripper)
        for box in symbols.boxes:
            standing, held, holds = ("standing", box), ("held", box), ("holds", gripper, box)
            grasp = Action("grasp", (gripper, box))
            yield grasp, frozenset({free, standing}), frozenset({holds, held})
            for table in symbols.tables:
                if table != box:
                    place = Action("place", (gripper, box, table))
                    added = frozenset({("on", box, table), standing, free})
                    yield place, frozenset({holds}), added


def facts(state: State, symbols: Symbols) -> Facts:
    busy = {gripper for _, gripper in state.held}
    return frozenset(
        [("free", gripper) for gripper in symbols.grippers if gripper not in busy]
        + [("standing", box) for box, _ in state.support]
        + [("on", box, table) for box, table in state.support]
        + [("held", box) for box, _ in state.held]
        + [("holds", gripper, box) for box, gripper in state.held]
    )


def all_goals(symbols: Symbols) -> list[Goal]:
    """Held for each box, then on for each box and other table."""
    held = [Goal("held", (box,)) for box in symbols.boxes]
    on = [
        Goal("on", (box, table))
        for box in symbols.boxes
        for table in symbols.tables
        if table != box
    ]
    return held + on


def contradiction(objective: Objective) -> str | None:
    """Why the goals cannot all hold, or None if nothing speaks against them."""
    place: dict[str, Goal] = {}
    for goal in objective:
        box = goal.symbols[0]
        other = place.setdefault(box, goal)
        if other != goal:
            return f"{other} and {goal} contradict each other: {box} is in one place only"
    for goal in place.values():
        seen = [goal.symbols[0]]
        step: Goal | None = goal
        while step is not None and step.kind == "on":
            if step.symbols[1] in seen:
                return f"{goal} is part of a cycle: a box cannot stand on itself through others"
            seen.append(step.symbols[1])
            step = place.get(step.symbols[1])
    return None


def two_goal_objectives(symbols: Symbols) -> list[Objective]:
    return [pair for pair in combinations(all_goals(symbols), 2) if contradiction(pair) is None]


def error_line(objective: Objective, symbols: Symbols, state: State) -> str | None:
    """The line that refuses an objective of known goal types, if one does."""
    if not objective:
        return "goal: none given (accepted: one or more of (held box), (on box table))"
    for goal in objective:
        for kind, known, name in zip(
            ("box", "table"), (symbols.boxes, symbols.tables), goal.symbols, strict=False
        ):
            if name not in known:
                return f"goal {goal}: unknown {kind} {name!r} (accepted: {', '.join(known)})"
    fault = contradiction(objective)
    if fault is not None:
        return f"objective: {fault}"
    held, hands = sum(goal.kind == "held" for goal in objective), len(symbols.grippers)
    if held > hands:
        return f"objective: {held} boxes to hold (accepted: at most {hands}, one per gripper)"
    if all(satisfies(state, goal) for goal in objective):
        return f"objective: {' '.join(map(str, objective))} already holds in the scene"
    return None
