"""Nothing counts on two arms: a robot with three, in the world and under verification."""

import numpy as np
import pytest
from own_robot import describe, document, written

from guided_lgp.bounds.results import Keyframe
from guided_lgp.bounds.verify import verify_keyframe
from guided_lgp.logic import applicable_actions
from guided_lgp.poses import compose, inverse, pose
from guided_lgp.scene import Scene, parse_scene
from guided_lgp.scene.world import World, initial_poses
from guided_lgp.search.observation import observe, start

SIDES = ("a_", "b_", "c_")


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    folder = tmp_path_factory.mktemp("robot")
    describe(folder, *SIDES)
    box = {"size": [0.1, 0.04, 0.06], "on": "table"}
    return parse_scene(
        {
            "robot": {"model": written(folder, document(*SIDES))},
            "tables": [{"name": "table", "position": [2.0, 0.0, 0.5], "half_extents": [0.4, 0.4]}],
            "boxes": [
                {"name": "red", "position": [2.0, -0.2, 0.53], **box},
                {"name": "green", "position": [2.0, 0.2, 0.53], **box},
            ],
        },
        "scene.json",
    )


def test_configurations_and_symbols(scene: Scene) -> None:
    robot = scene.robot.description
    assert robot.grippers == ("a_hand", "b_hand", "c_hand") == scene.symbols.grippers
    assert len(robot.joint_names) == 18
    assert len(robot.moving_joints) == 24
    assert robot.arms["c_hand"].fingers.slice == slice(22, 24)
    assert len(list(applicable_actions(scene.state, scene.symbols))) == 6
    assert [name for name in observe(scene, start(scene)) if "hand" in name] == list(robot.grippers)


def test_kinematics_agree_with_the_world(scene: Scene) -> None:
    robot = scene.robot.description
    with World(scene) as world:
        for q in np.random.default_rng(0).uniform(*robot.position_limits.T, (20, 18)):
            world.set(q, {}, {"b_hand": 0.02})
            seen = world.tool_poses(robot.grippers)
            for gripper, found in zip(robot.grippers, seen, strict=True):
                expected = scene.robot.tool_pose(q, gripper)
                assert found[:3] == pytest.approx(expected[:3], abs=1e-5)
                assert abs(found[3:] @ expected[3:]) == pytest.approx(1.0)


def test_a_keyframe_is_verified(scene: Scene) -> None:
    """The third hand holds a box; in a hand too far to the side, or in another's, it does not."""
    q = scene.robot.description.home
    tool = scene.robot.tool_pose(q, "c_hand")
    arm = scene.robot.description.arms["c_hand"]
    # its width along the closing axis, its near end at the palm
    depth = arm.palm_front + 0.052
    grip = pose((depth, 0.0, 0.0))
    boxes = initial_poses(scene) | {"red": compose(tool, grip)}
    domain = scene.symbols.domain
    held = domain.state({"green": "table"}, {"red": "c_hand"})
    with World(scene) as world:
        assert verify_keyframe(world, Keyframe(q, boxes), held) == []
        aside = boxes | {"red": compose(boxes["red"], pose((0.0, 0.01, 0.0)))}
        assert verify_keyframe(world, Keyframe(q, aside), held)
        other = domain.state({"green": "table"}, {"red": "a_hand"})
        assert verify_keyframe(world, Keyframe(q, boxes), other)
    assert compose(inverse(tool), boxes["red"]) == pytest.approx(grip)
