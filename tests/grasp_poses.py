"""Poses of a hand that grasps a box, by the definition of a grasp alone."""

from itertools import product

import numpy as np

from guided_lgp.poses import Array, quaternion
from guided_lgp.scene.bodies import Box

PITCHES = (np.pi / 2, np.pi / 3, np.pi / 4, np.pi / 6, 0.0)
"""Angles (rad) at which the gripper points down when it grasps: from above to from the side."""

PALM_GAP = 0.002
"""Distance of the box's nearest corner from the palm (m)."""


def grasp_poses(box: Box, palm_front: float) -> Array:
    """Poses (n, 7) of the tool frame that grasp a box: pitch, side and turn of the hand.

    The fingers close across the narrower horizontal side, the palm's front touches the box.

    Args:
        box: where it stands.
        palm_front: x of the palm's front in the tool frame (m).
    """
    across = 0 if box.size[0] < box.size[1] else 1
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
