"""A robot from its file: the file's values, and what the description says besides."""

import logging
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TypeVar

import numpy as np

from guided_lgp.errors import InputError
from guided_lgp.poses import Array, quaternion, rotation_matrix
from guided_lgp.robots.description import Description, find_description
from guided_lgp.robots.document import (
    ArmDocument,
    FingersDocument,
    RobotDocument,
    ToolDocument,
    read_document,
)
from guided_lgp.robots.measures.arm import ArmMeasures
from guided_lgp.robots.measures.mirror import mirror_of
from guided_lgp.robots.robot import Arm, Fingers, Gap, Robot, Sphere, TurningGap

_TWO_TURNS = (-2 * np.pi, 2 * np.pi)
_ACCELERATION = 2.0
"""Limits of acceleration over those of velocity (1/s) that no file states: full speed in half a
second."""
_MIRROR_ERROR = 1e-3
"""How far (m) the tools of two arms may be apart that are said to be mirror images."""

logger = logging.getLogger(__name__)

T = TypeVar("T")


def read_robot(file: Path) -> Robot:
    """Read a robot file and check it against the description that it names.

    Raises:
        InputError: the first fault, with file and field.
    """
    document = read_document(file)
    description = find_description(file, document.description)
    _check(document, description)
    _tell_defaults(document, description)
    arms, joint, finger = {}, 0, sum(len(arm.joints) for arm in document.arms.values())
    for gripper, arm in document.arms.items():
        arms[gripper] = _arm(gripper, arm, document, description, joint, finger)
        joint += len(arm.joints)
        finger += len(arm.fingers.joints)
    return Robot(
        name=file.stem,
        description=description,
        base_link=document.base_link,
        stand=document.stand,
        fixed_joints=document.fixed_joints,
        arms=arms,
        balanced=document.balanced,
    )


def _tell_defaults(document: RobotDocument, description: Description) -> None:
    """Say which limits nobody has stated, and what counts instead."""
    if document.acceleration is None:
        default = f"{_ACCELERATION} per s, times the velocity limits"
        logger.warning("%s: no acceleration is stated: %s", description.where, default)
    joints = [joint for arm in document.arms.values() for joint in arm.joints]
    unlimited = [joint for joint in joints if np.isinf(description.joints[joint].effort)]
    if unlimited:
        names = ", ".join(unlimited)
        logger.warning("%s: no effort limits: any effort of %s", description.where, names)


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
        description.require_chain(f"{where}.joints", arm.joints, arm.tool.link)
        description.require_links(f"{where}.hand_links", *arm.hand_links)
        if arm.segments is not None:
            description.require_links(f"{where}.segments.ends", *arm.segments.ends)
        description.require_links(f"{where}.spheres", *(arm.spheres or ()))
        _check_hand(where, arm, description)
    _check_joints(document, description)
    _ = description.disabled_pairs


def _check_hand(where: str, arm: ArmDocument, description: Description) -> None:
    """That the hand has all that its fingers move, and what they hang on."""
    for joint in arm.fingers.joints:
        palm = description.parents[description.children[joint]]
        for link in (palm, *description.solid_links_below(joint)):
            if link in description.solid_links and link not in arm.hand_links:
                field = f"{description.where}: {where}.hand_links"
                raise InputError(field, f"lack {link}, which {joint} moves or hangs on")


def _check_joints(document: RobotDocument, description: Description) -> None:
    """That every joint that moves a hand has one place in the file."""
    known = {fixed.joint: f"fixed_joints.{name}" for name, fixed in document.fixed_joints.items()}
    for gripper, arm in document.arms.items():
        for field, joints in (("joints", arm.joints), ("fingers.joints", arm.fingers.joints)):
            where = f"arms.{gripper}.{field}"
            for joint in joints:
                if known.setdefault(joint, where) != where:
                    fault = f"{joint} is in {known[joint]}, too"
                    raise InputError(f"{description.where}: {where}", fault, "a joint of its own")
    for gripper, arm in document.arms.items():
        description.require_known("fixed_joints", known, arm.tool.link)
        description.require_known(f"arms.{gripper}.fingers.joints", known, *arm.hand_links)


def _arm(
    gripper: str,
    arm: ArmDocument,
    robot: RobotDocument,
    description: Description,
    joint: int,
    finger: int,
) -> Arm:
    joints = [description.joints[name] for name in arm.joints]
    velocity = np.array([joint.velocity for joint in joints])
    acceleration = (robot.acceleration or _ACCELERATION) * velocity
    tool_in_link = _tool_in_link(arm.tool, description.where, gripper)
    measures = _measures(gripper, arm, robot, description, tool_in_link)
    segments = arm.segments or measures.segments
    spheres = _spheres(arm, measures)
    signs = _signs(gripper, arm, robot, description, measures)
    return Arm(
        gripper=gripper,
        joints=arm.joints,
        slice=slice(joint, joint + len(joints)),
        home=signs * np.array(arm.home),
        limits=np.array([joint.limits or _TWO_TURNS for joint in joints]),
        velocity_limits=velocity,
        acceleration_limits=acceleration,
        jerk_limits=robot.jerk * acceleration,
        effort_limits=np.array([joint.effort for joint in joints]),
        redundant=None if arm.redundant is None else arm.joints.index(arm.redundant),
        mirror_of=arm.mirrors,
        signs=signs,
        tool_link=arm.tool.link,
        tool_in_link=tool_in_link,
        palm_front=_stated(arm.tool.palm_front, lambda: measures.hand.palm_front),
        links=measures.links,
        hand_links=arm.hand_links,
        hand_radius=_stated(arm.hand_radius, lambda: measures.hand.radius),
        segment_ends=segments.ends,
        segment_radius=segments.radius,
        lever_arms=np.array(_stated(arm.lever_arms, lambda: measures.lever_arms)),
        metric=np.array(_stated(arm.metric, lambda: measures.metric)),
        spheres=spheres,
        spheres_between_arms=_stated(arm.spheres_between_arms, lambda: _largest(spheres)),
        fingers=_fingers(arm.fingers, measures, description, finger),
    )


def _stated(value: T | None, derived: Callable[[], T]) -> T:
    """What the file states, or else what the description tells."""
    return derived() if value is None else value


def _measures(
    gripper: str,
    arm: ArmDocument,
    robot: RobotDocument,
    description: Description,
    tool_in_link: Array,
) -> ArmMeasures:
    moved = description.solid_links_below(arm.joints[0])
    return ArmMeasures(
        where=f"{description.where}: arms.{gripper}",
        urdf=description.urdf,
        root=robot.base_link,
        joints=arm.joints,
        tool=(arm.tool.link, rotation_matrix(tool_in_link[3:]), tool_in_link[:3]),
        links=tuple(link for link in moved if link not in arm.hand_links),
        hand_links=arm.hand_links,
        fingers=_ratios(arm.fingers, description),
        finger_limits=_finger_limits(arm.fingers, description),
    )


def _signs(
    gripper: str,
    arm: ArmDocument,
    robot: RobotDocument,
    description: Description,
    measures: ArmMeasures,
) -> Array:
    """Signs of the joints towards the mirrored arm: stated, or found where the arms agree."""
    if arm.mirrors is None:
        return np.ones(len(arm.joints))
    if arm.signs:
        return np.array(arm.signs, float)
    original = robot.arms[arm.mirrors]
    tool = _tool_in_link(original.tool, description.where, arm.mirrors)
    mirrored = _measures(arm.mirrors, original, robot, description, tool)
    mirror = mirror_of(mirrored.chain, measures.chain)
    if mirror is None or mirror.error > _MIRROR_ERROR:
        where = f"{description.where}: arms.{gripper}.mirrors"
        raise InputError(where, f"is no mirror image of {arm.mirrors}", "an arm of its own")
    return mirror.signs


def _ratios(fingers: FingersDocument, description: Description) -> dict[str, float]:
    mimics = [description.joints[name].mimic for name in fingers.joints]
    return dict(zip(fingers.joints, fingers.ratios or mimics, strict=True))


def _finger_limits(fingers: FingersDocument, description: Description) -> tuple[float, float]:
    if not fingers.joints:
        return 0.0, 0.0
    return description.joints[fingers.joints[0]].limits or _TWO_TURNS


def _fingers(
    stated: FingersDocument, measures: ArmMeasures, description: Description, first: int
) -> Fingers:
    lower, upper = measures.finger_limits
    gap: Gap = measures.hand if stated.gap is None else TurningGap(**stated.gap.model_dump())
    velocities = [description.joints[name].velocity for name in stated.joints]
    return Fingers(
        joints=stated.joints,
        ratios=np.array(list(measures.fingers.values())),
        slice=slice(first, first + len(stated.joints)),
        lower=lower,
        upper=upper,
        velocity=velocities[0] if velocities else np.inf,
        lever=_stated(stated.lever, lambda: measures.hand.lever),
        grasp_width=_stated(stated.grasp_width, lambda: measures.grasp_width),
        force=stated.force,
        pad=stated.pad,
        gap=gap,
    )


def _largest(spheres: Sequence[Sphere]) -> tuple[int, ...]:
    """The largest sphere of every link."""
    largest = {
        sphere.link: number
        for number, sphere in sorted(enumerate(spheres), key=lambda entry: entry[1].radius)
    }
    return tuple(sorted(largest.values()))


def _spheres(arm: ArmDocument, measures: ArmMeasures) -> tuple[Sphere, ...]:
    stated = arm.spheres
    side = -1.0 if arm.mirrors is not None and stated is not None else 1.0
    return tuple(
        Sphere(link, (x, side * y, z), radius)
        for link, spheres in (measures.spheres if stated is None else stated).items()
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
