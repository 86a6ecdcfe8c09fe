"""What is derived from the declaration of pick-and-place against the same written by hand."""

import by_hand
import numpy as np
import pytest

from guided_lgp.errors import InputError
from guided_lgp.logic import (
    Goal,
    State,
    Symbols,
    applicable_actions,
    contradiction,
    least_actions,
    satisfied,
    successor,
    two_goal_objectives,
    validate_objective,
)
from guided_lgp.logic.objectives import all_goals
from guided_lgp.logic.strips import facts, goal_facts, relaxed_operators
from guided_lgp.scene import Scene, generate

SETUPS = ("a", "b", "c", "d", "e6", "e10")


def scene_of(setup: str) -> Scene:
    return generate(setup, 1, 20, "by-hand").scenes[0]


def walks(scene: Scene, symbols: Symbols, count: int, length: int) -> list[State]:
    """The states of random walks from the start."""
    rng = np.random.default_rng(len(symbols.boxes))
    states = []
    for _ in range(count):
        state = scene.state
        for _ in range(length):
            states.append(state)
            actions = list(applicable_actions(state, symbols))
            state = successor(state, actions[rng.integers(len(actions))])
    return states


@pytest.mark.parametrize("reduced", [False, True])
@pytest.mark.parametrize("setup", SETUPS)
def test_children_and_their_states(setup: str, reduced: bool) -> None:
    scene = scene_of(setup)
    symbols = scene.symbols.restricted(table=("tray", "tab2")) if reduced else scene.symbols
    for state in walks(scene, symbols, 20, 15):
        actions = list(applicable_actions(state, symbols))
        assert actions == list(by_hand.applicable_actions(state, symbols))
        assert facts(state, symbols) == by_hand.facts(state, symbols)
        for action in actions:
            after = successor(state, action)
            assert (dict(after.support), dict(after.held)) == by_hand.successor(state, action)


@pytest.mark.parametrize("setup", SETUPS)
def test_goals_bounds_and_error_lines(setup: str) -> None:
    scene = scene_of(setup)
    symbols, rng = scene.symbols, np.random.default_rng(3)
    goals = all_goals(symbols)
    assert goals == by_hand.all_goals(symbols)
    wrong = [
        Goal("on", ("red", "red")),
        Goal("held", ("tab1",)),
        Goal("on", ("red", "pr2L")),
        Goal("on", ("shelf", "red")),
    ]
    for state in walks(scene, symbols, 12, 10):
        for size in (1, 1, 2, 2, 3, 3, 4):
            drawn = rng.choice(len(goals), size, replace=False)
            objective = tuple(goals[index] for index in drawn)
            assert satisfied(state, objective) == all(
                by_hand.satisfies(state, goal) for goal in objective
            )
            line = by_hand.error_line(objective, symbols, state)
            assert contradiction(objective, symbols) == by_hand.contradiction(objective)
            assert refusal(objective, symbols, state) == line
            if line is None:
                bound = least_actions(state, objective, symbols)
                assert bound == by_hand.least_actions(state, objective)
            spoilt = (*objective, wrong[rng.integers(len(wrong))])
            assert refusal(spoilt, symbols, state) == by_hand.error_line(spoilt, symbols, state)


def refusal(objective: tuple[Goal, ...], symbols: Symbols, state: State) -> str | None:
    try:
        validate_objective(objective, symbols, state)
    except InputError as error:
        return str(error)
    return None


@pytest.mark.parametrize("setup", SETUPS)
def test_relaxation_and_pairs_of_goals(setup: str) -> None:
    symbols = scene_of(setup).symbols
    derived = [(o.action, o.preconditions, o.additions) for o in relaxed_operators(symbols)]
    assert derived == list(by_hand.relaxed_operators(symbols))
    assert two_goal_objectives(symbols) == by_hand.two_goal_objectives(symbols)
    for goal in all_goals(symbols):
        assert goal_facts((goal,), symbols) == {(goal.kind, *goal.symbols)}
