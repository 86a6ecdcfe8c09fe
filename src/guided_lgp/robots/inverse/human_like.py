"""Arms built like a human's, as the PR2's are: what makes one, and its lengths.

Such an arm turns about z, y, x (shoulder), y (elbow), x, y, x (wrist), with all offsets along x.
Its inverse kinematics has formulas, with the turn about z as the seventh degree of freedom:
``offset_shoulder.py`` evaluates them for many poses, ``bounds/program/closed_form.py`` states them
in CasADi, and there gives the nearest values, too, where there is no solution.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from guided_lgp.poses import Array, rotation_matrix
from guided_lgp.robots.chain import Joint, path_between, read_joints
from guided_lgp.robots.robot import Robot

AXES = np.eye(3)[[2, 1, 0, 1, 0, 1, 0]]
"""(7, 3) about which the joints turn."""
_OFFSETS = np.zeros((8, 3), dtype=bool)
_OFFSETS[0], _OFFSETS[[1, 3, 5, 7], 0] = True, True
"""Where such a chain has offsets: before shoulder, lift, elbow and wrist, and to the tool frame."""
_BENT, _TURNING = [3, 5], [4, 6]
"""Elbow and wrist, which the formulas bend one way, and the rolls, which they leave unlimited."""


@dataclass(frozen=True)
class HumanLike:
    """Lengths (m) of such an arm."""

    shoulder: Array
    """(3,) the first axis in the robot's frame, with the joints that the scene sets at zero."""
    lift: float
    """From the first axis to the second."""
    upper: float
    """From there to the elbow."""
    fore: float
    """From the elbow to the wrist."""
    hand: float
    """From the wrist to the tool frame."""
    raised_by: tuple[str, ...]
    """The joints set by the scene that raise the shoulder."""


def human_like(
    joints: Sequence[Joint],
    moving: Collection[str],
    fixed: Collection[str],
    tool: tuple[Array, Array],
) -> HumanLike | None:
    """The lengths of a chain, or None if it is built otherwise.

    Args:
        joints: from the robot's frame to the last link.
        moving: names of those of the arm.
        fixed: names of those that the scene sets.
        tool: rotation (3, 3) and position (3,) of the tool frame in the last link.
    """
    rotations = [*(joint.rotation for joint in joints), tool[0]]
    axes = [joint.axis for joint in joints if joint.name in moving]
    if not np.array_equal(axes, AXES) or any(np.any(r != np.eye(3)) for r in rotations):
        return None
    first = next(i for i, joint in enumerate(joints) if joint.name in moving)
    set_by_scene = [i for i, joint in enumerate(joints) if joint.name in fixed]
    if any(i > first or not _raises(joints[i]) for i in set_by_scene):
        return None
    offsets = _offsets(joints, moving, tool[1])
    if np.any(offsets[~_OFFSETS]):
        return None
    lift, upper, fore, hand = (float(offsets[i, 0]) for i in (1, 3, 5, 7))
    raised_by = tuple(joints[i].name for i in set_by_scene)
    return HumanLike(offsets[0], lift, upper, fore, hand, raised_by)


def _raises(joint: Joint) -> bool:
    return joint.kind == "prismatic" and np.array_equal(joint.axis, (0.0, 0.0, 1.0))


def _offsets(joints: Sequence[Joint], moving: Collection[str], tool: Array) -> Array:
    """(n + 1, 3) m: to each moving joint from the one before, and to the tool frame."""
    offsets = [np.zeros(3)]
    for joint in joints:
        offsets[-1] = offsets[-1] + joint.position
        if joint.name in moving:
            offsets.append(np.zeros(3))
    offsets[-1] = offsets[-1] + tool
    return np.array(offsets)


@cache
def lengths_of(robot: Robot, gripper: str) -> HumanLike | None:
    """The lengths of an arm that the formulas solve, of its mirror image for a mirrored one.

    None if it is built otherwise, or if its limits or its redundant joint are not the formulas'.
    """
    arm = robot.arms[robot.arms[gripper].mirror_of or gripper]
    fixed = [joint.joint for joint in robot.fixed_joints.values()]
    joints = path_between(read_joints(robot.urdf), robot.base_link, arm.tool_link)
    tool = rotation_matrix(arm.tool_in_link[3:]), arm.tool_in_link[:3]
    lengths = human_like(joints, arm.joints, fixed, tool)
    if lengths is None or arm.redundant != 0:
        return None
    bent_one_way = np.all(arm.limits[_BENT, 1] <= 0)
    free_to_roll = np.all(np.ptp(arm.limits[_TURNING], axis=1) >= 2 * np.pi)
    return lengths if bent_one_way and free_to_roll else None
