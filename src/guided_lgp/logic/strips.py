"""The domain in STRIPS, as classical planners want it, without delete effects."""

from dataclasses import dataclass

from guided_lgp.logic.actions import Action, Goal
from guided_lgp.logic.objectives import Objective
from guided_lgp.logic.state import State
from guided_lgp.logic.symbols import Symbols

Fact = tuple[str, ...]


@dataclass(frozen=True)
class RelaxedOperator:
    """An action by the facts that it needs and the facts that it adds."""

    action: Action
    preconditions: frozenset[Fact]
    additions: frozenset[Fact]


def relaxed_operators(symbols: Symbols) -> list[RelaxedOperator]:
    """Delete relaxation of all actions.

    The condition of `place` on what the table stands on is left out, too: it is not a STRIPS
    fact. Both only ever make plans shorter, so heuristics that are admissible for this
    relaxation are admissible for the domain.
    """
    operators = []
    for gripper in symbols.grippers:
        free = ("free", gripper)
        for box in symbols.boxes:
            standing, held = ("standing", box), ("held", box)
            holds = ("holds", gripper, box)
            operators.append(
                RelaxedOperator(
                    Action("grasp", (gripper, box)),
                    frozenset({free, standing}),
                    frozenset({holds, held}),
                )
            )
            operators.extend(
                RelaxedOperator(
                    Action("place", (gripper, box, table)),
                    frozenset({holds}),
                    frozenset({("on", box, table), standing, free}),
                )
                for table in symbols.tables
                if table != box
            )
    return operators


def facts(state: State, symbols: Symbols) -> frozenset[Fact]:
    """What holds in a state."""
    busy = {gripper for _, gripper in state.held}
    return frozenset(
        [("free", gripper) for gripper in symbols.grippers if gripper not in busy]
        + [("standing", box) for box, _ in state.support]
        + [("on", box, table) for box, table in state.support]
        + [("held", box) for box, _ in state.held]
        + [("holds", gripper, box) for box, gripper in state.held]
    )


def goal_facts(objective: Objective) -> frozenset[Fact]:
    """The facts that an objective asks for."""
    return frozenset(_fact(goal) for goal in objective)


def _fact(goal: Goal) -> Fact:
    return ("held", goal.box) if goal.table is None else ("on", goal.box, goal.table)
