"""Whether an arm reaches a box: grasp poses and a bounded inverse kinematics."""

from collections.abc import Iterator
from itertools import product

import numpy as np

from guided_lgp.poses import Array, compose, inverse
from guided_lgp.scene import pr2
from guided_lgp.scene.model import GRIPPERS, Box, Scene

PITCHES = (np.pi / 2, np.pi / 3, np.pi / 4, np.pi / 6, 0.0)
"""Angles (rad) at which the gripper points down when it grasps: from above to from the side."""

_STEPS, _DAMPING, _TOLERANCE = 60, 1e-3, 1e-5
_STARTS = np.array(
    [
        [0.3, 0.3, 0.5, -1.5, 0.0, -1.0, 0.0],
        [0.3, 0.0, 1.5, -1.5, 1.0, -1.0, 1.5],
        [0.0, 0.8, 0.0, -1.0, 3.0, -1.0, 0.0],
        [1.0, 0.3, 1.0, -2.0, -1.5, -0.8, -1.5],
    ]
)


def grasp_poses(box: Box) -> Iterator[Array]:
    """Poses (7,) of the tool frame that grasp a box: pitch, side and turn of the hand.

    The fingers close across the narrower horizontal side, the palm's front touches the box.
    """
    across = pr2.grasp_axis(box.size)
    cosine, sine = np.cos(box.yaw), np.sin(box.yaw)
    axes = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0]])
    closing, along = axes[across], axes[1 - across]
    half = box.size[1 - across] / 2, box.size[2] / 2
    for pitch, side, turn in product(PITCHES, (1.0, -1.0), (1.0, -1.0)):
        approach = np.cos(pitch) * side * along - np.array([0.0, 0.0, np.sin(pitch)])
        depth = half[0] * abs(np.cos(pitch)) + half[1] * np.sin(pitch) + pr2.PALM_FRONT + 0.002
        frame = np.stack([approach, turn * closing, np.cross(approach, turn * closing)], axis=1)
        yield np.concatenate([box.position - depth * approach, _quaternion(frame)])


def reachable(scene: Scene, box: Box, gripper: str) -> bool:
    """Whether the arm can put its tool frame to some grasp pose of the box, collisions aside."""
    return any(
        solve_arm(scene, gripper, target, start * _signs(gripper)) is not None
        for target in grasp_poses(box)
        for start in _STARTS
    )


def reachable_by_any(scene: Scene, box: Box) -> bool:
    """Whether one of the arms reaches the box."""
    return any(reachable(scene, box, gripper) for gripper in GRIPPERS)


def solve_arm(scene: Scene, gripper: str, target: Array, start: Array) -> Array | None:
    """Joint values (7,) that put the tool frame to a pose (7,), or None.

    Damped Gauss-Newton on the pose error, joints clipped to their limits; at most 60 steps.
    """
    import pinocchio

    model, data, joints, torso = pr2.kinematics()
    arm = pr2.arm_slice(gripper)
    indices, limits = joints[arm], pr2.JOINT_LIMITS[arm]
    columns = [index.velocity for index in indices]
    frame = model.getFrameId(pr2.TOOL_LINK[gripper])
    goal = pinocchio.XYZQUATToSE3(compose(inverse(pr2.base_pose(scene)), target))
    full, angles = pinocchio.neutral(model), np.array(start, float)
    full[torso] = scene.robot.torso
    for _ in range(_STEPS):
        pr2.fill(full, indices, angles)
        pinocchio.computeJointJacobians(model, data, full)
        placement = pinocchio.updateFramePlacement(model, data, frame)
        error = np.asarray(pinocchio.log6(placement.actInv(goal)).vector)
        if np.linalg.norm(error) < _TOLERANCE:
            return angles
        local = pinocchio.getFrameJacobian(model, data, frame, pinocchio.ReferenceFrame.LOCAL)
        jacobian = local[:, columns]
        damped = jacobian @ jacobian.T + _DAMPING * (0.01 + error @ error) * np.eye(6)
        angles = np.clip(
            angles + jacobian.T @ np.linalg.solve(damped, error), limits[:, 0], limits[:, 1]
        )
    return None


def _signs(gripper: str) -> Array:
    return np.ones(7) if gripper == "pr2L" else pr2.MIRROR


def _quaternion(frame: Array) -> Array:
    import pinocchio

    return np.asarray(pinocchio.Quaternion(frame).coeffs(), dtype=float)
