"""Kinematics of arms in CasADi: a robot's chains as kernels need them.

A chain is read from the robot's description in the robot's frame: that of its base link, made level
where the robot is mounted otherwise. An arm that is
the mirror image of another shares its chain: mirrored joint values go in, and ``side`` = -1 turns
the result over at the plane y = 0.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import casadi as ca
import numpy as np

from guided_lgp.bounds.program.kernels import SCALE
from guided_lgp.bounds.results import Array
from guided_lgp.poses import rotation_matrix
from guided_lgp.robots import Arm, Robot
from guided_lgp.robots.chain import Joint, path_between, read_joints
from guided_lgp.robots.inverse.human_like import HumanLike, human_like
from guided_lgp.robots.robot import Sphere


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
    """The joints from the robot's frame to a tool frame, and what is fixed to them."""

    gripper: str
    """At its end."""
    name: str
    """In the names of kernels, an identifier."""
    joints: tuple[Joint, ...]
    tool: tuple[Array, Array]
    """Rotation (3, 3) and position (3,) of the tool frame in the last link."""
    moving: tuple[str, ...]
    """The joints whose values are the arm's."""
    fixed: tuple[str, ...]
    """The joints that the scene sets, of the whole robot."""
    spheres: tuple[Sphere, ...]
    against_arms: tuple[int, ...]
    """The spheres that stand for the arm against another."""
    palm_front: float
    """x of the palm's front in the tool frame (m)."""

    @cached_property
    def human_like(self) -> HumanLike | None:
        """The arm's lengths if it is built like a human's, so that formulas solve it."""
        return human_like(self.joints, self.moving, self.fixed, self.tool)

    @cached_property
    def levers(self) -> tuple[float, ...]:
        """How far (m) each moving joint moves the centre of a sphere at most per rad, hands open.

        No centre is farther from a joint than the way along the links to it; infinite where a joint
        that slides makes that longer.
        """
        found = []
        for name in self.moving:
            before, way, farthest = True, 0.0, 0.0
            for joint in self.joints:
                way += 0.0 if before else float(np.linalg.norm(joint.position))
                if not before and joint.kind == "prismatic":
                    way = np.inf
                before = before and joint.name != name
                on_link = (s.centre for s in self.spheres if not before and s.link == joint.child)
                farthest = max([farthest, *(way + float(np.linalg.norm(c)) for c in on_link)])
            found.append(farthest)
        return tuple(found)

    def pose(self, q: Any, side: Any, fixed: Any, closed: Any = 0) -> ArmPose:
        """Forward kinematics.

        Args:
            q: values of the moving joints (rad), mirrored for a mirror image.
            side: 1, or -1 for the mirror image.
            fixed: values of the joints that the scene sets (rad, m).
            closed: how far (m) the fingers, and their spheres, are from wide open.
        """
        inwards = self._inwards()
        value = {name: q[i] for i, name in enumerate(self.moving)}
        value |= {name: fixed[i] for i, name in enumerate(self.fixed)}
        rotation, position = ca.SX.eye(3), ca.SX.zeros(3)
        centres: dict[int, Any] = {}
        for joint in self.joints:
            position = position + ca.mtimes(rotation, _exact(joint.position))
            rotation = ca.mtimes(rotation, _exact(joint.rotation))
            if joint.name in value and joint.kind == "prismatic":
                position = position + ca.mtimes(rotation, _exact(joint.axis)) * value[joint.name]
            elif joint.name in value:
                rotation = ca.mtimes(rotation, turned(joint.axis, value[joint.name]))
            for i, sphere in enumerate(self.spheres):
                if sphere.link == joint.child:
                    centre = _exact(np.array(sphere.centre)) + closed * _exact(inwards[i])
                    centres[i] = position + ca.mtimes(rotation, centre)
        position = position + ca.mtimes(rotation, _exact(self.tool[1]))
        rotation = ca.mtimes(rotation, _exact(self.tool[0]))
        mirror = ca.diag(ca.vertcat(1, side, 1))
        spheres = ca.horzcat(*(centres[i] for i in range(len(self.spheres))))
        return ArmPose(
            position=ca.mtimes(mirror, position),
            rotation=ca.mtimes([mirror, rotation, mirror]),
            spheres=ca.mtimes(mirror, spheres),
        )

    def _inwards(self) -> list[Array]:
        """For each sphere, the way (3,) in its link that it goes where fingers close.

        Spheres on one side of the plane between the fingers, on what is fixed to the hand, are
        theirs; all others stay where they are.
        """
        tools = self._tools()
        ways = []
        for sphere in self.spheres:
            rotation, position = tools.get(sphere.link, (np.zeros((3, 3)), np.zeros(3)))
            closing = rotation[:, 1]
            across = float((np.array(sphere.centre) - position) @ closing)
            ways.append(-np.sign(across) * closing if abs(across) > sphere.radius else 0 * closing)
        return ways

    def _tools(self) -> dict[str, tuple[Array, Array]]:
        """Rotation (3, 3) and position (3,) of the tool frame in every link that is fixed to it."""
        rotation, position = self.tool
        tools = {}
        for joint in reversed(self.joints):
            tools[joint.child] = rotation, position
            if joint.name in (*self.moving, *self.fixed):
                break
            position = joint.position + joint.rotation @ position
            rotation = joint.rotation @ rotation
        return tools


@dataclass(frozen=True, eq=False)
class ArmKinematics:
    """An arm as the program sees it: in the convention of its chain."""

    arm: Arm
    chain: Chain
    side: float
    """1, or -1 for the mirror image of the chain."""
    home: tuple[float, ...]
    """Posture at its side (rad), in the chain's convention."""
    limits: tuple[tuple[float, float], ...]
    """rad, in the chain's convention."""
    links: tuple[str, ...]
    """The link of each sphere."""

    @property
    def left(self) -> float:
        """1 if the shoulder is on the robot's left or in its middle, -1 on its right."""
        rotation, position = np.eye(3), np.zeros(3)
        for joint in self.chain.joints:
            position = position + rotation @ joint.position
            rotation = rotation @ joint.rotation
            if joint.name in self.chain.moving:
                break
        return self.side if position[1] >= 0 else -self.side


@dataclass(frozen=True, eq=False)
class RobotKinematics:
    """All arms of a robot, and the chains that they share."""

    robot: Robot
    arms: dict[str, ArmKinematics]
    """By gripper."""
    fixed: tuple[str, ...]
    """The joints that the scene sets."""

    @property
    def chains(self) -> tuple[Chain, ...]:
        """The different ones."""
        return tuple(dict.fromkeys(arm.chain for arm in self.arms.values()))


@cache
def kinematics_of(robot: Robot) -> RobotKinematics:
    """A robot's arms in CasADi."""
    fixed = tuple(joint.joint for joint in robot.fixed_joints.values())
    joints = read_joints(robot.urdf)
    chains = {
        gripper: _chain(robot, arm, str(number), fixed, joints)
        for number, (gripper, arm) in enumerate(robot.arms.items())
        if arm.mirror_of is None
    }
    arms = {}
    for gripper, arm in robot.arms.items():
        original = robot.arms[arm.mirror_of or gripper]
        arms[gripper] = ArmKinematics(
            arm=arm,
            chain=chains[original.gripper],
            side=1.0 if arm.mirror_of is None else -1.0,
            home=tuple((arm.signs * arm.home).tolist()),
            limits=tuple((low, high) for low, high in original.limits.tolist()),
            links=tuple(sphere.link for sphere in arm.spheres),
        )
    return RobotKinematics(robot, arms, fixed)


def _chain(
    robot: Robot, arm: Arm, name: str, fixed: tuple[str, ...], joints: Mapping[str, Joint]
) -> Chain:
    return Chain(
        gripper=arm.gripper,
        name=name,
        joints=(*_mounting(robot), *path_between(joints, robot.base_link, arm.tool_link)),
        tool=(rotation_matrix(arm.tool_in_link[3:]), arm.tool_in_link[:3]),
        moving=arm.joints,
        fixed=fixed,
        spheres=arm.spheres,
        against_arms=arm.spheres_between_arms,
        palm_front=arm.palm_front,
    )


def _mounting(robot: Robot) -> tuple[Joint, ...]:
    """What turns the base link away from the level frame of the base, if anything does."""
    if not any(robot.tilt):
        return ()
    link = robot.base_link
    return (Joint("", "fixed", "", link, robot.mounting, np.zeros(3), np.zeros(3)),)


@cache
def levers(chain: Chain, closed: float) -> tuple[float, ...]:
    """How much the scaled distance of a sphere changes at most per rad of each moving joint.

    Args:
        chain: with the spheres.
        closed: how far (m) the fingers, and their spheres, are from wide open.
    """
    return tuple(SCALE * (lever + closed) for lever in chain.levers)


def _exact(values: Array) -> Any:
    """Constants with structural zeros, which CasADi leaves out of the expressions."""
    return ca.sparsify(ca.SX(values))


def turned(axis: Array, angle: Any) -> Any:
    """Rotation about a unit axis; about one of the coordinate axes with structural zeros."""
    if np.count_nonzero(axis) > 1:
        cross, along = _exact(np.cross(axis, np.eye(3)).T), ca.SX(np.outer(axis, axis))
        return ca.cos(angle) * (ca.SX.eye(3) - along) + along + ca.sin(angle) * cross
    index = int(np.argmax(np.abs(axis)))
    a, b = (index + 1) % 3, (index + 2) % 3
    sine, cosine = float(axis[index]) * ca.sin(angle), ca.cos(angle)
    rotation = ca.SX(3, 3)
    rotation[index, index] = 1
    rotation[a, a] = rotation[b, b] = cosine
    rotation[a, b], rotation[b, a] = -sine, sine
    return rotation
