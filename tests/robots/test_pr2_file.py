"""The robot file of the PR2 holds what the planner was written for."""

import numpy as np

from guided_lgp.robots import load_robot
from guided_lgp.scene import GRIPPERS, pr2

ROBOT = load_robot("pr2")


def test_joints_and_limits() -> None:
    assert ROBOT.grippers == GRIPPERS
    assert ROBOT.joint_names == pr2.ARM_JOINTS
    assert ROBOT.continuous == pr2.CONTINUOUS
    assert ROBOT.home.tobytes() == pr2.HOME_CONFIGURATION.tobytes()
    assert ROBOT.position_limits.tobytes() == pr2.JOINT_LIMITS.tobytes()
    assert ROBOT.velocity_limits.tobytes() == pr2.VELOCITY_LIMITS.tobytes()
    assert ROBOT.acceleration_limits.tobytes() == pr2.ACCELERATION_LIMITS.tobytes()
    assert ROBOT.lever_arms.tobytes() == pr2.LEVER.tobytes()
    assert ROBOT.disabled_pairs == pr2.disabled_pairs()
    assert ROBOT.urdf == pr2.urdf_path()
    assert ROBOT.fixed_joints["torso"].limits == pr2.TORSO_LIMITS


def test_arms() -> None:
    for gripper, arm in ROBOT.arms.items():
        assert arm.slice == pr2.arm_slice(gripper)
        assert arm.links == pr2.ARM_LINKS[gripper]
        assert arm.hand_links == pr2.HAND_LINKS[gripper]
        assert arm.tool_link == pr2.TOOL_LINK[gripper]
        assert arm.tool_in_link.tolist() == [0, 0, 0, 0, 0, 0, 1]
        assert arm.palm_front == pr2.PALM_FRONT
        assert arm.reaches.tolist() == [1.0, 0.9, 0.75, 0.65, 0.35, 0.3, 0.16]
        assert arm.redundant == 0
    left, right = ROBOT.arms.values()
    assert (left.mirror_of, right.mirror_of) == (None, "pr2L")
    assert right.signs.tobytes() == pr2.MIRROR.tobytes()


def test_fingers() -> None:
    for gripper, arm in ROBOT.arms.items():
        fingers = arm.fingers
        assert fingers.joints == pr2.FINGER_JOINTS[gripper]
        assert (fingers.lower, fingers.upper) == pr2.FINGER_LIMITS
        assert (fingers.closed, fingers.opened) == pr2.FINGER_LIMITS
        assert fingers.velocity == pr2.FINGER_VELOCITY
        assert fingers.ratios.tolist() == [1, 1, 1, 1]
        assert fingers.widest == pr2.MAX_OPENING
        assert fingers.grasp_width == pr2.GRASP_WIDTH
        for value in np.linspace(-0.1, 0.6, 20).tolist():
            assert fingers.opening(value) == pr2.finger_opening(value)
            assert fingers.value(value / 4) == pr2.finger_joint(value / 4)
