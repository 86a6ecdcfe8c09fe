"""Counts of objectives and the answers to bad ones."""

import pytest

from guided_lgp.domains import load_domain
from guided_lgp.errors import InputError
from guided_lgp.logic import (
    one_goal_objectives,
    parse_objective,
    two_goal_objectives,
    unsatisfied,
    validate_objective,
)

SETUP_A = load_domain().symbols(
    gripper=("pr2L", "pr2R"), box=("red", "green", "blue"), table=("tab1", "tab2")
)
START = load_domain().state({"red": "tab1", "green": "tab1", "blue": "tab2"})


def test_objectives_of_setup_a() -> None:
    one, two = one_goal_objectives(SETUP_A), two_goal_objectives(SETUP_A)
    assert len(one) == 15
    assert len(two) == 72
    assert sum(goal.kind == "held" for (goal,) in one) == 3
    assert len({frozenset(pair) for pair in two}) == 72


@pytest.mark.parametrize(
    ("goals", "fault"),
    [
        ([], "none given"),
        (["(on pink red)"], "unknown box 'pink'"),
        (["(on red shelf)"], "unknown table 'shelf'"),
        (["(on red tab1)", "(on red tab2)"], "one place only"),
        (["(held red)", "(on red tab2)"], "one place only"),
        (["(on red green)", "(on green red)"], "cycle"),
        (["(on red green)", "(on green blue)", "(on blue red)"], "cycle"),
        (["(on red red)"], "cycle"),
        (["(held red)", "(held green)", "(held blue)"], "3 boxes to hold"),
        (["(on red tab1)", "(on blue tab2)"], "already holds"),
    ],
)
def test_bad_objectives_are_refused(goals: list[str], fault: str) -> None:
    with pytest.raises(InputError, match=fault):
        validate_objective(parse_objective(goals), SETUP_A, START)


def test_adaptation_keeps_what_is_left() -> None:
    objective = parse_objective(["(on red tab1)", "(held blue)"])
    assert [str(goal) for goal in unsatisfied(START, objective)] == ["(held blue)"]
