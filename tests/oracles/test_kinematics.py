"""The arm's kinematics in CasADi against pinocchio on the same URDF, and against themselves."""

import casadi as ca
import numpy as np
import pytest

from guided_lgp.bounds.program.closed_form import inverse
from guided_lgp.bounds.program.kinematics import kinematics_of
from guided_lgp.poses import apply, rotation_matrix
from guided_lgp.poses import inverse as inverse_pose
from guided_lgp.robots import load_robot
from guided_lgp.scene import Box, PlacedRobot, Scene, Table

TORSO = 0.21
SCENE = Scene(
    robot=PlacedRobot(torso=TORSO),
    tables=(Table(name="tab1", position=(0.5, 0.0, 0.6), half_extents=(0.2, 0.2)),),
    boxes=(Box(name="red", size=(0.1, 0.07, 0.1), position=(0.5, 0, 0.65), on="tab1"),),
)


PR2 = load_robot("pr2")
(CHAIN,) = kinematics_of(PR2).chains
LENGTHS = CHAIN.human_like


def _forward() -> ca.Function:
    q, side, torso = ca.SX.sym("q", 7), ca.SX.sym("side"), ca.SX.sym("torso")
    arm = CHAIN.pose(q, side, torso)
    return ca.Function("forward", [q, side, torso], [arm.position, arm.rotation, arm.spheres])


@pytest.mark.parametrize("gripper", PR2.grippers)
def test_forward_kinematics_agree_with_pinocchio(gripper: str) -> None:
    rng, forward = np.random.default_rng(0), _forward()
    side = 1.0 if gripper == "pr2L" else -1.0
    q = np.zeros(14)
    for joints in rng.uniform(*PR2.arms["pr2L"].limits.T, size=(50, 7)):
        q[PR2.arms[gripper].slice] = PR2.arms[gripper].signs * joints
        position, rotation, spheres = (np.array(part) for part in forward(joints, side, TORSO))
        expected = SCENE.robot.tool_pose(q, gripper)
        assert np.abs(position.ravel() - expected[:3]).max() < 1e-9
        assert np.abs(rotation - rotation_matrix(expected[3:])).max() < 1e-9
        for sphere, centre in zip(CHAIN.spheres, spheres.T, strict=True):
            link = gripper[-1].lower() + sphere.link[1:]
            local = apply(inverse_pose(SCENE.robot.link_poses(q[None], (link,))[0, 0]), centre)
            assert np.abs(local - np.array(sphere.centre) * (1, side, 1)).max() < 1e-9


def test_closed_form_inverse_kinematics_invert_the_forward_ones() -> None:
    rng, forward = np.random.default_rng(1), _forward()
    position, rotation = ca.SX.sym("p", 3), ca.SX.sym("R", 3, 3)
    pan, branch, side = ca.SX.sym("pan"), ca.SX.sym("branch"), ca.SX.sym("side")
    closed_form = ca.Function(
        "inverse",
        [position, rotation, pan, branch, side],
        [inverse(LENGTHS, position, rotation, pan, branch, side, TORSO)],
    )
    for joints in rng.uniform(*PR2.arms["pr2L"].limits.T, size=(100, 7)):
        for hand in (1.0, -1.0):
            target = [np.array(part) for part in forward(joints, hand, TORSO)[:2]]
            found = []
            for way in (1.0, -1.0):
                answer = np.array(closed_form(*target, joints[0], way, hand)).ravel()
                assert answer[7] == pytest.approx(0.0, abs=1e-6)
                reached = [np.array(part) for part in forward(answer[:7], hand, TORSO)[:2]]
                assert np.abs(reached[0] - target[0]).max() < 1e-6
                assert np.abs(reached[1] - target[1]).max() < 1e-6
                found.append(np.abs(np.sin((answer[:7] - joints) / 2)).max())
            assert min(found) < 1e-5  # one branch gives back the joints


def test_a_target_out_of_reach_reports_the_missing_distance() -> None:
    eye = ca.SX(np.eye(3))
    x = ca.SX.sym("x")
    solution = inverse(LENGTHS, ca.vertcat(x, 0.188, 0.790675 + TORSO), eye, 0.0, 1.0, 1.0, TORSO)
    missing = ca.Function("missing", [x], [solution[7]])
    # shoulder at x = -0.05, then 0.1 + 0.4 + 0.321 + 0.18 m of arm
    assert float(missing(0.95)) == pytest.approx(0.0, abs=1e-9)
    assert float(missing(1.051)) == pytest.approx(0.1, abs=1e-9)
