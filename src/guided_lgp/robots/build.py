"""A robot from its file: the file's values, and what the description says besides."""

from pathlib import Path

import numpy as np

from guided_lgp.errors import InputError
from guided_lgp.poses import Array, quaternion
from guided_lgp.robots.description import Description, find_description
from guided_lgp.robots.document import ArmDocument, RobotDocument, ToolDocument, read_document
from guided_lgp.robots.robot import Arm, Fingers, Gap, Robot, Sphere

_TWO_TURNS = (-2 * np.pi, 2 * np.pi)


def read_robot(file: Path) -> Robot:
    """Read a robot file and check it against the description that it names.

    Raises:
        InputError: the first fault, with file and field.
    """
    document = read_document(file)
    description = find_description(file, document.description)
    _check(document, description)
    arms, joint, finger = {}, 0, sum(len(arm.joints) for arm in document.arms.values())
    for gripper, arm in document.arms.items():
        arms[gripper] = _arm(gripper, arm, description, document.acceleration, joint, finger)
        joint += len(arm.joints)
        finger += len(arm.fingers.joints)
    return Robot(file.stem, description, document.base_link, document.fixed_joints, arms)


def _check(document: RobotDocument, description: Description) -> None:
    """That the description has what the file names."""
    description.require_links("base_link", document.base_link)
    if document.base_link in description.parents:
        (root,) = set(description.links) - description.parents.keys()
        fault = f"{document.base_link} is not the root of the URDF"
        raise InputError(f"{description.where}: base_link", fault, root)
    for name, fixed in document.fixed_joints.items():
        description.require_joints(f"fixed_joints.{name}", fixed.joint)
    for gripper, arm in document.arms.items():
        where = f"arms.{gripper}"
        description.require_joints(f"{where}.joints", *arm.joints)
        description.require_joints(f"{where}.fingers.joints", *arm.fingers.joints)
        description.require_links(f"{where}.tool.link", arm.tool.link)
        description.require_links(f"{where}.hand_links", *arm.hand_links)
        description.require_links(f"{where}.segments.ends", *arm.segments.ends)
        description.require_links(f"{where}.spheres", *arm.spheres)
    _ = description.disabled_pairs


def _arm(
    gripper: str,
    arm: ArmDocument,
    description: Description,
    acceleration: float,
    joint: int,
    finger: int,
) -> Arm:
    joints = [description.joints[name] for name in arm.joints]
    signs = np.array(arm.signs or np.ones(len(joints)), float)
    velocity = np.array([joint.velocity for joint in joints])
    moved = description.solid_links_below(arm.joints[0])
    return Arm(
        gripper=gripper,
        joints=arm.joints,
        slice=slice(joint, joint + len(joints)),
        home=signs * np.array(arm.home),
        limits=np.array([joint.limits or _TWO_TURNS for joint in joints]),
        velocity_limits=velocity,
        acceleration_limits=acceleration * velocity,
        redundant=None if arm.redundant is None else arm.joints.index(arm.redundant),
        mirror_of=arm.mirrors,
        signs=signs,
        tool_link=arm.tool.link,
        tool_in_link=_tool_in_link(arm.tool, description.where, gripper),
        palm_front=arm.tool.palm_front,
        links=tuple(link for link in moved if link not in arm.hand_links),
        hand_links=arm.hand_links,
        hand_radius=arm.hand_radius,
        segment_ends=arm.segments.ends,
        segment_radius=arm.segments.radius,
        lever_arms=np.array(arm.lever_arms),
        reaches=np.array(arm.reaches),
        spheres=_spheres(arm),
        spheres_between_arms=arm.spheres_between_arms,
        fingers=_fingers(arm, description, finger),
    )


def _fingers(arm: ArmDocument, description: Description, first: int) -> Fingers:
    stated = arm.fingers
    joints = [description.joints[name] for name in stated.joints]
    lower, upper = joints[0].limits or _TWO_TURNS
    return Fingers(
        joints=stated.joints,
        ratios=np.array([joint.mimic for joint in joints]),
        slice=slice(first, first + len(joints)),
        lower=lower,
        upper=upper,
        velocity=joints[0].velocity,
        lever=stated.lever,
        grasp_width=stated.grasp_width,
        gap=Gap(stated.gap.sine, stated.gap.cosine, stated.gap.offset),
    )


def _spheres(arm: ArmDocument) -> tuple[Sphere, ...]:
    side = 1.0 if arm.mirrors is None else -1.0
    return tuple(
        Sphere(link, (x, side * y, z), radius)
        for link, spheres in arm.spheres.items()
        for x, y, z, radius in spheres
    )


def _tool_in_link(tool: ToolDocument, where: str, gripper: str) -> Array:
    """Pose (7,) of the frame whose x axis is the approach and whose y axis the closing."""
    x, y = _axis(tool.approach), _axis(tool.closing)
    if x @ y:
        field = f"{where}: arms.{gripper}.tool.closing"
        raise InputError(field, f"{tool.closing} is along the approach", "another axis")
    matrix = np.stack([x, y, np.cross(x, y)], axis=1)
    return np.concatenate([tool.offset, quaternion(matrix)])


def _axis(name: str) -> Array:
    sign = -1.0 if name.startswith("-") else 1.0
    return np.asarray(sign * np.eye(3)["xyz".index(name[-1])])
