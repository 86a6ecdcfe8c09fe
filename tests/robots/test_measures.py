"""What is measured on whole arms, against pinocchio and the numbers known for the PR2."""

import numpy as np
import pinocchio as pin
import pytest
from descriptions import ARMS, ArmDescription

from guided_lgp.robots.chain import read_joints
from guided_lgp.robots.measures.arm import ArmMeasures
from guided_lgp.robots.measures.hulls import link_hulls

_FROM_Z = np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]])
_HANDS = {
    "panda": (
        _FROM_Z,
        ("panda_hand", "panda_leftfinger", "panda_rightfinger"),
        {"panda_finger_joint1": 1.0, "panda_finger_joint2": 1.0},
        (0.0, 0.04),
    ),
    "pr2, left": (
        np.eye(3),
        tuple(
            f"l_gripper_{link}_link"
            for link in ("palm", "l_finger", "r_finger", "l_finger_tip", "r_finger_tip")
        ),
        {
            f"l_gripper_{joint}_joint": 1.0
            for joint in ("l_finger", "r_finger", "l_finger_tip", "r_finger_tip")
        },
        (0.0, 0.548),
    ),
}


def below(arm: ArmDescription) -> list[str]:
    """Links with collision geometry that the arm's first joint moves."""
    joints, first = read_joints(arm.urdf), arm.joints[0]
    found = []
    for link in link_hulls(arm.urdf):
        above = link
        while above in joints and joints[above].name != first:
            above = joints[above].parent
        if above in joints:
            found.append(link)
    return found


def measures(name: str) -> ArmMeasures:
    arm, (rotation, hand, fingers, limits) = ARMS[name], _HANDS[name]
    return ArmMeasures(
        where="arm",
        urdf=arm.urdf,
        root=arm.root,
        joints=tuple(arm.joints),
        tool=(arm.tip, rotation, np.zeros(3)),
        links=tuple(link for link in below(arm) if link not in hand),
        hand_links=hand,
        fingers=fingers,
        finger_limits=limits,
    )


@pytest.mark.parametrize("name", _HANDS)
def test_spheres_cover_arm_and_open_hand(name: str) -> None:
    arm, measured = ARMS[name], measures(name)
    model = pin.buildModelFromUrdf(str(arm.urdf))
    pin.seed(0)
    data, q = model.createData(), pin.randomConfiguration(model)
    for joint, ratio in measured.fingers.items():
        q[model.joints[model.getJointId(joint)].idx_q] = ratio * measured.hand.opened
    pin.framesForwardKinematics(model, data, q)
    place = {frame.name: data.oMf[i] for i, frame in enumerate(model.frames)}
    centres = np.concatenate(
        [
            [place[link].act(np.array(sphere[:3])) for sphere in spheres]
            for link, spheres in measured.spheres.items()
        ]
    )
    radii = np.array([row[3] for spheres in measured.spheres.values() for row in spheres])
    for link in below(arm):
        for vertices in link_hulls(arm.urdf)[link]:
            points = vertices @ place[link].rotation.T + place[link].translation
            beyond = np.linalg.norm(points[:, None] - centres, axis=-1) - radii
            assert beyond.min(axis=1).max() < 2e-4


@pytest.mark.parametrize("name", _HANDS)
def test_segments_bound_the_motion_of_the_links(name: str) -> None:
    arm, measured = ARMS[name], measures(name)
    model = pin.buildModelFromUrdf(str(arm.urdf))
    data = model.createData()
    frames = [model.getFrameId(link) for link in measured.segments.ends]
    links = [link for link in below(arm) if link not in measured.hand_links]

    def placements(q: np.ndarray) -> tuple[list[pin.SE3], np.ndarray]:
        pin.framesForwardKinematics(model, data, q)
        points = [
            vertices @ place.rotation.T + place.translation
            for link in links
            for place in [data.oMf[model.getFrameId(link)].copy()]
            for vertices in link_hulls(arm.urdf)[link]
        ]
        return [data.oMf[frame].copy() for frame in frames], np.concatenate(points)

    random = np.random.default_rng(0)
    pin.seed(0)
    columns = [model.joints[model.getJointId(name)].idx_v for name in arm.joints]
    for _ in range(50):
        q = pin.randomConfiguration(model)
        step = np.zeros(model.nv)
        step[columns] = random.uniform(-0.05, 0.05, len(columns))
        (before, start), (after, end) = placements(q), placements(pin.integrate(model, q, step))
        ways = [
            np.linalg.norm(b.translation - a.translation)
            + np.linalg.norm(pin.log3(a.rotation.T @ b.rotation)) * measured.segments.radius
            for a, b in zip(before, after, strict=True)
        ]
        assert np.linalg.norm(end - start, axis=1).max() <= max(ways) + 0.05 * 0.2


def test_the_pr2s_measures_are_nearly_those_known() -> None:
    measured = measures("pr2, left")
    known = [1.002, 0.902, 0.501, 0.501, 0.180, 0.180, 0.0]
    np.testing.assert_allclose(measured.lever_arms, known, atol=2e-3)
    assert measured.grasp_width == pytest.approx(0.085, abs=3e-3)
    assert measured.hand.radius == pytest.approx(0.09, abs=0.01)
    assert measured.hand.lever == pytest.approx(0.095, abs=0.005)
