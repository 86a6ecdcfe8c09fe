"""Kinematics of arms in CasADi: forward, the spheres around their links, and inverse.

A chain of joints is read from the robot's description in the robot's frame (its root link, on the
floor). An arm that is the mirror image of another shares its chain: mirrored joint values go in,
and ``side`` = -1 turns the result over at the plane y = 0.
"""

import xml.etree.ElementTree as ET
from dataclasses import dataclass
from functools import cache
from typing import Any

import casadi as ca
import numpy as np

from guided_lgp.bounds.results import Array
from guided_lgp.scene import GRIPPERS, pr2


@dataclass(frozen=True)
class Sphere:
    """A sphere that covers part of a link: centre in the link's frame and radius (m)."""

    link: str
    centre: tuple[float, float, float]
    radius: float
    against_arms: bool = True
    """Whether it is one of the fewer that stand for the arm against another arm."""


@dataclass(frozen=True)
class Joint:
    """A joint of a chain: fixed transform (4, 4) before it and the axis of its motion."""

    name: str
    kind: str
    child: str
    origin: Array
    axis: Array


@dataclass(frozen=True)
class ArmPose:
    """Where the tool and the spheres of an arm are, as CasADi expressions in the robot's frame."""

    position: Any
    """(3,) m."""
    rotation: Any
    """(3, 3); columns are the tool's axes."""
    spheres: Any
    """(3, number of spheres) m: centres."""


@dataclass(frozen=True, eq=False)
class Chain:
    """The joints from the robot's root to a tool frame, and what is fixed to them."""

    name: str
    """Of the gripper at its end."""
    joints: tuple[Joint, ...]
    moving: tuple[str, ...]
    """The joints whose values are the arm's."""
    fixed: tuple[str, ...]
    """The joints that the scene sets, of the whole robot."""
    spheres: tuple[Sphere, ...]
    palm_front: float
    """x of the palm's front in the tool frame (m)."""

    @property
    def against_arms(self) -> tuple[int, ...]:
        """The spheres that stand for the arm against another."""
        return tuple(i for i, sphere in enumerate(self.spheres) if sphere.against_arms)

    def pose(self, q: Any, side: Any, fixed: Any) -> ArmPose:
        """Forward kinematics.

        Args:
            q: values of the moving joints (rad), mirrored for a mirror image.
            side: 1, or -1 for the mirror image.
            fixed: values of the joints that the scene sets (rad, m).
        """
        value = {name: q[i] for i, name in enumerate(self.moving)}
        value |= {name: fixed[i] for i, name in enumerate(self.fixed)}
        rotation, position = ca.SX.eye(3), ca.SX.zeros(3)
        centres: dict[int, Any] = {}
        for joint in self.joints:
            position = position + ca.mtimes(rotation, _exact(joint.origin[:3, 3]))
            rotation = ca.mtimes(rotation, _exact(joint.origin[:3, :3]))
            if joint.name in value and joint.kind == "prismatic":
                position = position + ca.mtimes(rotation, _exact(joint.axis)) * value[joint.name]
            elif joint.name in value:
                rotation = ca.mtimes(rotation, _turn(joint.axis, value[joint.name]))
            for i, sphere in enumerate(self.spheres):
                if sphere.link == joint.child:
                    centres[i] = position + ca.mtimes(rotation, _exact(np.array(sphere.centre)))
        mirror = ca.diag(ca.vertcat(1, side, 1))
        spheres = ca.horzcat(*(centres[i] for i in range(len(self.spheres))))
        return ArmPose(
            position=ca.mtimes(mirror, position),
            rotation=ca.mtimes([mirror, rotation, mirror]),
            spheres=ca.mtimes(mirror, spheres),
        )


@dataclass(frozen=True, eq=False)
class ArmKinematics:
    """An arm as the program sees it: in the convention of its chain."""

    gripper: str
    chain: Chain
    side: float
    """1, or -1 for the mirror image of the chain."""
    signs: Array
    """(n,) that turn joint values of the chain into the arm's, and back."""
    home: tuple[float, ...]
    """Posture at its side (rad), in the chain's convention."""
    limits: tuple[tuple[float, float], ...]
    """rad, in the chain's convention."""
    redundant: int | None
    """Index of the joint that inverse kinematics is parametrised with."""
    links: tuple[str, ...]
    """The link of each sphere."""


@dataclass(frozen=True, eq=False)
class RobotKinematics:
    """All arms of a robot, and the chains that they share."""

    arms: dict[str, ArmKinematics]
    """By gripper."""
    fixed: tuple[str, ...]
    """The joints that the scene sets."""

    @property
    def chains(self) -> tuple[Chain, ...]:
        """The different ones."""
        return tuple(dict.fromkeys(arm.chain for arm in self.arms.values()))


_SPHERES = (
    Sphere("l_shoulder_pan_link", (0.13, -0.02, 0.0), 0.11),
    Sphere("l_upper_arm_link", (0.2, 0.0, 0.0), 0.08),
    Sphere("l_elbow_flex_link", (0.0, 0.0, 0.0), 0.085),
    Sphere("l_forearm_link", (0.15, 0.0, 0.0), 0.08),
    Sphere("l_forearm_link", (0.24, 0.0, -0.01), 0.068),
    Sphere("l_forearm_link", (0.325, 0.025, -0.005), 0.047),
    Sphere("l_forearm_link", (0.325, -0.025, -0.005), 0.047),
    Sphere("l_gripper_palm_link", (0.085, 0.025, 0.0), 0.036),
    Sphere("l_gripper_palm_link", (0.085, -0.025, 0.0), 0.036, against_arms=False),
    Sphere("l_gripper_palm_link", (0.105, 0.058, 0.0), 0.034, against_arms=False),
    Sphere("l_gripper_palm_link", (0.105, -0.058, 0.0), 0.034, against_arms=False),
    Sphere("l_gripper_palm_link", (0.137, 0.068, 0.0), 0.027, against_arms=False),
    Sphere("l_gripper_palm_link", (0.137, -0.068, 0.0), 0.027, against_arms=False),
    Sphere("l_gripper_palm_link", (0.168, 0.065, 0.0), 0.018),
    Sphere("l_gripper_palm_link", (0.168, -0.065, 0.0), 0.018),
)
"""Shoulder, upper arm, elbow, forearm, wrist, palm and the two open fingers."""


@cache
def robot_kinematics() -> RobotKinematics:
    """The arms of the PR2."""
    fixed = ("torso_lift_joint",)
    first = GRIPPERS[0]
    joints = _read_chain(pr2.TOOL_LINK[first], "base_footprint")
    moving = pr2.ARM_JOINTS[pr2.arm_slice(first)]
    chain = Chain(first, joints, moving, fixed, _SPHERES, pr2.PALM_FRONT)
    arms = {}
    for gripper in GRIPPERS:
        signs = np.ones(len(moving)) if gripper == first else pr2.MIRROR
        arms[gripper] = ArmKinematics(
            gripper=gripper,
            chain=chain,
            side=1.0 if gripper == first else -1.0,
            signs=signs,
            home=tuple((signs * pr2.HOME[gripper]).tolist()),
            limits=tuple(map(tuple, pr2.JOINT_LIMITS[pr2.arm_slice(first)].tolist())),
            redundant=0,
            links=tuple(pr2.SIDE[gripper] + sphere.link[1:] for sphere in _SPHERES),
        )
    return RobotKinematics(arms, fixed)


def _read_chain(tool: str, base: str) -> tuple[Joint, ...]:
    """The joints of the URDF from the robot's root to a tool frame."""
    root = ET.parse(pr2.urdf_path()).getroot()
    to_parent = {_child(joint): joint for joint in root.findall("joint")}
    joints: list[Joint] = []
    link = tool
    while link != base:
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


def _exact(values: Array) -> Any:
    """Constants with structural zeros, which CasADi leaves out of the expressions."""
    return ca.sparsify(ca.SX(values))


def _turn(axis: Array, angle: Any) -> Any:
    """Rotation about a unit axis; about one of the coordinate axes with structural zeros."""
    index = int(np.argmax(np.abs(axis)))
    if np.count_nonzero(axis) > 1:
        cross = _exact(np.cross(axis, np.eye(3)).T)
        outer = ca.SX(np.outer(axis, axis))
        return ca.cos(angle) * (ca.SX.eye(3) - outer) + outer + ca.sin(angle) * cross
    a, b = (index + 1) % 3, (index + 2) % 3
    sine, cosine = float(axis[index]) * ca.sin(angle), ca.cos(angle)
    rotation = ca.SX(3, 3)
    rotation[index, index] = 1
    rotation[a, a] = rotation[b, b] = cosine
    rotation[a, b], rotation[b, a] = -sine, sine
    return rotation


def inverse(
    chain: Chain, position: Any, rotation: Any, pan: Any, branch: Any, side: Any, torso: Any
) -> Any:
    """Closed-form inverse kinematics for a given shoulder pan.

    The shoulder's pan is the free parameter of the seven joints. Then the distance to the wrist
    gives the elbow, the wrist's offset from the vertical plane of the shoulder gives the roll of
    the upper arm (two branches), and the remaining rotation gives forearm and wrist. Where the
    target is out of reach, the nearest values are returned.

    Args:
        chain: of the PR2's left arm.
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
    origins = {joint.name: joint.origin[:3, 3] for joint in chain.joints}
    shoulder = sum(
        origins[name] for name in ("base_footprint_joint", *chain.fixed, chain.moving[0])
    )
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
