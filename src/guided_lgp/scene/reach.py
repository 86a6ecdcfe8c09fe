"""Whether an arm reaches a box: grasp poses and inverse kinematics."""

from itertools import product

import numpy as np

from guided_lgp.poses import Array, compose, inverse, quaternion, rotation_matrix
from guided_lgp.robots.chain import read_chain
from guided_lgp.robots.inverse import InverseKinematics
from guided_lgp.scene.model import Box, Scene, grasp_axis

PITCHES = (np.pi / 2, np.pi / 3, np.pi / 4, np.pi / 6, 0.0)
"""Angles (rad) at which the gripper points down when it grasps: from above to from the side."""

PALM_GAP = 0.002
"""Distance of the box's nearest corner from the palm (m)."""

_REDUNDANT_VALUES = 24
"""How many values of a redundant joint are tried, spread over its range."""


def grasp_poses(box: Box, palm_front: float) -> Array:
    """Poses (n, 7) of the tool frame that grasp a box: pitch, side and turn of the hand.

    The fingers close across the narrower horizontal side, the palm's front touches the box.

    Args:
        box: where it stands.
        palm_front: x of the palm's front in the tool frame (m).
    """
    across = grasp_axis(box.size)
    cosine, sine = np.cos(box.yaw), np.sin(box.yaw)
    axes = np.array([[cosine, sine, 0.0], [-sine, cosine, 0.0]])
    closing, along = axes[across], axes[1 - across]
    half = box.size[1 - across] / 2, box.size[2] / 2
    poses = []
    for pitch, side, turn in product(PITCHES, (1.0, -1.0), (1.0, -1.0)):
        approach = np.cos(pitch) * side * along - np.array([0.0, 0.0, np.sin(pitch)])
        depth = half[0] * abs(np.cos(pitch)) + half[1] * np.sin(pitch) + palm_front + PALM_GAP
        frame = np.stack([approach, turn * closing, np.cross(approach, turn * closing)], axis=1)
        poses.append(np.concatenate([box.position - depth * approach, quaternion(frame)]))
    return np.array(poses)


def reachable(scene: Scene, box: Box, gripper: str) -> bool:
    """Whether the arm can put its tool frame to some grasp pose of the box, collisions aside."""
    robot = scene.robot.description
    arm = robot.arms[gripper]
    chain = read_chain(
        robot.urdf, robot.base_link, arm.tool_link, arm.joints, scene.robot.fixed_values
    )
    solver = InverseKinematics(chain, arm.limits, arm.redundant, arm.home)
    tools = compose(inverse(scene.robot.base_pose), grasp_poses(box, arm.palm_front))
    links = compose(tools, inverse(arm.tool_in_link))
    values = np.zeros(1)
    if arm.redundant is not None:
        low, high = arm.limits[arm.redundant].tolist()
        values = np.linspace(low, high, _REDUNDANT_VALUES)
    _, valid = solver.inverse(rotation_matrix(links[:, None, 3:]), links[:, None, :3], values)
    return bool(valid.any())


def reachable_by_any(scene: Scene, box: Box) -> bool:
    """Whether one of the arms reaches the box."""
    return any(reachable(scene, box, gripper) for gripper in scene.robot.description.arms)
