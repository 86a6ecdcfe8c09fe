"""Limits of the robots against what their URDF says, read here with nothing of ours."""

import logging
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
import yaml

from guided_lgp.errors import InputError
from guided_lgp.paths import SHIPPED
from guided_lgp.robots import build, load_robot
from guided_lgp.robots.build import read_robot

ROBOTS = ("pr2", "panda", "ur5", "baxter")


def _stated(joint: ET.Element) -> tuple[float, float, float, float]:
    """Lower, upper, velocity and effort: the softer ones where a safety controller has some."""
    limit, safety = joint.find("limit"), joint.find("safety_controller")
    assert limit is not None
    lower, upper = float(limit.get("lower", "-inf")), float(limit.get("upper", "inf"))
    if safety is not None and joint.get("type") != "continuous":
        lower = max(lower, float(safety.get("soft_lower_limit", lower)))
        upper = min(upper, float(safety.get("soft_upper_limit", upper)))
    return lower, upper, float(limit.get("velocity", "inf")), float(limit.get("effort", "inf"))


@pytest.mark.parametrize("name", ROBOTS)
def test_limits_of_joints_are_the_urdf_s(name: str) -> None:
    robot = load_robot(name)
    joints = {j.get("name"): j for j in ET.parse(robot.urdf).getroot().findall("joint")}
    for index, joint in enumerate(robot.joint_names):
        lower, upper, velocity, effort = _stated(joints[joint])
        if joints[joint].get("type") != "continuous":
            np.testing.assert_allclose(robot.position_limits[index], (lower, upper))
        assert robot.velocity_limits[index] == velocity
        assert robot.effort_limits[index] == effort
        assert robot.jerk_limits[index] == pytest.approx(20 * robot.acceleration_limits[index])
    for arm in robot.arms.values():
        for joint, ratio in zip(arm.fingers.joints, arm.fingers.ratios, strict=True):
            lower, upper, velocity, _ = _stated(joints[joint])
            ends = sorted((ratio * arm.fingers.lower, ratio * arm.fingers.upper))
            assert ends[0] >= lower - 1e-9
            assert ends[1] <= upper + 1e-9
            assert abs(ratio) * arm.fingers.velocity <= velocity


def test_the_elbow_of_the_pr2_keeps_inside_its_safety_controller() -> None:
    robot = load_robot("pr2")
    elbow = robot.joint_names.index("l_elbow_flex_joint")
    np.testing.assert_allclose(robot.position_limits[elbow], (-2.1213, -0.15), atol=1e-4)


def _panda(tmp_path: Path, **changed: object) -> Path:
    file = Path(build.__file__).with_name("panda.yaml")
    document = yaml.safe_load(file.read_text())
    for field in ("urdf", "srdf"):
        document["description"][field] = str(file.parent / document["description"][field])
    document["description"]["packages"] = {"example-robot-data": str(SHIPPED)}
    document |= changed
    written = tmp_path / "my_panda.yaml"
    written.write_text(yaml.safe_dump({k: v for k, v in document.items() if v is not None}))
    return written


def test_a_limit_that_nobody_states_is_told(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    with caplog.at_level(logging.WARNING):
        robot = read_robot(_panda(tmp_path, acceleration=None))
    assert "my_panda.yaml: no acceleration is stated: 2.0 per s" in caplog.text
    np.testing.assert_allclose(robot.acceleration_limits, 2 * robot.velocity_limits)


@pytest.mark.parametrize(("field", "value"), [("jerk", 0), ("balanced", "springs")])
def test_a_wrong_limit_is_refused(tmp_path: Path, field: str, value: object) -> None:
    with pytest.raises(InputError, match=rf"my_panda\.yaml: {field}"):
        read_robot(_panda(tmp_path, **{field: value}))
