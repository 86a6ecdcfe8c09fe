"""Each fault of a hand-written scene gets one clear line."""

from typing import Any

import pytest

from guided_lgp.errors import InputError
from guided_lgp.scene import Scene, generate, parse_scene
from guided_lgp.scene.setups import SETUPS
from guided_lgp.scene.validate import validate_scene


def document(**changes: Any) -> dict[str, Any]:
    scene: dict[str, Any] = {
        "name": "mine",
        "robot": {"model": "pr2", "base": [0, 0, 0], "torso": 0.28},
        "tables": [
            {"name": "tab1", "position": [0.54, 0.33, 0.60], "half_extents": [0.17, 0.20]},
            {"name": "tab2", "position": [0.54, -0.33, 0.60], "half_extents": [0.17, 0.20]},
        ],
        "boxes": [
            {"name": "red", "size": [0.15, 0.07, 0.10], "position": [0.5, 0.3, 0.65], "on": "tab1"},
            {
                "name": "green",
                "size": [0.15, 0.07, 0.1],
                "position": [0.5, 0.45, 0.65],
                "on": "tab1",
            },
        ],
    }
    for path, value in changes.items():
        target: Any = scene
        *keys, last = (int(key) if key.isdigit() else key for key in path.split("__"))
        for key in keys:
            target = target[key]
        target[last] = value
    return scene


def scene(**changes: Any) -> Scene:
    return parse_scene(document(**changes), "mine.json")


def test_good_scene() -> None:
    validate_scene(scene(), "mine.json")


def test_tower_is_a_good_scene() -> None:
    validate_scene(scene(boxes__1__on="red", boxes__1__position=[0.5, 0.3, 0.75]), "mine.json")


@pytest.mark.parametrize("setup", SETUPS)
def test_generated_scenes_are_good(setup: str) -> None:
    for generated in generate(setup, 2, seed=11, prefix="x").scenes:
        validate_scene(generated)


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"boxes__1__position": [0.5, 0.33, 0.65]}, "green and red overlap by 0.040 m"),
        (
            {"boxes__0__position": [0.5, 0.3, 0.68]},
            r"boxes\.0 \(red\)\.position: .* floats 0.030 m",
        ),
        ({"boxes__0__position": [0.5, 0.3, 0.62]}, r"boxes\.0 \(red\)\.position: .* sunk 0.030 m"),
        ({"boxes__0__position": [0.5, 0.1, 0.65]}, "red is 0.030 m beside tab1"),
        ({"boxes__0__on": "tab2"}, "red is 0.430 m beside tab2"),
        ({"boxes__0__size": [4.5, 4.5, 4.5]}, r"sunk 2.200 m into tab1 .*; is its size in m\?"),
        ({"boxes__0__on": "green", "boxes__1__on": "red"}, "in a circle"),
        ({"robot__torso": 0.32}, r"robot\.torso: 0.32 m is out of range"),
        ({"tables__1__position": [0.54, 0.1, 0.6]}, "tab1 and tab2 overlap"),
        ({"tables__1__position": [0.0, -0.2, 0.6]}, "tab2 is .* inside the robot"),
    ],
)
def test_fault_is_named(changes: dict[str, Any], fault: str) -> None:
    with pytest.raises(InputError, match=fault) as error:
        validate_scene(scene(**changes), "mine.json")
    assert str(error.value).startswith("mine.json: ")
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"boxes__0__position": [True, 0.3, 0.65]}, r"boxes\.0\.position\.0: .* is not a number"),
        ({"boxes__0__yaw": "0.4"}, r"boxes\.0\.yaw: .* is not a number"),
        ({"robot__torso": True}, r"robot\.torso: .* is not a number"),
        ({"tables__1__half_extents": [1e-200, 0.2]}, r"tables\.1\.half_extents\.0: .*0.001"),
        ({"boxes__0__size": [0.15, 0.07, 1e-9]}, r"boxes\.0\.size\.2: .*0.001"),
        ({"boxes__0__size": [150, 70, 100]}, r"boxes\.0\.size\.0: 150 is too large: .* in m;"),
        ({"boxes__0__yaw": 90}, r"boxes\.0\.yaw: 90 is too large: .* in rad; .* degrees"),
        ({"boxes__0__yw": 0.4}, r"boxes\.0: unknown field 'yw' .did you mean 'yaw'\?"),
        ({"robot__tors": 0.4}, r"robot: unknown field 'tors' .did you mean 'torso'\?"),
        ({"boxes__0__name": "red box"}, r"boxes\.0\.name: the name 'red box' has other"),
        ({"boxes__0__name": "l_gripper_palm_link"}, "is that of a part of the robot"),
        ({"boxes__0__on": "pr2"}, r"'red' stands on unknown table 'pr2' \(.*tab1"),
    ],
)
def test_a_number_that_is_none_or_too_small_is_refused(changes: dict[str, Any], fault: str) -> None:
    with pytest.raises(InputError, match=fault):
        scene(**changes)


def test_the_domain_is_written_unless_it_is_that_of_the_paper() -> None:
    assert "domain" not in scene().model_dump(mode="json")
    assert scene(domain="pick_and_place") == scene()
    with pytest.raises(InputError, match=r"unknown domain 'chess' \(.*pick_and_place"):
        scene(domain="chess")


def test_what_no_goal_needs_may_be_of_any_size_and_anywhere() -> None:
    """Too wide for the fingers, too flat, out of reach, or nearer to an edge than plans put it."""
    validate_scene(scene(boxes__0__size=[0.15, 0.12, 0.10]))
    validate_scene(scene(boxes__0__size=[0.15, 0.07, 0.001], boxes__0__position=[0.5, 0.3, 0.6005]))
    validate_scene(scene(tables__1__position=[1.8, -0.33, 0.6]))
    validate_scene(scene(boxes__0__position=[0.5, 0.131, 0.65]))


def test_a_robot_may_stand_on_a_table() -> None:
    table = {"name": "table", "position": [0.3, 0.0, 0.0], "half_extents": [0.6, 0.6]}
    box = {"name": "red", "size": [0.05, 0.05, 0.1], "position": [0.5, 0, 0.05], "on": "table"}
    on_it = {"robot": {"model": "panda"}, "tables": [table], "boxes": [box]}
    validate_scene(parse_scene(on_it, "mine.json"))
    table["position"], box["position"] = [0.3, 0.0, 0.01], [0.5, 0, 0.06]
    with pytest.raises(InputError, match=r"table is 0\.011 m inside the robot"):
        validate_scene(parse_scene(on_it, "mine.json"))


def test_names_are_those_that_goals_can_carry() -> None:
    for name in ("003_cracker_box", "mug.001", "063-a_marbles", "_x"):
        assert scene(boxes__0__name=name).symbols.boxes[0] == name


def test_integers_are_coordinates() -> None:
    assert scene(robot__base=[0, 0, 0]).robot.base == (0.0, 0.0, 0.0)
