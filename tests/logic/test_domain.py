"""Level sizes of the logic tree and the permissive rules."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from guided_lgp.domains import load_domain
from guided_lgp.errors import InputError
from guided_lgp.logic import (
    Action,
    Goal,
    applicable_actions,
    format_skeleton,
    parse_skeleton,
    progress,
    successor,
)

SETUP_A = load_domain().symbols(
    gripper=("pr2L", "pr2R"), box=("red", "green", "blue"), table=("tab1", "tab2")
)
ON_TAB1 = load_domain().state({"red": "tab1", "green": "tab1", "blue": "tab1"})


def test_order_of_children() -> None:
    state = progress(ON_TAB1, parse_skeleton("(grasp pr2R green)"))
    assert [str(action) for action in applicable_actions(state, SETUP_A)] == [
        "(grasp pr2L red)",
        "(grasp pr2L blue)",
        "(place pr2R green tab1)",
        "(place pr2R green tab2)",
        "(place pr2R green red)",
        "(place pr2R green blue)",
    ]


def test_what_stands_on_a_box_moves_with_it() -> None:
    skeleton = parse_skeleton(
        "(grasp pr2L red) (place pr2L red green) (grasp pr2R green) (place pr2R green tab2)"
    )
    state = progress(ON_TAB1, skeleton)
    assert state == load_domain().state({"red": "green", "green": "tab2", "blue": "tab1"})


def test_no_place_on_what_stands_on_the_box() -> None:
    tower = load_domain().state({"red": "tab1", "green": "red", "blue": "green"})
    state = progress(tower, parse_skeleton("(grasp pr2L red)"))
    places = [a.symbols[2] for a in applicable_actions(state, SETUP_A) if a.instruction == "place"]
    assert places == ["tab1", "tab2"]


def test_place_on_a_held_box_and_grasp_under_a_load_are_legal() -> None:
    state = progress(ON_TAB1, parse_skeleton("(grasp pr2L red) (grasp pr2R green)"))
    assert Action("place", ("pr2R", "green", "red")) in list(applicable_actions(state, SETUP_A))
    tower = load_domain().state({"red": "tab1", "green": "red", "blue": "tab1"})
    assert Action("grasp", ("pr2L", "red")) in list(applicable_actions(tower, SETUP_A))


def test_goal_on_does_not_hold_while_the_box_is_held() -> None:
    held = progress(ON_TAB1, parse_skeleton("(grasp pr2L red)"))
    assert held.satisfies(Goal("held", ("red",)))
    assert not held.satisfies(Goal("on", ("red", "tab1")))


def test_skeletons_survive_writing_and_reading() -> None:
    text = "(grasp pr2L red) (place pr2L red tab2)"
    assert format_skeleton(parse_skeleton(text)) == text


@pytest.mark.parametrize("text", ["(grasp pr2L)", "(push pr2L red)", "(place pr2L red)", "grasp"])
def test_bad_actions_are_named(text: str) -> None:
    with pytest.raises(InputError, match="is not an action"):
        load_domain().instruction(Action.parse(text))


@given(st.lists(st.integers(min_value=0), max_size=30))
def test_invariants_along_random_sequences(choices: list[int]) -> None:
    """Every box is held or stands, a gripper holds one box, and no box carries itself."""
    state = ON_TAB1
    for choice in choices:
        actions = list(applicable_actions(state, SETUP_A))
        assert len(set(actions)) == len(actions) > 0
        state = successor(state, actions[choice % len(actions)])
        standing, held = dict(state.support), dict(state.held)
        assert sorted([*standing, *held]) == sorted(SETUP_A.boxes)
        assert len(set(held.values())) == len(held)
        for box in SETUP_A.boxes:
            assert box not in state.carried_by(box)
        assert load_domain().state(standing, held) == state


@pytest.mark.parametrize(
    "text", ["grasp pr2L red", "(grasp pr2L red", "(grasp pr2L red) and", "(grasp pr2L red))", "()"]
)
def test_nothing_in_a_skeleton_is_ignored(text: str) -> None:
    with pytest.raises(InputError, match="is not an action"):
        parse_skeleton(text)
