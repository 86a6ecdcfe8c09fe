"""Closed-form kinematics of an arm like the PR2's, for many poses at once.

The arm is a shoulder of three joints (pan, lift, upper arm roll; the pan axis some way behind the
lift axis), an elbow and a spherical wrist. With the pan angle as the redundancy parameter, the
elbow follows from the distance shoulder-wrist, roll and lift from the direction to the wrist, and
the wrist from the remaining rotation: two solutions per pose and pan, one per sign of the elbow's
side. A right arm is solved as the mirror image of a left one.

Rotations are matrices here, since their columns are what the formulas need. The formulas are there
twice: compiled, pose by pose, and in numpy for where there is no compiler.
"""

import ctypes
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from guided_lgp.compiled import address, load_compiled
from guided_lgp.poses import Array
from guided_lgp.robots.inverse.human_like import HumanLike

_TURN = 2 * np.pi
_JUMP = 0.35
"""Largest change (rad) of a joint from one pose of a path to the next."""
_SINGULAR = 0.08
"""Distance (rad) of elbow and wrist from straight, where the arm is singular: joints race there."""
_CONTINUOUS = [4, 6]


class _Arm(ctypes.Structure):
    """``shoulder_arm`` of offset_shoulder.c."""

    _fields_ = (
        *((name, ctypes.c_double) for name in ("lift", "upper", "fore", "hand")),
        ("shoulder", 3 * ctypes.c_double),
        ("signs", 7 * ctypes.c_double),
        ("limits", 14 * ctypes.c_double),
    )


class OffsetShoulder:
    """All solutions of one arm; see :class:`guided_lgp.robots.inverse.InverseKinematics`."""

    def __init__(self, lengths: HumanLike, limits: Array, signs: Array, lift: float) -> None:
        """Prepare an arm.

        Args:
            lengths: the measures of the left arm.
            limits: (7, 2) rad, the left arm's.
            signs: (7,) turn joint values of a right arm into the mirror image; ones on the left.
            lift: how far (m) the shoulder is raised.
        """
        self._lengths = lengths
        self._signs = signs
        self._mirror = np.diag([1.0, signs[0], 1.0])
        self.shoulder = self._mirror @ lengths.shoulder + np.array([0.0, 0.0, lift])
        self._limits = limits + np.array([1e-4, -1e-4])
        self._limits[[3, 5], 1] = np.minimum(self._limits[[3, 5], 1], -_SINGULAR)
        vectors = (tuple(array.ravel()) for array in (self.shoulder, signs, self._limits))
        self._arm = _Arm(lengths.lift, lengths.upper, lengths.fore, lengths.hand, *vectors)

    def inverse(
        self, rotation: Array, position: Array, redundancy: Array
    ) -> tuple[Array, NDArray[np.bool_]]:
        """Solve for tool poses.

        Args:
            rotation: (..., 3, 3) of the tool frame, in the robot's root.
            position: (..., 3) its origin (m).
            redundancy: (...,) angle of the pan joint (rad).

        Returns:
            q (..., 2, 7), one row per side of the elbow, the two continuous joints within half a
            turn of zero, and valid (..., 2): inside reach and joint limits. Where it is not valid,
            q means nothing.
        """
        library = _library()
        if library is None:
            return self.inverse_in_numpy(rotation, position, redundancy)
        shape = np.broadcast_shapes(rotation.shape[:-2], position.shape[:-1], redundancy.shape)
        each = rotation.shape[-3:-2] == position.shape[-2:-1] == (1,)  # pose at all values
        poses = (*shape[:-1], 1) if each else shape
        given = (
            np.ascontiguousarray(np.broadcast_to(array, wanted))
            for array, wanted in (
                (rotation, (*poses, 3, 3)),
                (position, (*poses, 3)),
                (redundancy, shape),
            )
        )
        q, valid = np.empty((*shape, 2, 7)), np.empty((*shape, 2), dtype=np.bool_)
        arrays = (*given, q, valid)
        count, values = valid.size // 2, shape[-1] if each else 1
        library.inverse(ctypes.byref(self._arm), count, values, *map(address, arrays))
        return q, valid

    def inverse_in_numpy(
        self, rotation: Array, position: Array, redundancy: Array
    ) -> tuple[Array, NDArray[np.bool_]]:
        """The same without a compiler, for all poses at once."""
        upper, fore, hand = self._lengths.upper, self._lengths.fore, self._lengths.hand
        rot = self._mirror @ rotation @ self._mirror
        wrist = (position - self.shoulder) @ self._mirror - hand * rot[..., :, 0]
        pan = redundancy * self._signs[0]
        sin1, cos1 = np.sin(pan), np.cos(pan)
        x = cos1 * wrist[..., 0] + sin1 * wrist[..., 1] - self._lengths.lift
        y = cos1 * wrist[..., 1] - sin1 * wrist[..., 0]
        z = wrist[..., 2]
        cos4 = (x * x + y * y + z * z - upper**2 - fore**2) / (2 * upper * fore)
        sin4 = -np.sqrt(np.maximum(1.0 - cos4 * cos4, 1e-12))
        along, across = upper + fore * cos4, -fore * sin4
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
        # Rotation left for the wrist, R_36 = (R_z R_y R_x R_y)^T R, row by row.
        rows = _turned_back(rot[..., 0, :], rot[..., 1, :], cos1, sin1)
        r1, r2, r3 = (row[..., None, :] for row in (*rows, rot[..., 2, :]))
        s3, s1 = _turned_back(r3, r1, np.cos(q[..., 1]), np.sin(q[..., 1]))
        t2, t3 = _turned_back(r2, s3, np.cos(q[..., 2]), np.sin(q[..., 2]))
        u3, u1 = _turned_back(t3, s1, cos4[..., None], sin4[..., None])
        q[..., 4] = np.arctan2(-t2[..., 0], u3[..., 0])
        q[..., 5] = -np.arccos(np.clip(u1[..., 0], -1.0, 1.0))
        q[..., 6] = np.arctan2(-u1[..., 1], -u1[..., 2])
        return q * self._signs, self._shifted_inside(q) & reachable[..., None]

    def _shifted_inside(self, q: Array) -> NDArray[np.bool_]:
        """Shift roll and lift by full turns into their ranges; which of q (..., 7) are inside."""
        limits = self._limits
        q[..., 2] += np.where(q[..., 2] < limits[2, 0], _TURN, 0.0)
        q[..., 2] -= np.where(q[..., 2] > limits[2, 1], _TURN, 0.0)
        q[..., 1] = (q[..., 1] + np.pi) % _TURN - np.pi
        return np.asarray(np.all((q > limits[:, 0]) & (q < limits[:, 1]), axis=-1))

    def follow(self, q: Array, valid: NDArray[np.bool_], branch: int) -> Array | None:
        """The solutions along a path as one motion on a side of the elbow.

        Args:
            q: (steps, 2, 7) from :meth:`inverse`, for poses close to each other.
            valid: (steps, 2).
            branch: side of the elbow.

        Returns:
            Configurations (steps, 7) in rad, or None where one is missing or jumps.
        """
        if not valid[:, branch].all():
            return None
        path = q[:, branch].copy()
        if _jumps(path):
            path[:, _CONTINUOUS] = np.unwrap(path[:, _CONTINUOUS], axis=0)
            return None if _jumps(path) else path
        return path

    def redundancies(self, count: int) -> Array:
        """Values (count,) of the pan joint (rad) at which solutions are looked for."""
        low, high = self._limits[0]
        return np.asarray(np.linspace(low, high, count + 2)[1:-1] * self._signs[0])

    def forward(self, q: Array) -> tuple[Array, Array]:
        """Rotation (..., 3, 3) and origin (..., 3) of the tool frame in the robot's root.

        Args:
            q: (..., 7) in rad.
        """
        library = _library()
        if library is None:
            return self.forward_in_numpy(q)
        joints, shape = np.ascontiguousarray(q), q.shape[:-1]
        rotation, position = np.empty((*shape, 3, 3)), np.empty((*shape, 3))
        arrays = (joints, rotation, position)
        library.forward(ctypes.byref(self._arm), q.size // 7, *map(address, arrays))
        return rotation, position

    def forward_in_numpy(self, q: Array) -> tuple[Array, Array]:
        """The same without a compiler."""
        upper, fore, hand = self._lengths.upper, self._lengths.fore, self._lengths.hand
        c, s = np.cos(q * self._signs), np.sin(q * self._signs)
        frame = np.broadcast_to(np.eye(3), (*q.shape[:-1], 3, 3))
        frame = _turn(frame, 2, c[..., 0], s[..., 0])
        origin = self._lengths.lift * frame[..., :, 0]
        frame = _turn(frame, 1, c[..., 1], s[..., 1])
        frame = _turn(frame, 0, c[..., 2], s[..., 2])
        origin = origin + upper * frame[..., :, 0]
        frame = _turn(frame, 1, c[..., 3], s[..., 3])
        origin = origin + fore * frame[..., :, 0]
        frame = _turn(frame, 0, c[..., 4], s[..., 4])
        frame = _turn(frame, 1, c[..., 5], s[..., 5])
        frame = _turn(frame, 0, c[..., 6], s[..., 6])
        origin = origin + hand * frame[..., :, 0]
        return self._mirror @ frame @ self._mirror, self.shoulder + origin @ self._mirror


def _jumps(path: Array) -> bool:
    return bool(np.abs(path[1:] - path[:-1]).max(initial=0.0) > _JUMP)


def _turn(frame: Array, axis: int, cosine: Array, sine: Array) -> Array:
    """``frame`` times a rotation about one of its own axes."""
    first, second = (axis + 1) % 3, (axis + 2) % 3
    turned = frame.copy()
    c, s = cosine[..., None], sine[..., None]
    turned[..., :, first] = c * frame[..., :, first] + s * frame[..., :, second]
    turned[..., :, second] = c * frame[..., :, second] - s * frame[..., :, first]
    return turned


def _turned_back(first: Array, second: Array, cosine: Array, sine: Array) -> tuple[Array, Array]:
    """Two rows (..., 3) of a rotation, turned back by an angle (...,) in their plane."""
    c, s = cosine[..., None], sine[..., None]
    return c * first + s * second, c * second - s * first


@cache
def _library() -> ctypes.CDLL | None:
    source = Path(__file__).with_name("offset_shoulder.c").read_text(encoding="utf-8")
    return load_compiled("offset_shoulder", source)
