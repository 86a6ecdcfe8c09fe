"""A robot that a scene raises stands on a column."""

from typing import Any

import numpy as np
import pytest

from guided_lgp.bounds.coarse import CoarseBound
from guided_lgp.bounds.coarse.formulation import Formulator
from guided_lgp.bounds.program.geometry import Margins, SceneGeometry
from guided_lgp.errors import InputError
from guided_lgp.logic import parse_skeleton
from guided_lgp.poses import apply, pose
from guided_lgp.scene import Scene, parse_scene
from guided_lgp.scene.bullet import pybullet
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


def raised(**robot: Any) -> Scene:
    """Two boxes before a Panda that stands as high as the tables."""
    placed = {"model": "panda", "base": [0, 0, 0], "height": 0.4} | robot
    return parse_scene({"robot": placed, "tables": TABLES, "boxes": BOXES}, "raised.json")


def test_one_arm_on_a_column_is_a_valid_scene() -> None:
    scene = raised()
    validate_scene(scene)
    assert scene.symbols.grippers == ("panda",)
    assert scene.robot.base_pose[:3].tolist() == [0, 0, 0.4]
    with World(scene) as world:
        assert world.penetrations() == []
        assert world.distance("robot.column", "panda_link0") == pytest.approx(0.0, abs=2e-3)


def test_kinematics_agree_with_the_world() -> None:
    scene = raised(base=[0.1, -0.2, 0.3])
    limits = scene.robot.description.position_limits
    rng = np.random.default_rng(0)
    with World(scene) as world:
        for q in rng.uniform(*limits.T, (20, 7)):
            world.set(q, {})
            seen, expected = world.tool_poses(["panda"])[0], scene.robot.tool_pose(q, "panda")
            assert seen[:3] == pytest.approx(expected[:3], abs=1e-5)
            assert abs(seen[3:] @ expected[3:]) == pytest.approx(1.0)


def test_an_arm_that_reaches_into_the_column_collides() -> None:
    scene = raised()
    q = scene.robot.description.home.copy()
    q[:4] = 2.6, 1.5, 0.0, -2.8
    with World(scene) as world:
        world.set(q, {})
        assert any("robot.column" in overlap.bodies for overlap in world.penetrations())


@pytest.mark.parametrize(("model", "gripper"), [("panda", "panda"), ("ur5", "ur5")])
def test_the_coarse_bound_keeps_arms_clear_of_the_column(model: str, gripper: str) -> None:
    scene = raised(model=model)
    skeleton = parse_skeleton(f"(grasp {gripper} red)")
    geometry = SceneGeometry(scene)
    formulation = Formulator(geometry, Margins()).build(skeleton)
    against = {instance.names for instance in formulation.instances}
    assert ("clear", gripper, "robot.column") in against
    result = CoarseBound(scene, 3).solve(skeleton)
    assert result.feasible, result.failure
    x, y, z = geometry.bodies["robot.column"].half
    assert (x, y) == scene.robot.description.stand
    assert z == pytest.approx(0.15)  # the upper 10 cm are the verification's


def test_the_document_names_the_height_only_of_a_raised_robot() -> None:
    assert raised().model_dump(mode="json")["robot"] == {
        "model": "panda",
        "base": [0.0, 0.0, 0.0],
        "height": 0.4,
    }
    on_the_floor = Scene.model_validate(
        {"tables": TABLES, "boxes": BOXES, "robot": {"model": "pr2", "torso": 0.2}}
    )
    assert on_the_floor.model_dump(mode="json")["robot"] == {
        "model": "pr2",
        "base": [0.0, 0.0, 0.0],
        "torso": 0.2,
    }


@pytest.mark.parametrize(
    ("robot", "fault"),
    [
        ({"model": "r2d2"}, "unknown robot 'r2d2' .*panda, pr2"),
        ({"model": "missing.yaml"}, "missing.yaml: No such file"),
        ({"torso": 0.2}, "unknown field 'torso' .known: model, base, height."),
        ({"height": -0.1}, r"robot\.height: -0\.1 is less than 0"),
    ],
)
def test_a_fault_of_the_robot_is_named(robot: dict[str, Any], fault: str) -> None:
    with pytest.raises(InputError, match=fault):
        raised(**robot)


def test_every_shape_of_a_link_collides() -> None:
    """The Panda's fingers have several shapes each: a crumb in any of them is found."""
    scene = raised()
    crumbs = [box.model_copy(update={"size": (0.004, 0.004, 0.004)}) for box in scene.boxes]
    scene = scene.model_copy(update={"boxes": tuple(crumbs)})
    home = scene.robot.description.home
    with World(scene) as world:
        for finger in ("panda_leftfinger", "panda_rightfinger"):
            part = world.robot, world.links[finger]
            shapes = pybullet.getCollisionShapeData(*part, physicsClientId=world.client)
            state = pybullet.getLinkState(*part, physicsClientId=world.client)
            mass = np.array([*state[0], *state[1]])
            assert len(shapes) > 1
            for shape in shapes:  # each is placed in the frame of the link's centre of mass
                world.set(home, {"red": pose(apply(mass, np.array(shape[5])))})
                bodies = [overlap.bodies for overlap in world.penetrations(0.001)]
                assert {"red", finger} in bodies
