"""Symbols, actions, goals, states and objectives. Pure Python, no numerics."""

from guided_lgp.logic.actions import Action, Goal, Skeleton, format_skeleton, parse_skeleton
from guided_lgp.logic.domain import Domain, GroundInstruction, GroundTerm
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
from guided_lgp.logic.progression import applicable_actions, are_applicable, progress, successor
from guided_lgp.logic.state import GroundAtom, State
from guided_lgp.logic.symbols import Symbols

__all__ = [
    "Action",
    "Domain",
    "Goal",
    "GroundAtom",
    "GroundInstruction",
    "GroundTerm",
    "Objective",
    "Skeleton",
    "State",
    "Symbols",
    "applicable_actions",
    "are_applicable",
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
