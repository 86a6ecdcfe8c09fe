import numpy as np
import pytest
from motions import scene

from guided_lgp.bounds.path.ik import Arm, continuous_near, unwrapped
from guided_lgp.poses import rotation_matrix
from guided_lgp.scene import GRIPPERS, PlacedRobot
from guided_lgp.scene.pr2 import CONTINUOUS, HOME_CONFIGURATION, JOINT_LIMITS, arm_slice, tool_pose

TURNED = scene(red=(0.5, 0.3, 0.65, 0.0, "tab1")).model_copy(
    update={"robot": PlacedRobot(base=(0.1, -0.2, 0.3), torso=0.2)}
)


def _postures(gripper: str, count: int) -> np.ndarray:
    limits = JOINT_LIMITS[arm_slice(gripper)]
    return np.random.default_rng(1).uniform(limits[:, 0], limits[:, 1], (count, 7))


@pytest.mark.parametrize("gripper", GRIPPERS)
def test_forward_kinematics_agree_with_pinocchio(gripper: str) -> None:
    arm = Arm(TURNED, gripper)
    postures = _postures(gripper, 50)
    rotation, position = arm.forward(postures)
    for joints, turn, origin in zip(postures, rotation, position, strict=True):
        q = HOME_CONFIGURATION.copy()
        q[arm_slice(gripper)] = joints
        expected = tool_pose(TURNED, q, gripper)
        assert origin == pytest.approx(expected[:3], abs=1e-9)
        assert turn == pytest.approx(rotation_matrix(expected[3:]), abs=1e-9)


@pytest.mark.parametrize("gripper", GRIPPERS)
def test_inverse_finds_the_posture_behind_every_pose(gripper: str) -> None:
    arm = Arm(TURNED, gripper)
    postures = _postures(gripper, 300)
    postures = postures[np.all(np.abs(postures[:, [3, 5]]) > 0.1, axis=1)]
    found, valid = arm.inverse(*arm.forward(postures), postures[:, 0])
    gap = np.abs(np.angle(np.exp(1j * (found - postures[:, None])))).max(axis=-1)
    best = gap.argmin(axis=1)
    rows = np.arange(len(postures))
    assert gap[rows, best].max() < 1e-6
    assert valid[rows, best].all()


@pytest.mark.parametrize("gripper", GRIPPERS)
def test_every_valid_solution_reaches_the_pose_within_limits(gripper: str) -> None:
    arm = Arm(TURNED, gripper)
    rotation, position = arm.forward(_postures(gripper, 40))
    pans = np.linspace(*JOINT_LIMITS[arm_slice(gripper)][0], 9)[None]
    found, valid = arm.inverse(rotation[:, None], position[:, None], pans)
    assert 0.05 < valid.mean() < 0.95
    turn, origin = arm.forward(found)
    assert np.abs(origin - position[:, None, None])[valid].max() < 1e-9
    assert np.abs(turn - rotation[:, None, None])[valid].max() < 1e-9
    limits = JOINT_LIMITS[arm_slice(gripper)]
    assert np.all((found[valid] >= limits[:, 0]) & (found[valid] <= limits[:, 1]))


def test_out_of_reach_is_not_valid() -> None:
    arm = Arm(TURNED, "pr2L")
    _, valid = arm.inverse(np.eye(3), np.array([3.0, 0.0, 1.0]), np.array(0.3))
    assert not valid.any()


def test_continuous_joints_follow_the_reference_and_have_no_jumps() -> None:
    reference = np.array([0.0, 0.0, 0.0, 0.0, 3.0, 0.0, -3.0])
    q = np.array([0.0, 0.0, 0.0, 0.0, -3.0, 0.0, 3.0])
    near = continuous_near(q, reference)
    assert np.abs(near - reference).max() < np.pi
    path = unwrapped(np.stack([reference, q]))
    joints = [joint for joint in CONTINUOUS if joint < 7]
    assert np.abs(np.diff(path[:, joints], axis=0)).max() < np.pi
