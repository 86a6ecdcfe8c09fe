"""Goals that users may ask for beside those of the paper: read, checked, and estimated."""

import pytest

from guided_lgp.domains import load_domain
from guided_lgp.errors import InputError
from guided_lgp.logic import (
    Goal,
    least_actions,
    one_goal_objectives,
    parse_objective,
    satisfied,
    validate_objective,
)
from guided_lgp.logic.objectives import asks_for_places, encodable
from guided_lgp.logic.packed import packed_states
from guided_lgp.logic.pddl import problem_text
from guided_lgp.logic.strips import facts, goal_facts, relaxed_operators
from guided_lgp.search.landmark_cut import LandmarkCut
from guided_lgp.search.tree import StateSpace, distances

DOMAIN = load_domain()
SYMBOLS = DOMAIN.symbols(gripper=("pr2L", "pr2R"), box=("red", "green"), table=("tab1", "tab2"))
START = DOMAIN.state({"red": "tab1", "green": "tab1"})
HOLDING = DOMAIN.state({"green": "tab1"}, {"red": "pr2L"})


@pytest.mark.parametrize(
    ("goal", "at_start", "holding"),
    [
        ("(heldby red pr2L)", False, True),
        ("(heldby red pr2R)", False, False),
        ("(empty pr2L)", True, False),
        ("(empty pr2R)", True, True),
        ("(handempty)", True, False),
        ("(in red tab1 0 0 0.1 0.1)", True, False),
        ("(at red tab1 0.5 0.3 0.65 0)", True, False),
        ("(upright red)", True, True),
    ],
)
def test_what_symbols_tell_of_a_goal(goal: str, at_start: bool, holding: bool) -> None:
    objective = parse_objective([goal])
    assert (satisfied(START, objective), satisfied(HOLDING, objective)) == (at_start, holding)
    for state in (START, HOLDING):
        packed = packed_states(SYMBOLS)
        assert packed.goal_test(objective)(packed.pack(state)) == satisfied(state, objective)
        assert "(:goal" in problem_text(state, objective, SYMBOLS)


def test_they_are_none_of_the_objectives_that_are_drawn() -> None:
    kinds = {goal.kind for (goal,) in one_goal_objectives(SYMBOLS)}
    assert kinds == {"held", "on"}


@pytest.mark.parametrize(
    ("goals", "fault"),
    [
        (["(heldby red)"], "is not a goal"),
        (["(heldby red tab1)"], "unknown gripper 'tab1'"),
        (["(empty red)"], "unknown gripper 'red'"),
        (["(handempty red)"], "is not a goal"),
        (["(heldby red pr2L)", "(heldby green pr2L)"], "two things"),
        (["(heldby red pr2L)", "(empty pr2L)"], "two things"),
        (["(held red)", "(handempty)"], "1 box to hold"),
        (["(held red)", "(in red tab1 0 0 1 1)"], "one place only"),
        (["(at red tab1 0.5 0.3 0.65)"], "is not a goal"),
        (["(at red tab1 0.5 0.3 0.65 0 0.1 0.1 0.1)"], "is not a goal"),
        (["(empty pr2L)"], "already holds"),
        (["(upright red)"], "already holds"),
    ],
)
def test_bad_ones_are_refused(goals: list[str], fault: str) -> None:
    with pytest.raises(InputError, match=fault):
        validate_objective(parse_objective(goals), SYMBOLS, START)


def test_places_are_not_told_by_symbols() -> None:
    objective = parse_objective(["(in red tab1 0 0 0.1 0.1)"])
    validate_objective(objective, SYMBOLS, START)  # although red is on tab1 already
    assert asks_for_places(objective, SYMBOLS)
    assert not asks_for_places(parse_objective(["(upright red)", "(on red tab2)"]), SYMBOLS)


def test_numbers() -> None:
    (term,) = DOMAIN.final_terms(Goal.parse("(at red tab1 0.5 0.3 0.65 1)"))
    assert (term.name, term.symbols) == ("at", ("red", "tab1"))
    pose = {"x": 0.5, "y": 0.3, "z": 0.65, "yaw": 1.0}
    assert term.options == {**pose, "tolerance": 0.01, "turn": 0.05}
    for word in ("east", "nan", "inf"):
        with pytest.raises(InputError, match=f"y is '{word}'"):
            DOMAIN.final_terms(Goal.parse(f"(at red tab1 0.5 {word} 0.65 1)"))


def test_policies_see_what_goals_imply() -> None:
    objective = parse_objective(
        ["(on red green)", "(heldby green pr2L)", "(handempty)", "(in red tab1 0 0 1 1)"]
    )
    known = parse_objective(["(on red green)", "(held green)", "(on red tab1)"])
    assert encodable(objective, SYMBOLS) == known
    drawn = parse_objective(["(held red)", "(on green tab2)"])
    assert encodable(drawn, SYMBOLS) == drawn


@pytest.mark.parametrize("goals", [["(heldby red pr2R)"], ["(handempty)"], ["(empty pr2L)"]])
def test_lower_bounds(goals: list[str]) -> None:
    objective = parse_objective(goals)
    space = StateSpace(SYMBOLS, HOLDING)
    space.explore()
    landmark_cut = LandmarkCut(goal_facts(objective, SYMBOLS), relaxed_operators(SYMBOLS))
    for number, steps in distances(space, objective).items():
        state = space.state(number)
        assert least_actions(state, objective, SYMBOLS) <= steps
        assert landmark_cut(facts(state, SYMBOLS)) <= steps


def test_a_hand_that_shall_be_empty_takes_an_action() -> None:
    both = DOMAIN.state({}, {"red": "pr2L", "green": "pr2R"})
    assert least_actions(both, parse_objective(["(handempty)"]), SYMBOLS) == 2


def test_a_posture_is_no_place() -> None:
    objective = parse_objective(["(posture pr2L 0 0.5 -1)"])
    assert satisfied(START, objective)
    assert not asks_for_places(objective, SYMBOLS)
    assert encodable(objective, SYMBOLS) == ()
    (term,) = DOMAIN.posture_terms(objective[0])
    assert (term.symbols, term.options) == (("pr2L",), {"joint1": 0, "joint2": 0.5, "joint3": -1})
