"""Chains of joints against pinocchio."""

import numpy as np
import pinocchio as pin
import pytest
from descriptions import ARMS, ArmDescription

from guided_lgp.errors import InputError
from guided_lgp.robots.chain import read_chain


def pinocchio_configuration(model: pin.Model, joints: list[str], q: np.ndarray) -> np.ndarray:
    full = pin.neutral(model)
    for name, value in zip(joints, q, strict=True):
        joint = model.joints[model.getJointId(name)]
        if joint.nq == 2:
            full[joint.idx_q : joint.idx_q + 2] = np.cos(value), np.sin(value)
        else:
            full[joint.idx_q] = value
    return full


@pytest.mark.parametrize("arm", ARMS.values(), ids=ARMS)
def test_forward_kinematics_and_jacobian_agree_with_pinocchio(arm: ArmDescription) -> None:
    model = pin.buildModelFromUrdf(str(arm.urdf))
    data = model.createData()
    root, tip = model.getFrameId(arm.root), model.getFrameId(arm.tip)
    columns = [model.joints[model.getJointId(name)].idx_v for name in arm.joints]
    rng = np.random.default_rng(0)
    for q in rng.uniform(-2, 2, (20, len(arm.joints))):
        full = pinocchio_configuration(model, arm.joints, q)
        pin.computeJointJacobians(model, data, full)
        pin.updateFramePlacements(model, data)
        base = data.oMf[root]
        expected = base.actInv(data.oMf[tip])
        rotation, position, jacobian = arm.chain.jacobian(q)
        np.testing.assert_allclose(rotation, expected.rotation, atol=1e-9)
        np.testing.assert_allclose(position, expected.translation, atol=1e-9)
        aligned = pin.getFrameJacobian(model, data, tip, pin.LOCAL_WORLD_ALIGNED)[:, columns]
        turn = np.kron(np.eye(2), base.rotation.T)
        np.testing.assert_allclose(jacobian, turn @ aligned, atol=1e-9)


def test_other_joints_keep_their_values() -> None:
    arm = ARMS["tiago"]
    low = read_chain(arm.urdf, arm.root, arm.tip, arm.joints)
    high = read_chain(arm.urdf, arm.root, arm.tip, arm.joints, {"torso_lift_joint": 0.2})
    np.testing.assert_allclose(high.position - low.position, [0, 0, 0.2])
    np.testing.assert_allclose(high.points - low.points, np.tile([0, 0, 0.2], (7, 1)))


def test_a_tool_frame_is_fixed_to_the_last_link() -> None:
    chain = ARMS["panda"].chain
    turn, shift = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]]), np.array([0.1, 0, 0.2])
    q = np.linspace(-1, 1, 7)
    rotation, position = chain.forward(q)
    turned, moved = chain.extended(turn, shift).forward(q)
    np.testing.assert_allclose(turned, rotation @ turn, atol=1e-12)
    np.testing.assert_allclose(moved, position + rotation @ shift, atol=1e-12)


def test_links_and_joints_that_do_not_fit_are_named() -> None:
    arm = ARMS["panda"]
    with pytest.raises(InputError, match="nowhere does not hang on link panda_link0"):
        read_chain(arm.urdf, arm.root, "nowhere", arm.joints)
    with pytest.raises(InputError, match="panda_joint1, panda_joint2"):
        read_chain(arm.urdf, arm.root, arm.tip, ["panda_joint2", "panda_joint1"])
