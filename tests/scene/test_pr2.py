"""The PR2's description: files, limits, fingers, kinematics."""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest

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
from guided_lgp.scene import GRIPPERS, Scene, Table, generate, pr2
from guided_lgp.scene.reach import grasp_poses, solve_arm
from guided_lgp.scene.world import World


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
    path = pr2.urdf_path.__wrapped__()
    assert path.parent == tmp_path / "guided-lgp"
    assert list(path.parent.glob("*.urdf")) == [path]
    text = path.read_text()
    assert "package://" not in text
    meshes = [mesh.get("filename", "") for mesh in ET.fromstring(text).iter("mesh")]
    assert meshes
    assert all(Path(mesh).is_file() for mesh in meshes)
    before = path.stat().st_mtime_ns
    assert pr2.urdf_path.__wrapped__() == path
    assert path.stat().st_mtime_ns == before


def test_unusable_cache_folder_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    with pytest.raises(InputError, match=r"guided-lgp: .*XDG_CACHE_HOME"):
        pr2.urdf_path.__wrapped__()


def test_limits_are_the_urdfs() -> None:
    joints = {
        joint.get("name"): joint for joint in ET.parse(pr2.urdf_path()).getroot().findall("joint")
    }
    for index, name in enumerate(pr2.ARM_JOINTS):
        limit = joints[name].find("limit")
        assert limit is not None
        assert pr2.VELOCITY_LIMITS[index] == float(limit.get("velocity", "nan"))
        if joints[name].get("type") == "continuous":
            assert index in pr2.CONTINUOUS
        else:
            bounds = [float(limit.get(side, "nan")) for side in ("lower", "upper")]
            assert pr2.JOINT_LIMITS[index] == pytest.approx(bounds)
    for gripper in GRIPPERS:
        for name in pr2.FINGER_JOINTS[gripper]:
            limit = joints[name].find("limit")
            assert limit is not None
            assert float(limit.get("upper", "nan")) == pr2.FINGER_LIMITS[1]
            assert float(limit.get("velocity", "nan")) == pr2.FINGER_VELOCITY
            mimic = joints[name].find("mimic")
            assert mimic is None or mimic.get("multiplier") == "1"


def test_kinematics_agree_with_pybullet(turned: Scene) -> None:
    rng = np.random.default_rng(0)
    with World(turned) as world:
        for _ in range(20):
            q = rng.uniform(*pr2.JOINT_LIMITS.T)
            world.set(q, {})
            seen = world.link_poses([pr2.TOOL_LINK[gripper] for gripper in GRIPPERS])
            for gripper, expected in zip(GRIPPERS, seen, strict=True):
                found = pr2.tool_pose(turned, q, gripper)
                assert found[:3] == pytest.approx(expected[:3], abs=1e-5)
                assert angle_between(found, expected) < 1e-3


def test_kinematics_along_a_motion(turned: Scene) -> None:
    q = np.linspace(pr2.HOME_CONFIGURATION, pr2.HOME_CONFIGURATION - 0.3, 5)
    poses = pr2.tool_poses(turned, q)
    for row, gripper in ((0, "pr2L"), (4, "pr2R")):
        assert poses[gripper][row] == pytest.approx(pr2.tool_pose(turned, q[row], gripper))


def test_arms_mirror_each_other() -> None:
    scene = generate("a", 1, 1, "x").scenes[0]
    left = pr2.tool_pose(scene, pr2.HOME_CONFIGURATION, "pr2L")
    right = pr2.tool_pose(scene, pr2.HOME_CONFIGURATION, "pr2R")
    assert left[:3] * [1, -1, 1] == pytest.approx(right[:3], abs=1e-9)


@pytest.mark.parametrize("joint", [0.0, 0.2, 0.4, 0.548])
def test_finger_opening_is_what_the_hulls_measure(joint: float) -> None:
    scene = generate("a", 1, 1, "x").scenes[0]
    with World(scene) as world:
        world.set(pr2.HOME_CONFIGURATION, {}, {"pr2L": joint})
        gap = world.distance("l_gripper_l_finger_tip_link", "l_gripper_r_finger_tip_link")
    assert pr2.finger_opening(joint) == pytest.approx(gap, abs=0.002)
    assert pr2.finger_joint(pr2.finger_opening(joint)) == pytest.approx(joint)


def test_finger_joint_stays_in_its_limits() -> None:
    assert pr2.finger_joint(1.0) == pr2.FINGER_LIMITS[1]
    assert pr2.finger_joint(-1.0) == pr2.FINGER_LIMITS[0]


def test_lever_bounds_the_way_of_the_tool(turned: Scene) -> None:
    rng = np.random.default_rng(1)
    for _ in range(50):
        q = rng.uniform(*pr2.JOINT_LIMITS.T)
        for joint in range(14):
            moved = q.copy()
            moved[joint] += 0.01
            gripper = GRIPPERS[joint // 7]
            way = np.linalg.norm(
                pr2.tool_pose(turned, moved, gripper)[:3] - pr2.tool_pose(turned, q, gripper)[:3]
            )
            assert way <= 0.01 * pr2.LEVER[joint] + 1e-9


def test_inverse_kinematics_reach_their_target(turned: Scene) -> None:
    q = pr2.HOME_CONFIGURATION * 0.7
    for gripper in GRIPPERS:
        target = pr2.tool_pose(turned, q, gripper)
        arm = solve_arm(turned, gripper, target, pr2.HOME[gripper])
        assert arm is not None
        found = q.copy()
        found[pr2.arm_slice(gripper)] = arm
        assert pr2.tool_pose(turned, found, gripper) == pytest.approx(target, abs=1e-4)


def test_grasp_poses_close_across_the_narrow_side_with_the_palm_at_the_box() -> None:
    box = generate("a", 1, 1, "x").scenes[0].boxes[0]
    body = pose(box.position, box.yaw)
    corners = apply(
        body,
        np.array(box.size) / 2 * [[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)],
    )
    for tool in grasp_poses(box):
        closing = compose(compose(inverse(body), tool), pose((0, 1, 0)))[:3]
        closing -= compose(inverse(body), tool)[:3]
        assert np.abs(closing) == pytest.approx([0, 1, 0], abs=1e-9)
        nearest = apply(inverse(tool), corners)[:, 0].min()
        assert nearest == pytest.approx(pr2.PALM_FRONT + 0.002, abs=1e-9)


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
