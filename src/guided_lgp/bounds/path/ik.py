"""Analytic kinematics of one PR2 arm, for many poses at once.

The arm is a shoulder of three joints (pan, lift, upper arm roll; the pan axis 10 cm behind the
lift axis), an elbow and a spherical wrist. With the pan angle as the redundancy parameter, the
elbow follows from the distance shoulder–wrist, roll and lift from the direction to the wrist, and
the wrist from the remaining rotation: two solutions per pose and pan, one per sign of the elbow's
side. The right arm is solved as the mirror image of the left one.

Rotations are matrices here, since their columns are what the formulas need.
"""

import numpy as np

from guided_lgp.bounds.results import Array
from guided_lgp.poses import rotation_matrix
from guided_lgp.scene import GRIPPERS, Scene
from guided_lgp.scene.pr2 import HOME, JOINT_LIMITS, MIRROR, base_pose

UPPER_ARM, FOREARM, PAN_OFFSET, TOOL = 0.4, 0.321, 0.1, 0.18
"""Lengths (m): lift axis to elbow, elbow to wrist, pan to lift axis, wrist to tool frame."""
SHOULDER = np.array([-0.05, 0.188, 0.790675])
"""Origin of the left pan axis in ``base_footprint`` with the torso at zero (m)."""

REACH = np.array([1.0, 0.9, 0.75, 0.65, 0.35, 0.3, 0.16])
"""Bounds (m) on how far a point of hand or held box moves per rad of each joint."""

_LIMITS = JOINT_LIMITS[:7] + np.array([1e-4, -1e-4])
_LIMITS[[3, 5], 1] = -0.08  # a straight elbow or wrist is singular: joints race near it
_CONTINUOUS = np.array([4, 6])
_TURN = 2 * np.pi


class Arm:
    """One arm of the robot of a scene."""

    def __init__(self, scene: Scene, gripper: str) -> None:
        base = base_pose(scene)
        left = gripper == GRIPPERS[0]
        self.gripper = gripper
        self.home = HOME[gripper]
        self.sign = np.ones(7) if left else MIRROR
        self._mirror = np.diag([1.0, 1.0 if left else -1.0, 1.0])
        self._base = rotation_matrix(base[3:])
        shoulder = self._mirror @ SHOULDER + np.array([0.0, 0.0, scene.robot.torso])
        self.shoulder = base[:3] + self._base @ shoulder

    def inverse(self, rotation: Array, position: Array, pan: Array) -> tuple[Array, Array]:
        """Solve for tool poses.

        Args:
            rotation: (..., 3, 3) world rotation of the tool frame.
            position: (..., 3) its origin in the world (m).
            pan: (...,) angle of the pan joint (rad).

        Returns:
            q (..., 2, 7), one row per side of the elbow, the two continuous joints as near as
            possible to the home posture, and valid (..., 2): inside reach and joint limits.
        """
        rot = self._mirror @ (self._base.T @ rotation) @ self._mirror
        wrist = ((position - self.shoulder) @ self._base) @ self._mirror - TOOL * rot[..., :, 0]
        pan = pan * self.sign[0]
        sin1, cos1 = np.sin(pan), np.cos(pan)
        x = cos1 * wrist[..., 0] + sin1 * wrist[..., 1] - PAN_OFFSET
        y = cos1 * wrist[..., 1] - sin1 * wrist[..., 0]
        z = wrist[..., 2]
        cos4 = (x * x + y * y + z * z - UPPER_ARM**2 - FOREARM**2) / (2 * UPPER_ARM * FOREARM)
        sin4 = -np.sqrt(np.maximum(1.0 - cos4 * cos4, 1e-12))
        along, across = UPPER_ARM + FOREARM * cos4, -FOREARM * sin4
        sin3 = -y / across
        reachable = (np.abs(cos4) < 1.0) & (np.abs(sin3) < 1.0)
        roll = np.arcsin(np.clip(sin3, -1.0, 1.0))
        height = across * np.cos(roll)

        q = np.empty((*np.broadcast_shapes(pan.shape, x.shape), 2, 7))
        q[..., 0] = pan[..., None]
        q[..., 3] = np.arctan2(sin4, cos4)[..., None]
        for side, (roll_, height_) in enumerate(((roll, height), (np.pi - roll, -height))):
            q[..., side, 1] = np.arctan2(height_ * x - along * z, along * x + height_ * z)
            q[..., side, 2] = roll_
        sin2, cos2 = np.sin(q[..., 1]), np.cos(q[..., 1])
        sin3_, cos3 = np.sin(q[..., 2]), np.cos(q[..., 2])
        # Rotation left for the wrist, R_36 = (R_z R_y R_x R_y)^T R, row by row.
        r1 = (cos1[..., None] * rot[..., 0, :] + sin1[..., None] * rot[..., 1, :])[..., None, :]
        r2 = (cos1[..., None] * rot[..., 1, :] - sin1[..., None] * rot[..., 0, :])[..., None, :]
        r3 = rot[..., None, 2, :]
        s1 = cos2[..., None] * r1 - sin2[..., None] * r3
        s3 = sin2[..., None] * r1 + cos2[..., None] * r3
        t2 = cos3[..., None] * r2 + sin3_[..., None] * s3
        t3 = cos3[..., None] * s3 - sin3_[..., None] * r2
        c4, s4 = cos4[..., None, None], sin4[..., None, None]
        u1 = c4 * s1 - s4 * t3
        u3 = s4 * s1 + c4 * t3
        q[..., 4] = np.arctan2(-t2[..., 0], u3[..., 0])
        q[..., 5] = -np.arccos(np.clip(u1[..., 0], -1.0, 1.0))
        q[..., 6] = np.arctan2(-u1[..., 1], -u1[..., 2])
        # The upper arm roll's range is wider than a turn's half: shift into it.
        q[..., 2] += np.where(q[..., 2] < _LIMITS[2, 0], _TURN, 0.0)
        q[..., 2] -= np.where(q[..., 2] > _LIMITS[2, 1], _TURN, 0.0)
        q[..., 1] = (q[..., 1] + np.pi) % _TURN - np.pi
        inside = np.all((q > _LIMITS[:, 0]) & (q < _LIMITS[:, 1]), axis=-1)
        return q * self.sign, inside & reachable[..., None]

    def forward(self, q: Array) -> tuple[Array, Array]:
        """Rotation (..., 3, 3) and origin (..., 3) of the tool frame in the world.

        Args:
            q: (..., 7) in rad.
        """
        c, s = np.cos(q * self.sign), np.sin(q * self.sign)
        frame = np.broadcast_to(np.eye(3), (*q.shape[:-1], 3, 3))
        frame = _turn(frame, 2, c[..., 0], s[..., 0])
        origin = PAN_OFFSET * frame[..., :, 0]
        frame = _turn(frame, 1, c[..., 1], s[..., 1])
        frame = _turn(frame, 0, c[..., 2], s[..., 2])
        origin = origin + UPPER_ARM * frame[..., :, 0]
        frame = _turn(frame, 1, c[..., 3], s[..., 3])
        origin = origin + FOREARM * frame[..., :, 0]
        frame = _turn(frame, 0, c[..., 4], s[..., 4])
        frame = _turn(frame, 1, c[..., 5], s[..., 5])
        frame = _turn(frame, 0, c[..., 6], s[..., 6])
        origin = origin + TOOL * frame[..., :, 0]
        rotation = self._base @ self._mirror @ frame @ self._mirror
        return rotation, self.shoulder + (origin @ self._mirror) @ self._base.T


def continuous_near(q: Array, reference: Array) -> Array:
    """Turn the two continuous joints of q (..., 7) by full turns to be next to a reference (7,)."""
    near = q.copy()
    turns = np.round((reference[..., _CONTINUOUS] - q[..., _CONTINUOUS]) / _TURN)
    near[..., _CONTINUOUS] += _TURN * turns
    return near


def unwrapped(q: Array) -> Array:
    """Remove jumps of full turns from the continuous joints along a path (n, 7)."""
    path = q.copy()
    path[:, _CONTINUOUS] = np.unwrap(path[:, _CONTINUOUS], axis=0)
    return path


def _turn(frame: Array, axis: int, cosine: Array, sine: Array) -> Array:
    """``frame`` times a rotation about one of its own axes."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    turned = frame.copy()
    c, s = cosine[..., None], sine[..., None]
    turned[..., :, first] = c * frame[..., :, first] + s * frame[..., :, second]
    turned[..., :, second] = c * frame[..., :, second] - s * frame[..., :, first]
    return turned
