"""The PR2's description: files, limits, fingers, kinematics."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from grasp_poses import grasp_poses
from guided_lgp.errors import InputError
from guided_lgp.poses import (
    Array,
    apply,
    compose,
    inverse,
    pose,
    quaternion,
    rotation_matrix,
    tilt,
    yaw_of,
)
from guided_lgp.robots import load_robot
from guided_lgp.scene import Scene, Table, generate
from guided_lgp.scene.world import World

PR2 = load_robot("pr2")
HAND = PR2.arms["pr2L"].fingers
PALM_FRONT = PR2.arms["pr2L"].palm_front


def angle_between(first: Array, second: Array) -> float:
    """Angle (rad) of the rotation between two poses."""
    return float(2 * np.arccos(min(1.0, abs(compose(inverse(first), second)[6]))))


@pytest.fixture(scope="module")
def turned() -> Scene:
    """A scene with the robot off the origin, for conventions."""
    scene = generate("a", 1, 1, "x").scenes[0]
    robot = scene.robot.model_copy(update={"base": (0.1, -0.2, 0.3), "torso": 0.15})
    far = Table(name="tab1", position=(3, 3, 0.6), half_extents=(0.2, 0.2))
    return scene.model_copy(update={"robot": robot, "tables": (far, *scene.tables[1:])})


def test_description_is_cached_under_its_content(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    path = replace(PR2.description).urdf
    assert path.parent == tmp_path / "guided-lgp"
    assert list(path.parent.glob("*.urdf")) == [path]
    text = path.read_text()
    assert "package://" not in text
    meshes = [mesh.get("filename", "") for mesh in ET.fromstring(text).iter("mesh")]
    assert meshes
    assert all(Path(mesh).is_file() for mesh in meshes)
    before = path.stat().st_mtime_ns
    assert replace(PR2.description).urdf == path
    assert path.stat().st_mtime_ns == before


def test_unusable_cache_folder_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    with pytest.raises(InputError, match=r"guided-lgp: .*XDG_CACHE_HOME"):
        _ = replace(PR2.description).urdf


def test_limits_are_the_urdfs() -> None:
    joints = {joint.get("name"): joint for joint in ET.parse(PR2.urdf).getroot().findall("joint")}
    for index, name in enumerate(PR2.joint_names):
        limit = joints[name].find("limit")
        assert limit is not None
        assert PR2.velocity_limits[index] == float(limit.get("velocity", "nan"))
        if joints[name].get("type") == "continuous":
            assert index in PR2.continuous
        else:
            # what the real arm's safety controllers allow, not where its joints stop
            soft = joints[name].find("safety_controller")
            assert soft is not None
            bounds = [float(soft.get(f"soft_{side}_limit", "nan")) for side in ("lower", "upper")]
            assert PR2.position_limits[index] == pytest.approx(bounds)
    for gripper in PR2.grippers:
        for name in PR2.arms[gripper].fingers.joints:
            limit = joints[name].find("limit")
            assert limit is not None
            assert float(limit.get("upper", "nan")) == HAND.upper
            assert float(limit.get("velocity", "nan")) == HAND.velocity
            mimic = joints[name].find("mimic")
            assert mimic is None or mimic.get("multiplier") == "1"


def test_kinematics_agree_with_pybullet(turned: Scene) -> None:
    rng = np.random.default_rng(0)
    with World(turned) as world:
        for _ in range(20):
            q = rng.uniform(*PR2.position_limits.T)
            world.set(q, {})
            seen = world.link_poses([PR2.arms[gripper].tool_link for gripper in PR2.grippers])
            for gripper, expected in zip(PR2.grippers, seen, strict=True):
                found = turned.robot.tool_pose(q, gripper)
                assert found[:3] == pytest.approx(expected[:3], abs=1e-5)
                assert angle_between(found, expected) < 1e-3


def test_kinematics_along_a_motion(turned: Scene) -> None:
    q = np.linspace(PR2.home, PR2.home - 0.3, 5)
    poses = turned.robot.tool_poses(q)
    for row, gripper in ((0, "pr2L"), (4, "pr2R")):
        assert poses[gripper][row] == pytest.approx(turned.robot.tool_pose(q[row], gripper))


def test_arms_mirror_each_other() -> None:
    scene = generate("a", 1, 1, "x").scenes[0]
    left = scene.robot.tool_pose(PR2.home, "pr2L")
    right = scene.robot.tool_pose(PR2.home, "pr2R")
    assert left[:3] * [1, -1, 1] == pytest.approx(right[:3], abs=1e-9)


@pytest.mark.parametrize("joint", [0.0, 0.2, 0.4, 0.548])
def test_finger_opening_is_what_the_hulls_measure(joint: float) -> None:
    scene = generate("a", 1, 1, "x").scenes[0]
    with World(scene) as world:
        world.set(PR2.home, {}, {"pr2L": joint})
        gap = world.distance("l_gripper_l_finger_tip_link", "l_gripper_r_finger_tip_link")
    assert HAND.opening(joint) == pytest.approx(gap, abs=0.002)
    assert HAND.value(HAND.opening(joint)) == pytest.approx(joint)


def test_finger_joint_stays_in_its_limits() -> None:
    assert HAND.value(1.0) == HAND.upper
    assert HAND.value(-1.0) == HAND.lower


def test_lever_bounds_the_way_of_the_tool(turned: Scene) -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        q = rng.uniform(*PR2.position_limits.T)
        for joint in range(14):
            moved = q.copy()
            moved[joint] += 0.01
            gripper = PR2.grippers[joint // 7]
            way = np.linalg.norm(
                turned.robot.tool_pose(moved, gripper)[:3] - turned.robot.tool_pose(q, gripper)[:3]
            )
            assert way <= 0.01 * PR2.arms[gripper].lever_arms[joint % 7] + 1e-9


def test_grasp_poses_close_across_the_narrow_side_with_the_palm_at_the_box() -> None:
    box = generate("a", 1, 1, "x").scenes[0].boxes[0]
    body = pose(box.position, box.yaw)
    corners = apply(
        body,
        np.array(box.size) / 2 * [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)],
    )
    for tool in grasp_poses(box, PALM_FRONT):
        closing = compose(compose(inverse(body), tool), pose((0, 1, 0)))[:3]
        closing -= compose(inverse(body), tool)[:3]
        assert np.abs(closing) == pytest.approx([0, 1, 0], abs=1e-9)
        nearest = apply(inverse(tool), corners)[:, 0].min()
        assert nearest == pytest.approx(PALM_FRONT + 0.002, abs=1e-9)


def test_poses() -> None:
    first, second = pose((1, 2, 3), 0.4), pose((0.1, 0, -1), -1.0)
    assert compose(inverse(first), first) == pytest.approx([0, 0, 0, 0, 0, 0, 1])
    assert yaw_of(compose(first, second)) == pytest.approx(-0.6)
    assert tilt(first) == pytest.approx(0)
    assert apply(first, np.zeros(3)) == pytest.approx([1, 2, 3])
    batch = np.stack([first, second])
    assert compose(first, batch)[1] == pytest.approx(compose(first, second))
    assert angle_between(first, second) == pytest.approx(1.4)


def test_quaternion_of_a_rotation() -> None:
    rng = np.random.default_rng(2)
    turns = [*np.eye(4), *rng.normal(size=(50, 4))]
    for turn in (q / np.linalg.norm(q) for q in turns):
        found = quaternion(rotation_matrix(turn))
        assert abs(found @ turn) == pytest.approx(1.0)
    assert quaternion(np.eye(3)).tolist() == [0, 0, 0, 1]
