"""The PR2: description files, joints, limits and kinematics.

The description is a copy of the one in ``example-robot-data`` (BSD-3). The URDF's root is
``base_footprint``, on the floor, 51 mm below ``base_link``; a scene's ``robot.base`` (x, y, yaw)
places that root in the world.
"""

import os
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from guided_lgp.errors import InputError
from guided_lgp.paths import DESCRIPTIONS
from guided_lgp.poses import Array, compose, pose
from guided_lgp.scene.model import GRIPPERS, Scene

_JOINTS = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "upper_arm_roll_joint",
    "elbow_flex_joint",
    "forearm_roll_joint",
    "wrist_flex_joint",
    "wrist_roll_joint",
)
SIDE = {"pr2L": "l", "pr2R": "r"}
"""Prefix of the names of joints and links, by gripper."""

ARM_JOINTS: tuple[str, ...] = tuple(f"{SIDE[g]}_{joint}" for g in GRIPPERS for joint in _JOINTS)
"""The 14 joints of a configuration q: left arm from shoulder to wrist, then right arm."""

_LEFT_LIMITS = np.array(
    [
        [-0.714601836603, 2.2853981634],
        [-0.5236, 1.3963],
        [-0.8, 3.9],
        [-2.3213, 0.0],
        [-2 * np.pi, 2 * np.pi],
        [-2.094, 0.0],
        [-2 * np.pi, 2 * np.pi],
    ]
)
MIRROR: Array = np.array([-1.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
"""Signs (7,) that turn joint values of one arm into the mirror image with the other."""

JOINT_LIMITS: Array = np.concatenate(
    [_LEFT_LIMITS, np.sort(MIRROR[:, None] * _LEFT_LIMITS, axis=1)]
)
"""(14, 2) rad. The URDF's; forearm and wrist roll are continuous and get two turns, so that a
configuration stays a vector of plain numbers."""

VELOCITY_LIMITS: Array = np.tile([2.088, 2.082, 3.27, 3.3, 3.6, 3.078, 3.6], 2)
"""(14,) rad/s, the URDF's."""

ACCELERATION_LIMITS: Array = 2.0 * VELOCITY_LIMITS
"""(14,) rad/s^2. The URDF has none: full speed in half a second."""

CONTINUOUS = (4, 6, 11, 13)
"""Indices of the joints without limits in the URDF."""

TORSO_LIMITS = (0.0115, 0.31)
"""Height of the torso lift (m): above its lower stop, up to the URDF's limit."""

FINGER_JOINTS: dict[str, tuple[str, ...]] = {
    gripper: tuple(
        f"{SIDE[gripper]}_gripper_{joint}_joint"
        for joint in ("l_finger", "r_finger", "l_finger_tip", "r_finger_tip")
    )
    for gripper in GRIPPERS
}
"""The joints that open a gripper; all four take the same value."""

FINGER_LIMITS = (0.0, 0.548)
"""rad."""
FINGER_VELOCITY = 0.5
"""rad/s."""

TOOL_LINK: dict[str, str] = {gripper: f"{SIDE[gripper]}_gripper_tool_frame" for gripper in GRIPPERS}
"""The frame between the fingertips: x points out of the palm, the fingers close along y."""

PALM_FRONT = -0.054
"""x of the palm's front in the tool frame (m)."""

_HOME_LEFT = np.array([1.42, 0.48, 0.75, -1.55, 0.0, -1.2, 0.0])
HOME: dict[str, Array] = {"pr2L": _HOME_LEFT, "pr2R": MIRROR * _HOME_LEFT}
"""Posture (7,) of each arm at its side, out of the other arm's way (rad)."""

HOME_CONFIGURATION: Array = np.concatenate([HOME[gripper] for gripper in GRIPPERS])
"""Both arms at their side (14,)."""

ARM_LINKS: dict[str, tuple[str, ...]] = {
    gripper: tuple(
        f"{SIDE[gripper]}_{link}"
        for link in (
            "shoulder_pan_link",
            "shoulder_lift_link",
            "upper_arm_roll_link",
            "upper_arm_link",
            "elbow_flex_link",
            "forearm_roll_link",
            "forearm_link",
            "wrist_flex_link",
        )
    )
    for gripper in GRIPPERS
}
"""Links with collision geometry that an arm moves, the hand left out."""

HAND_LINKS: dict[str, tuple[str, ...]] = {
    gripper: tuple(
        f"{SIDE[gripper]}_gripper_{link}_link"
        for link in ("palm", "l_finger", "r_finger", "l_finger_tip", "r_finger_tip")
    )
    for gripper in GRIPPERS
}
"""Palm and fingers: the links that may touch the held box."""

# Distance of the two fingertips' inner faces over the finger joint a (m):
# 2 (0.010 + 0.09137 sin a + 0.00495 cos a) - 0.0336, from the URDF's joint origins and the hulls.
_GAP_SINE, _GAP_COSINE, _GAP_OFFSET = 0.18274, 0.00990, -0.0136


def finger_opening(joint: float) -> float:
    """Distance (m) between the fingertips at a value (rad) of the finger joints."""
    return float(_GAP_SINE * np.sin(joint) + _GAP_COSINE * np.cos(joint) + _GAP_OFFSET)


def finger_joint(opening: float) -> float:
    """Value (rad) of the finger joints, within their limits, that opens the fingers so far (m)."""
    amplitude = np.hypot(_GAP_SINE, _GAP_COSINE)
    sine = np.clip((opening - _GAP_OFFSET) / amplitude, -1.0, 1.0)
    return float(np.clip(np.arcsin(sine) - np.arctan2(_GAP_COSINE, _GAP_SINE), *FINGER_LIMITS))


MAX_OPENING = finger_opening(FINGER_LIMITS[1])
"""Widest distance of the fingertips (m): 9.0 cm."""

GRASP_WIDTH = 0.085
"""Widest side (m) of a box that the fingers close across."""


def grasp_axis(size: tuple[float, float, float]) -> int:
    """The box axis that the fingers close along: the narrower horizontal one (0: x, 1: y)."""
    return 0 if size[0] < size[1] else 1


_STL_FACET = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])


def arm_slice(gripper: str) -> slice:
    """Where the joints of the gripper's arm stand in a configuration q."""
    start = 7 * GRIPPERS.index(gripper)
    return slice(start, start + 7)


def description_folder() -> Path:
    """The folder of the PR2's URDF, SRDF and meshes."""
    return DESCRIPTIONS / "pr2_description"


@cache
def urdf_path() -> Path:
    """The PR2's URDF, ready for PyBullet and pinocchio.

    A copy in the user's cache folder (``$XDG_CACHE_HOME/guided-lgp``): the ``package://`` prefix
    is replaced by the path of the installed meshes; pure frames, which have no inertia, get a
    mass of 1 g, where PyBullet would assume 1 kg; and meshes without normals, which would be
    drawn black, are drawn from repaired copies. Files are written once, atomically, under names
    that depend on their content.
    """
    folder = description_folder()
    source = (folder / "urdf" / "pr2.urdf").read_text(encoding="utf-8")
    root = ET.fromstring(source.replace("package://example-robot-data/robots", str(folder.parent)))
    for link in root.iter("link"):
        if link.find("inertial") is None and link.get("name") != "base_footprint":
            inertial = ET.SubElement(link, "inertial")
            ET.SubElement(inertial, "mass", value="0.001")
            moments = {"ixx": "1e-6", "iyy": "1e-6", "izz": "1e-6"}
            ET.SubElement(inertial, "inertia", moments | {"ixy": "0", "ixz": "0", "iyz": "0"})
    for mesh in root.findall("link/visual/geometry/mesh"):
        mesh.set("filename", str(_with_normals(Path(mesh.get("filename", "")))))
    return _cached("pr2", "urdf", ET.tostring(root))


def _with_normals(mesh: Path) -> Path:
    """The mesh, or a copy with its facets' normals filled in, if it is an STL without them."""
    content = mesh.read_bytes()
    facets = np.frombuffer(content, _STL_FACET, offset=84).copy()
    if np.any(facets["normal"]):
        return mesh
    sides = np.diff(facets["vertices"].astype(float), axis=1)
    normals = np.cross(sides[:, 0], sides[:, 1])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    facets["normal"] = normals / np.maximum(lengths, 1e-12)
    return _cached(mesh.stem, "stl", content[:84] + facets.tobytes())


def _cached(name: str, suffix: str, content: bytes) -> Path:
    base = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    target = Path(base) / "guided-lgp" / f"{name}-{sha256(content).hexdigest()[:16]}.{suffix}"
    if not target.exists():
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.NamedTemporaryFile(dir=target.parent, delete=False) as file:
                file.write(content)
            Path(file.name).replace(target)
        except OSError as error:
            fault = error.strerror or "cannot be written"
            raise InputError(str(target.parent), fault, "a writable $XDG_CACHE_HOME") from None
    return target


@cache
def disabled_pairs() -> frozenset[frozenset[str]]:
    """Pairs of links that are not checked for self-collision: those of the shipped SRDF.

    They include the pairs whose convex hulls overlap where the meshes do not: torso with upper
    arm, upper arm with forearm.
    """
    srdf = ET.parse(description_folder() / "srdf" / "pr2.srdf").getroot()
    return frozenset(
        frozenset((pair.get("link1", ""), pair.get("link2", "")))
        for pair in srdf.iter("disable_collisions")
    )


@dataclass(frozen=True)
class JointIndex:
    """Where a joint stands in pinocchio's configuration and velocity vectors."""

    position: int
    velocity: int
    continuous: bool
    """A continuous joint is stored as cosine and sine."""


@cache
def kinematics() -> tuple[Any, Any, list[JointIndex], int]:
    """Pinocchio's model and data, where the 14 arm joints stand, and the torso's position."""
    import pinocchio  # heavy: only where kinematics are needed

    model = pinocchio.buildModelFromUrdf(str(urdf_path()))
    joints = [model.joints[model.getJointId(name)] for name in ARM_JOINTS]
    torso = model.joints[model.getJointId("torso_lift_joint")]
    indices = [JointIndex(joint.idx_q, joint.idx_v, joint.nq == 2) for joint in joints]
    return model, model.createData(), indices, torso.idx_q


def fill(full: Array, indices: Sequence[JointIndex], angles: Array) -> None:
    """Write joint angles (..., n) in rad into pinocchio configurations (..., nq)."""
    for column, index in enumerate(indices):
        if index.continuous:
            full[..., index.position] = np.cos(angles[..., column])
            full[..., index.position + 1] = np.sin(angles[..., column])
        else:
            full[..., index.position] = angles[..., column]


def base_pose(scene: Scene) -> Array:
    """Pose (7,) of ``base_footprint`` in the world."""
    x, y, yaw = scene.robot.base
    return pose((x, y, 0.0), yaw)


def link_pose(scene: Scene, q: Array, link: str) -> Array:
    """Pose (7,) of a link's frame in the world (forward kinematics by pinocchio).

    Args:
        scene: gives the base and the torso.
        q: configuration (14,) in rad.
        link: name in the URDF; the fingers are at zero.
    """
    return np.asarray(link_poses(scene, np.asarray(q)[None], (link,))[0, 0])


def link_poses(scene: Scene, q: Array, links: Sequence[str]) -> Array:
    """Poses (T, len(links), 7) of links along a motion q (T, 14); see :func:`link_pose`."""
    import pinocchio

    model, data, joints, torso = kinematics()
    full = np.tile(pinocchio.neutral(model), (len(q), 1))
    full[:, torso] = scene.robot.torso
    fill(full, joints, np.asarray(q))
    frames = [model.getFrameId(link) for link in links]
    poses = np.empty((len(q), len(links), 7))
    for row, configuration in enumerate(full):
        pinocchio.forwardKinematics(model, data, configuration)
        for column, frame in enumerate(frames):
            placement = pinocchio.updateFramePlacement(model, data, frame)
            poses[row, column] = pinocchio.SE3ToXYZQUAT(placement)
    return compose(base_pose(scene), poses)


def tool_pose(scene: Scene, q: Array, gripper: str) -> Array:
    """Pose (7,) of the gripper's tool frame in the world; see :func:`link_pose`."""
    return link_pose(scene, q, TOOL_LINK[gripper])


def tool_poses(scene: Scene, q: Array) -> dict[str, Array]:
    """Poses (T, 7) of both tool frames along a motion q (T, 14), by gripper."""
    poses = link_poses(scene, q, [TOOL_LINK[gripper] for gripper in GRIPPERS])
    return {gripper: poses[:, column] for column, gripper in enumerate(GRIPPERS)}


LEVER: Array = np.tile([1.002, 0.902, 0.501, 0.501, 0.180, 0.180, 0.0], 2)
"""(14,) m. Longest distance from each joint's axis to the tool frame, over all configurations:
a joint that turns by an angle moves the tool by at most its lever times the angle."""
