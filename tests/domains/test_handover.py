"""Hand-overs: which a state allows, and one planned, verified and carried out."""

import pytest

from guided_lgp.bounds.execution import execute
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.domains import domain_names, load_domain
from guided_lgp.errors import InputError
from guided_lgp.logic import (
    Action,
    State,
    applicable_actions,
    least_actions,
    parse_objective,
    parse_skeleton,
    progress,
    successor,
)
from guided_lgp.logic.strips import facts, goal_facts, relaxed_operators
from guided_lgp.params import load_params
from guided_lgp.paths import SOURCES
from guided_lgp.scene import generate
from guided_lgp.search.landmark_cut import LandmarkCut
from guided_lgp.search.tree import StateSpace, distances

HANDOVER = load_domain("handover")
SYMBOLS = HANDOVER.symbols(
    gripper=("pr2L", "pr2R"), box=("red", "green", "blue"), table=("tab1", "tab2")
)
START = HANDOVER.state({"red": "tab1", "green": "red", "blue": "tab2"})


def takes(state: State) -> list[str]:
    actions = applicable_actions(state, SYMBOLS)
    return [str(action) for action in actions if action.instruction == "take"]


def test_a_free_gripper_takes_a_clear_box_out_of_another() -> None:
    assert takes(START) == []
    loaded = progress(START, parse_skeleton("(grasp pr2L red)"))
    assert takes(loaded) == [], "green stands on red"
    held = progress(START, parse_skeleton("(grasp pr2L green)"))
    assert takes(held) == ["(take pr2R pr2L green)"]
    assert successor(held, Action("take", ("pr2R", "pr2L", "green"))).held == (("green", "pr2R"),)
    both = progress(held, parse_skeleton("(grasp pr2R blue)"))
    assert takes(both) == []


def test_what_follows_from_the_declaration() -> None:
    assert "handover" in domain_names()
    ground = HANDOVER.bind(Action("take", ("pr2R", "pr2L", "red")))
    assert (ground.actor, ground.body, ground.parent, ground.into_hand) == (
        "pr2R",
        "red",
        "pr2R",
        True,
    )
    with pytest.raises(InputError, match=r"\(take gripper giver box\)"):
        HANDOVER.bind(Action("take", ("pr2R", "red")))


@pytest.mark.parametrize("goals", [["(held green)"], ["(on red tab2)", "(on blue red)"]])
def test_lower_bounds(goals: list[str]) -> None:
    objective = parse_objective(goals)
    space = StateSpace(SYMBOLS, START)
    space.explore()
    landmark_cut = LandmarkCut(goal_facts(objective, SYMBOLS), relaxed_operators(SYMBOLS))
    for number, steps in distances(space, objective).items():
        state = space.state(number)
        assert landmark_cut(facts(state, SYMBOLS)) <= steps
        assert least_actions(state, objective, SYMBOLS) <= steps


def test_a_hand_over_is_planned_verified_and_carried_out() -> None:
    scene = generate("a", 1, 77, "handover").scenes[0].model_copy(update={"domain": "handover"})
    bounds = SceneBounds(scene, load_params(SOURCES / "params.yaml").bounds)
    skeleton = parse_skeleton("(grasp pr2L green) (take pr2R pr2L green) (place pr2R green blue)")
    plan = bounds.path(skeleton)
    assert plan.feasible, plan.failure
    assert plan.trajectory is not None
    objective = parse_objective(["(on green blue)"])
    report = execute(scene, objective, skeleton, plan.trajectory)
    assert report.success, report
