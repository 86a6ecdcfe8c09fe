"""Every robot that ships: its file against pinocchio, and what is derived where it says nothing."""

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yaml
from own_robot import describe, document, written

from guided_lgp.errors import InputError
from guided_lgp.poses import rotation_matrix
from guided_lgp.robots import Robot, load_robot, robot_names
from guided_lgp.robots.build import read_robot
from guided_lgp.robots.chain import read_chain
from guided_lgp.robots.inverse import InverseKinematics

_FOLDER = Path(__file__).parents[2] / "src/guided_lgp/robots"


@pytest.fixture(params=robot_names())
def robot(request: pytest.FixtureRequest) -> Robot:
    return load_robot(request.param)


def changed(tmp_path: Path, name: str, arm: str, **fields: object) -> Path:
    """A copy of a robot file beside the original, one of its arms changed."""
    data = yaml.safe_load((_FOLDER / f"{name}.yaml").read_text())
    for field, value in fields.items():
        if value is None:
            del data["arms"][arm][field]
        else:
            data["arms"][arm][field] = value
    file = tmp_path / "robot.yaml"
    file.write_text(yaml.safe_dump(data, sort_keys=False))
    return file


def test_the_home_posture_is_free_of_collisions(robot: Robot) -> None:
    assert np.all(robot.home >= robot.position_limits[:, 0])
    assert np.all(robot.home <= robot.position_limits[:, 1])
    model = pin.buildModelFromUrdf(str(robot.urdf))
    geometry = pin.buildGeomFromUrdf(model, str(robot.urdf), pin.GeometryType.COLLISION)
    fixed = {joint.joint: joint.default for joint in robot.fixed_joints.values()}
    q = robot.kinematics.rows(robot.home[None], fixed)[0]
    geometry.addAllCollisionPairs()
    data = geometry.createData()
    pin.computeCollisions(model, model.createData(), geometry, data, q, False)
    for pair, result in zip(geometry.collisionPairs, data.collisionResults, strict=True):
        links = frozenset(
            model.frames[geometry.geometryObjects[body].parentFrame].name
            for body in (pair.first, pair.second)
        )
        assert not result.isCollision() or len(links) == 1 or links in robot.disabled_pairs


def test_compiled_kinematics_are_those_of_pinocchio(robot: Robot) -> None:
    fixed = {joint.joint: joint.default for joint in robot.fixed_joints.values()}
    q = np.random.default_rng(0).uniform(*robot.position_limits.T, (50, len(robot.joint_names)))
    links = [link for arm in robot.arms.values() for link in (*arm.segment_ends, arm.tool_link)]
    found = robot.kinematics.link_poses(q, fixed, links)
    expected = robot.kinematics.link_poses_by_pinocchio(q, fixed, links)
    np.testing.assert_allclose(found, expected, atol=1e-13)


def test_inverse_kinematics_lead_back_home(robot: Robot) -> None:
    fixed = {joint.joint: joint.default for joint in robot.fixed_joints.values()}
    poses = robot.kinematics.link_poses(
        robot.home[None], fixed, [arm.tool_link for arm in robot.arms.values()]
    )[0]
    for arm, pose in zip(robot.arms.values(), poses, strict=True):
        chain = read_chain(robot.urdf, robot.base_link, arm.tool_link, arm.joints, fixed)
        solver = InverseKinematics(chain, arm.limits, arm.redundant, arm.home)
        value = 0.0 if arm.redundant is None else arm.home[arm.redundant]
        q, valid = solver.inverse(rotation_matrix(pose[3:]), pose[:3], value)
        assert np.abs(q[valid] - arm.home).max(axis=1).min() < 1e-6


def test_measures_are_there(robot: Robot) -> None:
    for arm in robot.arms.values():
        assert arm.spheres
        assert 0 < arm.fingers.grasp_width < arm.fingers.widest
        assert arm.palm_front < 0
        assert np.all(arm.lever_arms[:-1] > 0)
        assert np.all(arm.metric >= arm.lever_arms - 0.01)
        assert arm.fingers.value(arm.fingers.widest) == pytest.approx(arm.fingers.opened)


def test_without_an_srdf_pairs_of_links_are_sampled_once(tmp_path: Path) -> None:
    text = (_FOLDER / "ur5.yaml").read_text()
    file = tmp_path / "robot.yaml"
    file.write_text(re.sub(r"  srdf: .*\n", "", text))
    sampled = load_robot(str(file))
    assert sampled.disabled_pairs <= load_robot("ur5").disabled_pairs
    assert frozenset(("upper_arm_link", "forearm_link")) in sampled.disabled_pairs
    kept = sampled.urdf.with_suffix(".pairs.json")
    before = kept.stat().st_mtime_ns
    assert read_robot(file).disabled_pairs == sampled.disabled_pairs
    assert kept.stat().st_mtime_ns == before


def test_signs_of_a_mirrored_arm_are_found(tmp_path: Path) -> None:
    file = changed(tmp_path, "pr2", "pr2R", signs=None)
    found = load_robot(str(file)).arms["pr2R"]
    assert found.signs.tolist() == load_robot("pr2").arms["pr2R"].signs.tolist()


def test_an_arm_that_is_no_mirror_image_is_named(tmp_path: Path) -> None:
    describe(tmp_path, "a", "b")
    content = document("a", "b")
    content["arms"]["bhand"] = {"side": "b", "mirrors": "ahand"}
    with pytest.raises(InputError, match=r"arms\.bhand\.mirrors: is no mirror image of ahand"):
        read_robot(Path(written(tmp_path, content)))


def test_soft_limits_count_unless_the_file_says_otherwise(tmp_path: Path) -> None:
    file = changed(tmp_path, "pr2", "pr2R")
    hard = file.read_text().replace("description:\n", "description:\n  limits: hard\n")
    file.write_text(hard)
    left = load_robot(str(file)).arms["pr2L"]
    assert left.limits[0].tolist() == [-0.714601836603, 2.2853981634]
    assert load_robot("pr2").arms["pr2L"].limits[0].tolist() == [-0.564601836603, 2.1353981634]


_JOINTS = ("shoulder_lift", "shoulder_pan", "upper_arm_roll", "elbow_flex")
_WRIST = ("forearm_roll", "wrist_flex", "wrist_roll")


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"redundant": None}, r"an arm of 7 joints, redundant: none \(six joints, or seven"),
        ({"hand_links": ["l_gripper_palm_link"], "spheres": None}, r"hand_links: lack l_gripper"),
        (
            {"joints": [f"<side>_{joint}_joint" for joint in (*_JOINTS, *_WRIST)]},
            "do not carry l_gripper_tool_frame one after the other",
        ),
    ],
)
def test_faults_of_an_arm_are_told_in_one_line(
    tmp_path: Path, fields: dict[str, object], message: str
) -> None:
    file = changed(tmp_path, "pr2", "pr2L", **fields)
    with pytest.raises(InputError, match=message):
        load_robot(str(file))
