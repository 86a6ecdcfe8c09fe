import numpy as np
import pytest

from guided_lgp.poses import rotation_matrix
from guided_lgp.robots import PlacedArm, load_robot, robot_names
from guided_lgp.robots.inverse import OffsetShoulder, lengths_of
from guided_lgp.scene import PlacedRobot

TURNED = PlacedRobot(base=(0.1, -0.2, 0.3), torso=0.2)
ROBOT = TURNED.description
GRIPPERS = ROBOT.grippers


def placed(gripper: str) -> PlacedArm:
    return PlacedArm(ROBOT, gripper, TURNED.base_pose, TURNED.fixed_values)


def _postures(gripper: str, count: int) -> np.ndarray:
    limits = ROBOT.arms[gripper].limits
    return np.random.default_rng(1).uniform(limits[:, 0], limits[:, 1], (count, 7))


@pytest.mark.parametrize("gripper", GRIPPERS)
def test_forward_kinematics_agree_with_pinocchio(gripper: str) -> None:
    arm = placed(gripper)
    postures = _postures(gripper, 50)
    rotation, position = arm.forward(postures)
    for joints, turn, origin in zip(postures, rotation, position, strict=True):
        q = ROBOT.home.copy()
        q[ROBOT.arms[gripper].slice] = joints
        expected = TURNED.tool_pose(q, gripper)
        assert origin == pytest.approx(expected[:3], abs=1e-9)
        assert turn == pytest.approx(rotation_matrix(expected[3:]), abs=1e-9)


@pytest.mark.parametrize("gripper", GRIPPERS)
def test_inverse_finds_the_posture_behind_every_pose(gripper: str) -> None:
    arm = placed(gripper)
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
    arm = placed(gripper)
    rotation, position = arm.forward(_postures(gripper, 40))
    pans = np.linspace(*ROBOT.arms[gripper].limits[0], 9)[None]
    found, valid = arm.inverse(rotation[:, None], position[:, None], pans)
    assert 0.05 < valid.mean() < 0.95
    turn, origin = arm.forward(found)
    assert np.abs(origin - position[:, None, None])[valid].max() < 1e-9
    assert np.abs(turn - rotation[:, None, None])[valid].max() < 1e-9
    limits = ROBOT.arms[gripper].limits
    assert np.all((found[valid] >= limits[:, 0]) & (found[valid] <= limits[:, 1]))


@pytest.mark.parametrize("gripper", GRIPPERS)
def test_the_formulas_are_the_same_compiled_and_in_numpy(gripper: str) -> None:
    lengths, arm = lengths_of(ROBOT, gripper), ROBOT.arms[gripper]
    assert lengths is not None
    limits = np.sort(arm.signs[:, None] * arm.limits, axis=1)
    solver = OffsetShoulder(lengths, limits, arm.signs, 0.2)
    postures = _postures(gripper, 100)
    poses = solver.forward(postures)
    for found, expected in zip(poses, solver.forward_in_numpy(postures), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-13)
    rotation, position = (array[:, None] for array in poses)
    pans = np.linspace(*arm.limits[0], 9)[None]
    (found, valid), (expected, reached) = (
        solve(rotation, position, pans) for solve in (solver.inverse, solver.inverse_in_numpy)
    )
    assert np.array_equal(valid, reached)
    np.testing.assert_allclose(found[valid], expected[valid], atol=1e-12)


def test_out_of_reach_is_not_valid() -> None:
    arm = placed("pr2L")
    _, valid = arm.inverse(np.eye(3), np.array([3.0, 0.0, 1.0]), np.array(0.3))
    assert not valid.any()


def test_a_branch_is_followed_without_jumps() -> None:
    arm = placed("pr2L")
    start = np.array([0.3, 0.3, 0.9, -1.4, 3.0, -0.9, -3.0])
    rotation, position = arm.forward(start)
    along = position + np.linspace(0.0, 0.1, 12)[:, None] * [0.0, 0.4, 0.9]
    q, valid = arm.inverse(rotation, along, np.full(12, start[0]))
    path = arm.follow(q, valid, arm.branch(start))
    assert path is not None
    assert np.abs(np.diff(path, axis=0)).max() < 0.35
    assert arm.near(path[0], start) == pytest.approx(start, abs=1e-9)
    assert arm.follow(q, np.zeros_like(valid), 0) is None


def test_joints_of_more_than_a_turn_follow_the_reference() -> None:
    arm = placed("pr2L")
    reference = np.array([0.0, 0.0, 0.0, 0.0, 3.0, 0.0, -3.0])
    q = np.array([0.0, 0.0, 0.0, 0.0, -3.0, 0.0, 3.0])
    assert np.abs(arm.near(q, reference) - reference).max() < np.pi
    assert arm.turning.tolist() == [4, 6]


def test_arms_like_a_humans_are_recognised_by_their_description() -> None:
    """The lengths are those of the PR2's manual; a mirrored arm has those of its mirror image."""
    for gripper in GRIPPERS:
        lengths = lengths_of(ROBOT, gripper)
        assert lengths is not None
        assert lengths.shoulder.tolist() == [-0.05, 0.188, 0.790675]
        assert (lengths.lift, lengths.upper, lengths.fore, lengths.hand) == (0.1, 0.4, 0.321, 0.18)
        assert lengths.raised_by == ("torso_lift_joint",)
    others = [load_robot(name) for name in robot_names() if name != "pr2"]
    assert not any(lengths_of(robot, gripper) for robot in others for gripper in robot.grippers)
