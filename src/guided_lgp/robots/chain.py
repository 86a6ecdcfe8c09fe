"""One arm as a chain of turning joints, read from a URDF, and its forward kinematics.

A chain is described by its screws: the axes of its joints and a point on each, all at joint values
zero and in the frame of the chain's root, and the tool frame there. Joints that do not move (fixed
ones, a torso, a linear rail) are part of that geometry, at the values that they keep.
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from guided_lgp.errors import InputError

Array = NDArray[np.float64]

_TURNING = ("revolute", "continuous")
_MOVABLE = (*_TURNING, "prismatic")


@dataclass(frozen=True)
class Joint:
    """A joint of the URDF."""

    name: str
    kind: str
    parent: str
    child: str
    rotation: Array
    """(3, 3) of the joint's frame in its parent link's."""
    position: Array
    """(3,) of its origin there (m)."""
    axis: Array
    """(3,) unit vector in the joint's own frame."""

    def moved(self, value: float) -> tuple[Array, Array]:
        """Rotation (3, 3) and position (3,) of the child link in the parent link's frame."""
        if self.kind == "prismatic":
            return self.rotation, self.position + value * self.rotation @ self.axis
        if self.kind in _TURNING:
            return self.rotation @ turn(self.axis, np.array(value)), self.position
        return self.rotation, self.position


@dataclass(frozen=True)
class Chain:
    """Screws of n turning joints and the tool frame, at joint values zero, in the root's frame."""

    joints: tuple[str, ...]
    axes: Array
    """(n, 3) unit vectors."""
    points: Array
    """(n, 3) a point on each axis (m)."""
    rotation: Array
    """(3, 3) of the tool frame; its columns are the tool's axes."""
    position: Array
    """(3,) of the tool frame's origin (m)."""

    def __len__(self) -> int:
        return len(self.joints)

    def extended(self, rotation: Array, position: Array) -> "Chain":
        """The same chain with the tool frame at a pose in the present one."""
        return replace(
            self,
            rotation=self.rotation @ rotation,
            position=self.position + self.rotation @ position,
        )

    def forward(self, q: Array) -> tuple[Array, Array]:
        """Rotation (..., 3, 3) and origin (..., 3) of the tool frame.

        Args:
            q: (..., n) in rad.
        """
        rotation = np.broadcast_to(self.rotation, (*q.shape[:-1], 3, 3))
        position = np.broadcast_to(self.position, (*q.shape[:-1], 3))
        for i in reversed(range(len(self))):
            turned = turn(self.axes[i], q[..., i])
            rotation = turned @ rotation
            position = self.points[i] + _apply(turned, position - self.points[i])
        return rotation, position

    def jacobian(self, q: Array) -> tuple[Array, Array, Array]:
        """The forward kinematics and its derivative (..., 6, n).

        The first three rows are the velocity of the tool's origin (m/rad), the others its angular
        velocity, in the root's frame.
        """
        rotation, position = self.forward(q)
        frame = np.broadcast_to(np.eye(3), (*q.shape[:-1], 3, 3))
        origin = np.zeros((*q.shape[:-1], 3))
        columns = np.empty((*q.shape[:-1], 6, len(self)))
        for i in range(len(self)):
            axis = frame @ self.axes[i]
            point = origin + frame @ self.points[i]
            columns[..., :3, i] = np.cross(axis, position - point)
            columns[..., 3:, i] = axis
            frame = frame @ turn(self.axes[i], q[..., i])
            origin = point - frame @ self.points[i]
        return rotation, position, columns


@cache
def read_joints(urdf: Path) -> Mapping[str, Joint]:
    """The joints of a URDF, whose name is another for another content, by their child link.

    Raises:
        InputError: the file cannot be read.
    """
    try:
        root = ET.parse(urdf).getroot()
    except (OSError, ET.ParseError) as error:
        raise InputError(str(urdf), f"is not a readable URDF: {error}") from None
    joints = (_joint(element) for element in root.findall("joint"))
    return {joint.child: joint for joint in joints}


def path_between(joints: Mapping[str, Joint], root: str, tip: str) -> list[Joint]:
    """The joints from the link ``root`` up to the link ``tip``.

    Raises:
        InputError: ``tip`` does not hang on ``root``.
    """
    path: list[Joint] = []
    link = tip
    while link != root:
        if link not in joints:
            raise InputError("robot", f"link {tip} does not hang on link {root}", "a link below it")
        path.append(joints[link])
        link = joints[link].parent
    return path[::-1]


def read_chain(
    urdf: Path,
    root: str,
    tip: str,
    moving: Sequence[str],
    fixed: Mapping[str, float] | None = None,
) -> Chain:
    """The chain from a link to the tool frame.

    Args:
        urdf: the description's file.
        root: link in whose frame the chain is given.
        tip: link that is the tool frame.
        moving: names of the joints of the arm, from root to tip.
        fixed: values (rad or m) of other joints; zero where nothing is said.

    Raises:
        InputError: the links are not connected, or the arm's joints are not on the way.
    """
    path = path_between(read_joints(urdf), root, tip)
    on_the_way = [joint.name for joint in path if joint.name in moving]
    if on_the_way != list(moving):
        turning = ", ".join(joint.name for joint in path if joint.kind in _TURNING)
        raise InputError("robot", f"joints {', '.join(moving)} of the arm to {tip}", turning)
    rotation, position = np.eye(3), np.zeros(3)
    axes, points = [], []
    for joint in path:
        arm = joint.name in moving
        if arm and joint.kind not in _TURNING:
            raise InputError("robot", f"joint {joint.name} is {joint.kind}", "revolute, continuous")
        step, shift = joint.moved(0.0 if arm else (fixed or {}).get(joint.name, 0.0))
        position = position + rotation @ shift
        rotation = rotation @ step
        if arm:
            axes.append(rotation @ joint.axis)
            points.append(position)
    return Chain(tuple(moving), np.array(axes), np.array(points), rotation, position)


def turn(axis: Array, angle: Array) -> Array:
    """Rotations (..., 3, 3) about unit vectors (..., 3) by angles (...) in rad (Rodrigues)."""
    x, y, z = axis[..., 0], axis[..., 1], axis[..., 2]
    sine, cosine = np.sin(angle), np.cos(angle)
    rest = 1.0 - cosine
    shape = np.broadcast_shapes(x.shape, sine.shape)
    rotation = np.empty((*shape, 3, 3))
    rotation[..., 0, 0] = cosine + x * x * rest
    rotation[..., 1, 1] = cosine + y * y * rest
    rotation[..., 2, 2] = cosine + z * z * rest
    rotation[..., 0, 1], rotation[..., 1, 0] = x * y * rest - z * sine, x * y * rest + z * sine
    rotation[..., 0, 2], rotation[..., 2, 0] = x * z * rest + y * sine, x * z * rest - y * sine
    rotation[..., 1, 2], rotation[..., 2, 1] = y * z * rest - x * sine, y * z * rest + x * sine
    return rotation


def _apply(rotation: Array, vector: Array) -> Array:
    return np.asarray((rotation @ vector[..., None])[..., 0])


def _joint(element: ET.Element) -> Joint:
    kind = element.get("type", "")
    origin = element.find("origin")
    axis = _vector(element.find("axis"), "xyz", "1 0 0")
    return Joint(
        name=element.get("name", ""),
        kind=kind,
        parent=_link(element, "parent"),
        child=_link(element, "child"),
        rotation=_rotation(*_vector(origin, "rpy", "0 0 0")),
        position=_vector(origin, "xyz", "0 0 0"),
        axis=axis / np.linalg.norm(axis) if kind in _MOVABLE else axis,
    )


def _link(element: ET.Element, key: str) -> str:
    link = element.find(key)
    return "" if link is None else link.get("link", "")


def _vector(element: ET.Element | None, key: str, otherwise: str) -> Array:
    text = otherwise if element is None else element.get(key, otherwise)
    return np.array([float(part) for part in text.split()])


def _rotation(roll: float, pitch: float, yaw: float) -> Array:
    """Rotation matrix of the URDF's fixed-axis angles (rad)."""
    x, y, z = np.eye(3)
    about = [turn(axis, np.array(angle)) for axis, angle in ((z, yaw), (y, pitch), (x, roll))]
    return np.asarray(about[0] @ about[1] @ about[2])
