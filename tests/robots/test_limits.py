"""Limits of joints against pinocchio."""

import numpy as np
import pinocchio as pin
import pytest
from descriptions import ARMS, ArmDescription, plain

from guided_lgp.errors import InputError
from guided_lgp.robots.limits import read_limits


@pytest.mark.parametrize("arm", ARMS.values(), ids=ARMS)
def test_limits_are_pinocchios(arm: ArmDescription) -> None:
    model = pin.buildModelFromUrdf(str(arm.urdf))
    limits = read_limits(arm.urdf, soft=False)
    for name in arm.joints:
        joint = model.joints[model.getJointId(name)]
        assert limits[name].continuous == (joint.nq == 2)
        assert limits[name].velocity == model.velocityLimit[joint.idx_v]
        if not limits[name].continuous:
            assert limits[name].lower == model.lowerPositionLimit[joint.idx_q]
            assert limits[name].upper == model.upperPositionLimit[joint.idx_q]


def test_soft_limits_are_narrower() -> None:
    urdf = plain("pr2_description/urdf/pr2.urdf")
    soft, hard = read_limits(urdf), read_limits(urdf, soft=False)
    assert (soft["l_shoulder_pan_joint"].lower, hard["l_shoulder_pan_joint"].lower) == (
        -0.564601836603,
        -0.714601836603,
    )
    assert np.isinf(soft["l_wrist_roll_joint"].upper)


def test_a_joint_without_limits_is_named(tmp_path) -> None:  # type: ignore[no-untyped-def]
    file = tmp_path / "robot.urdf"
    file.write_text('<robot name="r"><joint name="elbow" type="revolute"/></robot>')
    with pytest.raises(InputError, match="joint elbow has no limits"):
        read_limits(file)
