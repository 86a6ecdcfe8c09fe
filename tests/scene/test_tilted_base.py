"""A robot that is mounted otherwise than level: hanging from a ceiling, on a wall, on a slope."""

from typing import Any

import casadi as ca
import numpy as np
import pytest

from guided_lgp.bounds.execution import execute
from guided_lgp.bounds.program.geometry import SceneGeometry
from guided_lgp.bounds.program.kinematics import kinematics_of
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.errors import InputError
from guided_lgp.logic import parse_objective, parse_skeleton
from guided_lgp.params import load_params
from guided_lgp.paths import SOURCES
from guided_lgp.scene import Scene, parse_scene
from guided_lgp.scene.validate import validate_scene
from guided_lgp.scene.world import World

BOXES = [
    {"name": "red", "size": [0.12, 0.05, 0.08], "position": [0.5, 0.25, 0.44], "on": "tab1"},
    {"name": "green", "size": [0.12, 0.05, 0.08], "position": [0.5, -0.25, 0.44], "on": "tab2"},
]
TABLES = [
    {"name": "tab1", "position": [0.5, 0.25, 0.4], "half_extents": [0.17, 0.2]},
    {"name": "tab2", "position": [0.5, -0.25, 0.4], "half_extents": [0.17, 0.2]},
]
CEILING = {"base": [0.1, 0, 0.2], "height": 1.25, "tilt": [np.pi, 0.0]}
WALL = {"base": [-0.1, 0, 0], "height": 0.9, "tilt": [0.0, np.pi / 2]}
SLOPE = {"base": [0, 0, 0], "height": 0.4, "tilt": [0.2, 0.3]}
MOUNTINGS = {"ceiling": CEILING, "wall": WALL, "slope": SLOPE}


def mounted(**robot: Any) -> Scene:
    """Two boxes before a Panda."""
    document = {"robot": {"model": "panda"} | robot, "tables": TABLES, "boxes": BOXES}
    return parse_scene(document, "mounted.json")


@pytest.mark.parametrize("name", MOUNTINGS)
def test_all_kinematics_agree(name: str) -> None:
    scene = mounted(**MOUNTINGS[name])
    robot = scene.robot.description
    (chain,) = kinematics_of(robot).chains
    geometry = SceneGeometry(scene)
    limits = robot.position_limits
    with World(scene) as world:
        for q in np.random.default_rng(0).uniform(*limits.T, (20, 7)):
            world.set(q, {})
            seen, expected = world.tool_poses(["panda"])[0], scene.robot.tool_pose(q, "panda")
            assert seen[:3] == pytest.approx(expected[:3], abs=1e-5)
            assert abs(seen[3:] @ expected[3:]) == pytest.approx(1.0)
            x, y, z = ca.evalf(chain.pose(q, 1, ()).position).full().ravel()
            assert geometry.in_world(x, y, 0.0, z)[:3] == pytest.approx(expected[:3], abs=1e-9)


@pytest.mark.parametrize("name", MOUNTINGS)
def test_it_plans_and_the_plan_holds(name: str) -> None:
    scene = mounted(**MOUNTINGS[name])
    validate_scene(scene)
    skeleton = parse_skeleton("(grasp panda red) (place panda red tab2)")
    result = SceneBounds(scene, load_params(SOURCES / "params.yaml").bounds).path(skeleton)
    assert result.trajectory is not None, result.failure
    report = execute(scene, parse_objective(["(on red tab2)"]), skeleton, result.trajectory)
    assert report.success, report


def test_what_is_not_level_stands_on_no_column() -> None:
    assert not mounted(**CEILING).robot.columns
    assert mounted(height=0.4).robot.columns


def test_the_document_names_a_tilt_only_where_there_is_one() -> None:
    assert mounted(**WALL).model_dump(mode="json")["robot"]["tilt"] == [0.0, np.pi / 2]
    assert "tilt" not in mounted().model_dump(mode="json")["robot"]


@pytest.mark.parametrize(
    ("robot", "fault"),
    [
        ({"model": "pr2", "tilt": [0.5, 0.0]}, "mounted.json: robot: tilt: .*pitch, not roll"),
        ({"tilt": [90, 0]}, "robot.tilt.*90 is too large.*degrees"),
        ({"tilt": [0.1]}, r"robot\.tilt"),
    ],
)
def test_a_tilt_that_cannot_be_served_is_one_line(robot: dict[str, Any], fault: str) -> None:
    with pytest.raises(InputError, match=fault) as error:
        mounted(**robot)
    assert "\n" not in str(error.value)


def test_two_arms_that_hang_are_still_mirror_images() -> None:
    assert mounted(model="pr2", height=2.0, tilt=[np.pi, 0.0]).robot.description.tilt[0] == np.pi
