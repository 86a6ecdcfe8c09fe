"""Kinematics of one PR2 arm in CasADi: forward, the spheres around its links, and inverse.

Everything here is about the left arm in the robot's frame (``base_footprint``, on the floor). The
right arm is its mirror image: mirrored joint values (``guided_lgp.scene.pr2.MIRROR``) go in, and
``side`` = -1 turns the result over at the plane y = 0.
"""

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np

from guided_lgp.bounds.results import Array
from guided_lgp.scene import pr2

_ROOT = "base_footprint"
_ARM = pr2.ARM_JOINTS[:7]
_TORSO = "torso_lift_joint"


@dataclass(frozen=True)
class Sphere:
    """A sphere that covers part of a link: centre in the link's frame and radius (m)."""

    link: str
    centre: tuple[float, float, float]
    radius: float


SPHERES: tuple[Sphere, ...] = (
    Sphere("l_shoulder_pan_link", (0.13, -0.02, 0.0), 0.11),
    Sphere("l_upper_arm_link", (0.2, 0.0, 0.0), 0.08),
    Sphere("l_elbow_flex_link", (0.0, 0.0, 0.0), 0.085),
    Sphere("l_forearm_link", (0.15, 0.0, 0.0), 0.08),
    Sphere("l_forearm_link", (0.24, 0.0, -0.01), 0.068),
    Sphere("l_forearm_link", (0.325, 0.025, -0.005), 0.047),
    Sphere("l_forearm_link", (0.325, -0.025, -0.005), 0.047),
    Sphere("l_gripper_palm_link", (0.085, 0.025, 0.0), 0.036),
    Sphere("l_gripper_palm_link", (0.085, -0.025, 0.0), 0.036),
    Sphere("l_gripper_palm_link", (0.105, 0.058, 0.0), 0.034),
    Sphere("l_gripper_palm_link", (0.105, -0.058, 0.0), 0.034),
    Sphere("l_gripper_palm_link", (0.137, 0.068, 0.0), 0.027),
    Sphere("l_gripper_palm_link", (0.137, -0.068, 0.0), 0.027),
    Sphere("l_gripper_palm_link", (0.168, 0.065, 0.0), 0.018),
    Sphere("l_gripper_palm_link", (0.168, -0.065, 0.0), 0.018),
)
"""Shoulder, upper arm, elbow, forearm, wrist, palm and the two open fingers."""

COARSE_SPHERES: tuple[int, ...] = (0, 1, 2, 3, 4, 5, 6, 7, 8, 13, 14)
"""The spheres that stand for an arm against the other arm."""


@dataclass(frozen=True)
class Joint:
    """A joint of the chain: fixed transform (4, 4) before it and the axis of its motion."""

    name: str
    kind: str
    child: str
    origin: Array
    axis: Array


@cache
def chain() -> tuple[Joint, ...]:
    """The joints of the URDF from the floor to the tool frame of the left gripper."""
    root = ET.parse(pr2.urdf_path()).getroot()
    to_parent = {_child(joint): joint for joint in root.findall("joint")}
    joints: list[Joint] = []
    link = pr2.TOOL_LINK["pr2L"]
    while link != _ROOT:
        element = to_parent[link]
        joints.append(
            Joint(
                name=element.get("name", ""),
                kind=element.get("type", ""),
                child=link,
                origin=_transform(element.find("origin")),
                axis=_vector(element.find("axis"), "xyz"),
            )
        )
        parent = element.find("parent")
        assert parent is not None
        link = parent.get("link", "")
    return tuple(reversed(joints))


def _child(joint: ET.Element) -> str:
    child = joint.find("child")
    assert child is not None
    return child.get("link", "")


def _vector(element: ET.Element | None, key: str) -> Array:
    text = "0 0 0" if element is None else element.get(key, "0 0 0")
    return np.array([float(part) for part in text.split()])


def _transform(origin: ET.Element | None) -> Array:
    roll, pitch, yaw = _vector(origin, "rpy")
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (np.cos, np.sin))
    transform = np.eye(4)
    transform[:3, :3] = [
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ]
    transform[:3, 3] = _vector(origin, "xyz")
    return transform


@dataclass(frozen=True)
class ArmPose:
    """Where the tool and the spheres of an arm are, as CasADi expressions in the robot's frame."""

    position: Any
    """(3,) m."""
    rotation: Any
    """(3, 3); columns are the tool's axes."""
    spheres: Any
    """(3, len(SPHERES)) m: centres."""


def arm_pose(q: Any, side: Any, torso: Any) -> ArmPose:
    """Forward kinematics.

    Args:
        q: seven joint values (rad), mirrored for the right arm.
        side: 1 left, -1 right.
        torso: height of the torso (m).
    """
    angles = {name: q[i] for i, name in enumerate(_ARM)}
    rotation, position = ca.SX.eye(3), ca.SX.zeros(3)
    centres: dict[int, Any] = {}
    for joint in chain():
        position = position + ca.mtimes(rotation, _exact(joint.origin[:3, 3]))
        rotation = ca.mtimes(rotation, _exact(joint.origin[:3, :3]))
        if joint.name == _TORSO:
            position = position + ca.mtimes(rotation, _exact(joint.axis)) * torso
        elif joint.name in angles:
            rotation = ca.mtimes(rotation, _turn(joint.axis, angles[joint.name]))
        for i, sphere in enumerate(SPHERES):
            if sphere.link == joint.child:
                centres[i] = position + ca.mtimes(rotation, _exact(np.array(sphere.centre)))
    mirror = ca.diag(ca.vertcat(1, side, 1))
    spheres = ca.horzcat(*(centres[i] for i in range(len(SPHERES))))
    return ArmPose(
        position=ca.mtimes(mirror, position),
        rotation=ca.mtimes([mirror, rotation, mirror]),
        spheres=ca.mtimes(mirror, spheres),
    )


def _exact(values: Array) -> Any:
    """Constants with structural zeros, which CasADi leaves out of the expressions."""
    return ca.sparsify(ca.SX(values))


def _turn(axis: Array, angle: Any) -> Any:
    """Rotation about one of the coordinate axes, which are the only ones in an arm."""
    index = int(np.argmax(np.abs(axis)))
    a, b = (index + 1) % 3, (index + 2) % 3
    sine, cosine = float(axis[index]) * ca.sin(angle), ca.cos(angle)
    rotation = ca.SX(3, 3)
    rotation[index, index] = 1
    rotation[a, a] = rotation[b, b] = cosine
    rotation[a, b], rotation[b, a] = -sine, sine
    return rotation


def inverse(position: Any, rotation: Any, pan: Any, branch: Any, side: Any, torso: Any) -> Any:
    """Closed-form inverse kinematics for a given shoulder pan.

    The shoulder's pan is the free parameter of the seven joints. Then the distance to the wrist
    gives the elbow, the wrist's offset from the vertical plane of the shoulder gives the roll of
    the upper arm (two branches), and the remaining rotation gives forearm and wrist. Where the
    target is out of reach, the nearest values are returned.

    Args:
        position: (3,) target of the tool in the robot's frame (m).
        rotation: (3, 3) target axes of the tool.
        pan: shoulder pan (rad), mirrored for the right arm.
        branch: 1 or -1, which solution of the upper arm's roll.
        side: 1 left, -1 right.
        torso: height of the torso (m).

    Returns:
        seven joint values (mirrored for the right arm) and the distance (m) missing to reach.
    """
    mirror = ca.diag(ca.vertcat(1, side, 1))
    target = ca.mtimes(mirror, position)
    axes = ca.mtimes([mirror, rotation, mirror])
    origins = {joint.name: joint.origin[:3, 3] for joint in chain()}
    shoulder = sum(origins[name] for name in ("base_footprint_joint", _TORSO, _ARM[0]))
    upper = float(origins["l_elbow_flex_joint"][0])
    fore = float(origins["l_wrist_flex_joint"][0])
    hand = float(origins["l_gripper_tool_joint"][0])
    lift_offset = float(origins["l_shoulder_lift_joint"][0])

    wrist = target - hand * axes[:, 0] - shoulder - ca.vertcat(0, 0, torso)
    wrist = ca.mtimes(_turn(np.array([0, 0, 1.0]), -pan), wrist) - ca.vertcat(lift_offset, 0, 0)
    distance = ca.norm_2(wrist)
    cosine = (distance**2 - upper**2 - fore**2) / (2 * upper * fore)
    elbow = -ca.acos(_clip(cosine))
    along = upper + fore * ca.cos(elbow)
    out = -fore * ca.sin(elbow)
    sine = -wrist[1] / ca.fmax(out, 1e-6)
    roll = ca.asin(_clip(sine))
    roll = ca.if_else(branch > 0, roll, np.pi - roll)
    raised = out * ca.cos(roll)
    lift = ca.atan2(raised * wrist[0] - along * wrist[2], along * wrist[0] + raised * wrist[2])
    forearm = ca.SX.eye(3)
    for axis, angle in ((2, pan), (1, lift), (0, roll), (1, elbow)):
        forearm = ca.mtimes(forearm, _turn(np.eye(3)[axis], angle))
    remaining = ca.mtimes(forearm.T, axes)
    flex = -ca.acos(_clip(remaining[0, 0]))
    # x = Rx(q5) Ry(q6) Rx(q7): first column (c6, s5 s6, -c5 s6), first row (c6, s6 s7, s6 c7)
    forearm_roll = ca.atan2(-remaining[1, 0], remaining[2, 0])
    wrist_roll = ca.atan2(-remaining[0, 1], -remaining[0, 2])
    missing = ca.fmax(distance - upper - fore, 0) + out * ca.fmax(ca.fabs(sine) - 1, 0)
    return ca.vertcat(pan, lift, roll, elbow, forearm_roll, flex, wrist_roll, missing)


def _clip(value: Any) -> Any:
    return ca.fmin(ca.fmax(value, -1), 1)
