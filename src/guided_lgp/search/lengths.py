"""What is farther away than an arm is long, whatever arm it is."""

import math

import numpy as np

from guided_lgp.poses import Array, rotation_matrix
from guided_lgp.robots.inverse import inverse_kinematics
from guided_lgp.scene import Box, Scene, Table
from guided_lgp.scene.footprints import inset, seat
from guided_lgp.scene.tolerances import MARGIN

_UPRIGHT = 1e-6
"""Sine of a tilt that leaves an axis upright."""


def too_far(scene: Scene, gripper: str, box: Box, support: Table | Box | None = None) -> bool:
    """Whether an arm is too short for a box at its start, or anywhere on a support.

    Its first joint turns about an upright axis, from which its fingertips are never farther than
    its lever; they are at a side of the box. Nothing is known of other arms, nor where the scene
    gives the grasps.
    """
    axis = _upright_axis(scene, gripper)
    if axis is None or box.grasps:
        return False
    if support is None:
        away = float(np.hypot(*(np.array(box.position[:2]) - axis)))
    else:
        beyond = math.hypot(*box.convex.half[:2]) if len(scene.movable) > 1 else 0.0
        away = -float(inset(seat(support), axis)) - beyond  # a counterweight may shift it
    lever = float(scene.robot.description.arms[gripper].lever_arms[0])
    return away > lever + math.hypot(*box.convex.half) + MARGIN


def _upright_axis(scene: Scene, gripper: str) -> Array | None:
    """Where an arm's first axis is, seen from above (2,), if it is upright."""
    robot = scene.robot
    chain = inverse_kinematics(robot.description, gripper, robot.fixed_values).chain
    turn = rotation_matrix(robot.base_pose[3:])
    if math.hypot(*(turn @ chain.axes[0])[:2]) > _UPRIGHT:
        return None
    return np.asarray((robot.base_pose[:3] + turn @ chain.points[0])[:2])
