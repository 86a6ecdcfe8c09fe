"""Goals read against a scene: the support of a pose, numbers, and what stands in the way."""

from pathlib import Path

import pytest

from guided_lgp.errors import InputError
from guided_lgp.logic import parse_objective
from guided_lgp.scene import load_scene
from guided_lgp.scene.contradictions import check_places
from guided_lgp.scene.goals import complete_objective, in_the_way

SCENE = load_scene(Path(__file__).parents[2] / "examples" / "three_boxes.json")


def completed(goal: str) -> str:
    (found,) = complete_objective(parse_objective([goal]), SCENE)
    return str(found)


def test_the_support_of_a_pose_is_found() -> None:
    assert completed("(at red 0.5 -0.3 0.65 0)") == "(at red tab2 0.5 -0.3 0.65 0)"
    assert completed("(at red 0.5 0.3 0.651 0)") == "(at red tab1 0.5 0.3 0.651 0)"
    # on top of green
    assert completed("(at red 0.5 -0.25 0.75 0)") == "(at red green 0.5 -0.25 0.75 0)"


@pytest.mark.parametrize("goal", ["(on red green)", "(at red tab2 0.5 -0.3 0.65 0 0.02)"])
def test_what_is_whole_stays_as_it_is(goal: str) -> None:
    assert completed(goal) == goal


@pytest.mark.parametrize(
    ("goal", "fault"),
    [
        ("(at red 0.5 -0.3 0.8 0)", r"nothing is there for red to stand on \(accepted: z = 0.650"),
        ("(at red 2 2 0.65 0)", "nothing is there"),
        ("(at pink 0.5 -0.3 0.65 0)", "unknown box"),
        ("(at red tab2 0.5 -0.3 1e9 0)", "z is 1000000000.0"),
        ("(at red 500 -300 650 0)", "x is 500.0: lengths are in m; is this in mm or cm"),
        ("(at red 0.5 -0.3 0.65 90)", "yaw is 90.0: angles are in rad; are these degrees"),
        ("(in red tab2 -170 -100 0 100)", "x0 is -170.0 .accepted: up to 100 m or rad"),
        ("(at red tab2 0.5 -0.3 0.65 0 -0.01)", "tolerance is -0.01"),
        ("(in red tab2 0.1 0 0.1 1)", "the region is empty"),
    ],
)
def test_bad_numbers_are_told(goal: str, fault: str) -> None:
    with pytest.raises(InputError, match=fault):
        completed(goal)


def test_what_stands_where_a_box_is_wanted() -> None:
    near_green = parse_objective(["(at red tab2 0.5 -0.33 0.65 0)"])
    assert in_the_way("red", near_green, SCENE) == {"green"}
    on_green = parse_objective(["(at red green 0.5 -0.25 0.75 0)"])
    assert in_the_way("red", on_green, SCENE) == frozenset()
    assert in_the_way("red", parse_objective(["(in red tab2 -0.1 -0.1 0.1 0.1)"]), SCENE) == set()


@pytest.mark.parametrize(
    ("region", "expected"),
    [
        ("-0.1 0.02 0.06 0.14", {"green"}),  # around green
        ("-0.1 -0.1 0.06 0.14", set()),  # and room beside it
    ],
)
def test_what_fills_a_region(region: str, expected: set[str]) -> None:
    assert in_the_way("red", parse_objective([f"(in red tab2 {region})"]), SCENE) == expected


@pytest.mark.parametrize(
    ("goals", "fault"),
    [
        ("(at red 0.5 -0.3 0.65 0) (at red 0.6 -0.3 0.65 0)", "red is in one place only"),
        ("(at red 0.5 -0.3 0.65 0) (at red 0.5 -0.3 0.65 1)", "red is in one place only"),
        ("(at red 0.5 -0.3 0.65 0) (at blue 0.52 -0.3 0.65 1)", "red and blue would be in each"),
        ("(in red tab2 0 0 0.16 0.16) (in red tab2 -0.16 -0.16 0 0)", "red is in one place only"),
        ("(at red 0.5 -0.3 0.65 0) (in red tab2 0.1 0.1 0.3 0.3)", "red is in one place only"),
        ("(in red tab2 0 0 0.05 0.3)", r"no room for red \(accepted: 0.070 m or more"),
        ("(in red tab2 0 0 0.1 0.1)", r"no room for red \(accepted: room for 0.150 by 0.070 m"),
        ("(in red tab2 0.4 0 0.6 0.2)", "the region is beside tab2"),
    ],
)
def test_places_that_contradict_each_other_are_told(goals: str, fault: str) -> None:
    objective = parse_objective(f"{goal})" for goal in goals.split(")")[:-1])
    with pytest.raises(InputError, match=fault):
        check_places(complete_objective(objective, SCENE), SCENE)


@pytest.mark.parametrize(
    "goals",
    [
        ["(at red 0.5 -0.3 0.65 0)", "(at red 0.505 -0.3 0.65 0.05)"],
        ["(at red 0.5 -0.3 0.65 0)", "(at blue 0.5 -0.38 0.65 0)"],
        ["(at red 0.5 -0.25 0.75 0)", "(at green 0.5 -0.25 0.65 0)"],
        ["(at red 0.5 -0.3 0.65 0)", "(in red tab2 -0.2 -0.2 0.2 0.2)"],
        ["(in red tab2 0 0 0.1 0.2)", "(in red tab2 -0.1 -0.1 0.08 0.2)"],
        # on a box that moves, a region moves too, but the pose is in the world
        ["(at red 0.5 -0.25 0.75 0)", "(in red green -0.2 -0.2 0.2 0.2)"],
    ],
)
def test_places_that_can_hold_together_are_not_refused(goals: list[str]) -> None:
    check_places(complete_objective(parse_objective(goals), SCENE), SCENE)
