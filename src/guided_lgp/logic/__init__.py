"""Symbols, actions, goals, states and objectives. Pure Python, no numerics."""

from guided_lgp.logic.domain import (
    Action,
    Goal,
    Skeleton,
    State,
    applicable_actions,
    format_skeleton,
    parse_skeleton,
    progress,
    successor,
)
from guided_lgp.logic.objectives import (
    Objective,
    contradiction,
    format_objective,
    least_actions,
    one_goal_objectives,
    parse_objective,
    satisfied,
    two_goal_objectives,
    unsatisfied,
    validate_objective,
)
from guided_lgp.logic.symbols import Symbols

__all__ = [
    "Action",
    "Goal",
    "Objective",
    "Skeleton",
    "State",
    "Symbols",
    "applicable_actions",
    "contradiction",
    "format_objective",
    "format_skeleton",
    "least_actions",
    "one_goal_objectives",
    "parse_objective",
    "parse_skeleton",
    "progress",
    "satisfied",
    "successor",
    "two_goal_objectives",
    "unsatisfied",
    "validate_objective",
]
