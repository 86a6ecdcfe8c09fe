"""Measures of hands against PyBullet's distances."""

import numpy as np
import pybullet
import pytest
from descriptions import plain

from guided_lgp.errors import InputError
from guided_lgp.robots.chain import Array
from guided_lgp.robots.measures.hand import HandShape, measure_hand

_MARGIN = 0.0025
"""PyBullet's hulls are a millimetre thicker on every side."""
_FROM_Z = np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]])
"""Tool frame whose approach is the link's z and whose closing axis is the link's y."""
_PR2 = plain("pr2_description/urdf/pr2.urdf")
_PANDA = plain("panda_description/urdf/panda.urdf")
_PR2_FINGERS = [f"l_gripper_{j}_joint" for j in ("l_finger", "r_finger")]
_PR2_TIPS = [f"l_gripper_{j}_joint" for j in ("l_finger_tip", "r_finger_tip")]
_PR2_LINKS = [
    f"l_gripper_{link}_link"
    for link in ("palm", "l_finger", "r_finger", "l_finger_tip", "r_finger_tip")
]
_PANDA_JOINTS = ["panda_finger_joint1", "panda_finger_joint2"]


def pr2_hand() -> HandShape:
    return measure_hand(
        "arm",
        _PR2,
        ("l_gripper_tool_frame", np.eye(3), np.zeros(3)),
        _PR2_LINKS,
        dict.fromkeys([*_PR2_FINGERS, *_PR2_TIPS], 1.0),
        (0.0, 0.548),
    )


def panda_hand() -> HandShape:
    return measure_hand(
        "arm",
        _PANDA,
        ("panda_hand_tcp", _FROM_Z, np.zeros(3)),
        ["panda_hand", "panda_leftfinger", "panda_rightfinger"],
        dict.fromkeys(_PANDA_JOINTS, 1.0),
        (0.0, 0.04),
    )


def bullet_gaps(urdf: str, joints: list[str], tips: list[str], values: Array) -> list[float]:
    """Distances (m) between two links at values of the finger joints."""
    client = pybullet.connect(pybullet.DIRECT)
    try:
        robot = pybullet.loadURDF(urdf, useFixedBase=True, physicsClientId=client)
        info = [
            pybullet.getJointInfo(robot, i, physicsClientId=client)
            for i in range(pybullet.getNumJoints(robot, physicsClientId=client))
        ]
        index = {entry[1].decode(): entry[0] for entry in info}
        gaps = []
        for value in values:
            for joint in joints:
                pybullet.resetJointState(robot, index[joint], value, physicsClientId=client)
            first, second = (index[tip] for tip in tips)
            points = pybullet.getClosestPoints(
                robot, robot, 1.0, first, second, physicsClientId=client
            )
            gaps.append(min(point[8] for point in points))
        return gaps
    finally:
        pybullet.disconnect(client)


def test_gaps_are_pybullets() -> None:
    values = np.array([0.2, 0.4, 0.548])
    joints = [*_PR2_FINGERS, *_PR2_TIPS]
    expected = bullet_gaps(str(_PR2), joints, _PR2_TIPS, values)
    np.testing.assert_allclose([pr2_hand().gap(v) for v in values], expected, atol=_MARGIN)
    values = np.array([0.01, 0.03, 0.04])
    expected = bullet_gaps(str(_PANDA), _PANDA_JOINTS, _PANDA_JOINTS, values)
    np.testing.assert_allclose([panda_hand().gap(v) for v in values], expected, atol=_MARGIN)


def test_fingers_open_as_far_as_asked() -> None:
    for hand in (pr2_hand(), panda_hand()):
        for gap in (0.02, 0.05, 0.07):
            assert hand.gap(hand.value(gap)) == pytest.approx(gap, abs=1e-6)
        assert hand.value(1.0) == hand.values[-1]
        assert hand.value(-1.0) == hand.values[0]


def test_palms_are_where_the_descriptions_say() -> None:
    assert pr2_hand().palm_front == pytest.approx(-0.0546, abs=1e-3)
    assert panda_hand().palm_front == pytest.approx(0.0659 - 0.1034, abs=1e-3)


def test_jaws_that_do_not_move_have_one_gap() -> None:
    urdf = plain("ur_description/urdf/ur5_gripper.urdf")
    axes = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])  # approach z, closing x
    hand = measure_hand(
        "arm", urdf, ("tool0", axes, np.array([0, 0, 0.055])), ["tool0"], {}, (0.0, 0.0)
    )
    assert hand.gap(0.0) == pytest.approx(0.055)
    assert hand.palm_front == pytest.approx(0.0125 - 0.055)


def test_a_hand_without_fingers_is_refused() -> None:
    tool = ("panda_hand_tcp", _FROM_Z, np.zeros(3))
    with pytest.raises(InputError, match=r"arm.hand_links: panda_hand"):
        measure_hand("arm", _PANDA, tool, ["panda_hand"], {}, (0.0, 0.0))
