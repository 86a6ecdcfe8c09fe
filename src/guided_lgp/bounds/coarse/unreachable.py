"""What an arm cannot reach: a proof by branch and bound, without a solver.

For arms built like a human's: shoulder pan and lift, roll of the upper arm, elbow, and a wrist
whose three axes meet. Given a grasp and the pan, the wrist is a point, and its distance from the
shoulder gives the elbow. Cells of grasps are discarded where interval bounds on these quantities
leave the joint limits; if nothing is left, no configuration exists. Collisions, and the limits of
the rolls of forearm and wrist, are left out, so that what is called unreachable is.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from guided_lgp.bounds.program.kinematics import ArmKinematics
from guided_lgp.poses import Array

Flags = NDArray[np.bool_]

_SLACK = 0.003
"""Tolerance (m): several times the solver's, so that near the edge the solver decides."""
_SLACK_ANGLE = 0.02
"""Tolerance of joint limits (rad)."""
_SMALLEST = 0.004
"""Cells whose wrist moves by less (m) are not divided: the solver decides."""
_EFFORT = 20_000
"""Cells looked at before the proof is given up, for each variable that is free."""
_TURNED_OVER = [0, 2, 4, 6]
"""The joints that turn about x or z."""


@dataclass(frozen=True)
class Grasp:
    """A family of grasps of a level box, and where the box may be.

    The hand comes in the vertical plane of the box's length; see ``bounds/terms/hold.py``.
    """

    low: Array
    """(7,) x, y and heading of the box's length, pitch, where the tool's origin is from the box's
    centre, along its length and up, and shoulder pan (m, rad) ..."""
    high: Array
    """... and the other end; equal where a value is given."""
    height: float
    """z of the box's centre (m)."""
    half_length: float
    half_height: float
    palm: float
    """Palm beyond the tool frame's origin, and its least distance from the box (m)."""
    ends: tuple[tuple[float, float], ...]
    """Ways straight back along the hand and straight up (m) to which the arm must get, too."""


@dataclass(frozen=True)
class Limb:
    """Lengths (m) and joint limits (rad) of an arm with a shoulder, an elbow and a wrist."""

    shoulder: Array
    """(3,) where pan's axis is, at the height of the lift's (m)."""
    ahead: float
    """Lift's axis before that of the pan."""
    upper: float
    fore: float
    hand: float
    """Tool frame beyond the wrist."""
    limits: Array
    """(7, 2)."""
    _rolls: tuple[tuple[float, float], ...] = field(init=False)

    def __post_init__(self) -> None:
        halves = (_sines(self.limits[2], centre) for centre in (0.0, np.pi))
        object.__setattr__(self, "_rolls", tuple(halves))

    @classmethod
    def of(cls, arm: ArmKinematics, fixed: Mapping[str, float]) -> "Limb | None":
        """The lengths of an arm, or None if it is built otherwise.

        Args:
            arm: of a robot.
            fixed: values (m) of the joints that the scene sets.
        """
        lengths = arm.chain.human_like
        limits = np.array(arm.limits)
        bent_one_way = limits[3, 0] >= -np.pi and limits[3, 1] <= 0.0
        if lengths is None or not bent_one_way:
            return None
        if arm.side < 0:  # turned over at y = 0, turns about x and z change their sign
            limits[_TURNED_OVER] = -limits[_TURNED_OVER, ::-1]
        raised = sum(fixed[name] for name in lengths.raised_by)
        shoulder = lengths.shoulder * (1.0, arm.side, 1.0) + (0.0, 0.0, raised)
        return cls(shoulder, lengths.lift, lengths.upper, lengths.fore, lengths.hand, limits)

    def cannot(self, grasp: Grasp) -> bool:
        """Whether no grasp of the family has a configuration within the joint limits."""
        counts = np.where(grasp.high > grasp.low, _FIRST_CELLS, 1)
        axes = [
            low + (np.arange(count) + 0.5) * (high - low) / count
            for low, high, count in zip(grasp.low, grasp.high, counts, strict=True)
        ]
        cells = np.stack([grid.ravel() for grid in np.meshgrid(*axes, indexing="ij")], axis=-1)
        half = (grasp.high - grasp.low) / counts / 2
        effort, allowed = 0, _EFFORT * np.count_nonzero(half)
        while len(cells):
            effort += len(cells)
            if effort > allowed:
                return False
            cells = cells[self._open(grasp, cells, half)]
            if self._open(grasp, _typical(grasp, cells), np.zeros(7)).any():
                return False
            moved = half * self._levers(grasp)
            if moved.sum() < _SMALLEST:
                return len(cells) == 0
            for axis in np.flatnonzero(moved >= 0.6 * moved.max()):
                half = np.where(np.arange(7) == axis, half / 2, half)
                step = np.where(np.arange(7) == axis, half, 0.0)
                cells = np.concatenate([cells - step, cells + step])
        return True

    def _levers(self, grasp: Grasp) -> Array:
        """(7,) how far (m) the wrist moves at most per unit of each variable."""
        behind = self.hand + max(back for back, _ in grasp.ends)
        out = grasp.high[4] + behind
        return np.array([1.0, 1.0, out, behind, 1.0, 1.0, self.upper + self.fore])

    def _open(self, grasp: Grasp, cells: Array, half: Array) -> Flags:
        """Which cells may hold a grasp for which all ends can be reached."""
        rows = np.flatnonzero(_held(grasp, cells, half))
        for back, raised in grasp.ends:
            rows = rows[self._reached(cells[rows], half, self.hand + back, grasp.height + raised)]
        found = np.zeros(len(cells), dtype=bool)
        found[rows] = True
        return found

    def _reached(self, cells: Array, half: Array, behind: float, height: float) -> Flags:
        """For which cells the wrist may be so far (m) behind the tips; the box at a height (m)."""
        x, y, heading, pitch, along, up, pan = cells.T
        cp, sp = np.cos(pitch), np.sin(pitch)
        flat = along - behind * cp
        wrist = np.stack(
            [x + flat * np.cos(heading), y + flat * np.sin(heading), height + up + behind * sp]
        )
        moved = half[3] * behind + np.hypot(half[4], half[5]) + _SLACK
        radius = np.hypot(half[0], half[1]) + moved + half[2] * (np.abs(flat) + moved)
        relative = heading - pan
        tool = np.stack([cp * np.cos(relative), cp * np.sin(relative), -sp])
        return self.reaches(wrist, radius, tool, half[[2, 3, 6]].sum(), pan, half[6])

    def reaches(
        self, wrist: Array, radius: Array, tool: Array, twist: float, pan: Array, turn: float
    ) -> Flags:
        """Which wrists (3, n), each within a radius (n,) in m, the arm may reach.

        Args:
            wrist: in the robot's frame.
            radius: of the ball in which it is.
            tool: (3, n) approach axis, in the frame turned by the pan.
            twist: by how much that axis may be turned (rad).
            pan: (n,) of the shoulder (rad).
            turn: by how much that may differ (rad).
        """
        wrists = self._seen_from_shoulder(wrist, radius, tool, twist, pan, turn)
        nearest, furthest = map(self._distance, self.limits[3])
        near, far = wrists.distance - wrists.radius, wrists.distance + wrists.radius
        along, out = self._bent(np.clip(near, nearest, furthest), np.clip(far, nearest, furthest))
        within = (near <= furthest) & (far >= nearest)
        within &= along[0] <= wrists.planar + wrists.radius
        either = [
            _rolled(wrists, out, roll) & self._lifted(wrists, along, sign)
            for sign, roll in zip((1.0, -1.0), self._rolls, strict=True)
        ]
        return np.asarray(within & (either[0] | either[1]))

    def _seen_from_shoulder(
        self, wrist: Array, radius: Array, tool: Array, twist: float, pan: Array, turn: float
    ) -> "_Wrists":
        dx, dy, z = wrist - self.shoulder[:, None]
        cosine, sine = np.cos(pan), np.sin(pan)
        x, y = cosine * dx + sine * dy - self.ahead, cosine * dy - sine * dx
        return _Wrists(x, y, z, radius + turn * (np.hypot(dx, dy) + radius), tool, twist)

    def _lifted(self, wrists: "_Wrists", along: Array, sign: float) -> Flags:
        """Whether a lift within its limits, and a bend of the wrist, bring the hand there.

        In the plane of the pan, the lift is the direction of the arm (upper arm and what the
        elbow adds to it, up or down) minus that of the wrist.
        """
        closest = np.maximum(wrists.planar - wrists.radius, 1e-9)
        furthest = wrists.planar + wrists.radius
        ratios = np.stack([row / away for row in along for away in (closest, furthest)])
        bend = sign * np.arccos(np.clip([ratios.min(axis=0), ratios.max(axis=0)], -1.0, 1.0))
        part = np.minimum(wrists.radius / np.maximum(wrists.planar, 1e-9), 1.0)
        spread = np.where(part < 1.0, np.arcsin(part), np.pi) + _SLACK_ANGLE
        towards = np.arctan2(wrists.z, wrists.x)
        low, high = self._lifts(
            bend.min(axis=0) - towards - spread, bend.max(axis=0) - towards + spread
        )
        return np.asarray((low <= high) & self._wrist_bends(wrists, low, high))

    def _distance(self, elbow: float) -> float:
        """Shoulder to wrist (m)."""
        return float(np.hypot(self.upper + self.fore * np.cos(elbow), self.fore * np.sin(elbow)))

    def _bent(self, near: Array, far: Array) -> tuple[Array, Array]:
        """Wrist along the upper arm and away from it (2, n) in m: least and most over distances."""
        distances = np.stack([near, far])
        along = (distances**2 + self.upper**2 - self.fore**2) / (2 * self.upper)
        out = np.sqrt(np.maximum(distances**2 - along**2, 0.0))
        square = np.hypot(self.upper, self.fore)  # where the forearm is at right angles
        most = np.where((near <= square) & (square <= far), self.fore, out.max(axis=0))
        return along, np.stack([out.min(axis=0), most])

    def _lifts(self, low: Array, high: Array) -> tuple[Array, Array]:
        """Part of intervals of the lift that is within the limits; none of it: low > high."""
        least, most = self.limits[1]
        turns = np.ceil((least - high) / (2 * np.pi)) * 2 * np.pi
        wide = high - low > np.pi
        return (
            np.where(wide, least, np.maximum(low + turns, least)),
            np.where(wide, most, np.minimum(high + turns, most)),
        )

    def _wrist_bends(self, wrists: "_Wrists", low: Array, high: Array) -> Flags:
        """Whether the angle between forearm and hand may be within the wrist's limit.

        The forearm is the wrist minus the upper arm; their products with the hand's axis are
        bounded apart.
        """
        tx, ty, tz = wrists.tool
        # upper arm · hand = upper (tx cos lift - tz sin lift), least over the lifts
        phase = np.arctan2(tz, tx)
        ends = np.minimum(np.cos(low + phase), np.cos(high + phase))
        opposite = np.ceil((low + phase - np.pi) / (2 * np.pi)) * 2 * np.pi + np.pi
        least = np.hypot(tx, tz) * np.where(opposite <= high + phase, -1.0, ends)
        product = wrists.x * tx + wrists.y * ty + wrists.z * tz
        most = product + wrists.radius + wrists.distance * wrists.twist
        most = most - self.upper * (least - wrists.twist)
        limit = min(np.abs(self.limits[5]).max() + _SLACK_ANGLE, np.pi)
        return np.asarray(most >= self.fore * np.cos(limit))


@dataclass(frozen=True)
class _Wrists:
    """Wrists, each within a ball, seen from the lift's axis in the frame turned by the pan."""

    x: Array
    y: Array
    z: Array
    radius: Array
    tool: Array
    """(3, n) axis of the hand ..."""
    twist: float
    """... and by how much it may be turned (rad)."""
    planar: Array = field(init=False)
    """Distance (m) in the plane of the pan."""
    distance: Array = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "planar", np.hypot(self.x, self.z))
        object.__setattr__(self, "distance", np.hypot(self.planar, self.y))


def _held(grasp: Grasp, cells: Array, half: Array) -> Flags:
    """In which cells the palm may be outside of the box."""
    pitch, along, up = cells.T[3:6]
    cp, sp = np.cos(pitch), np.sin(pitch)
    shift = np.hypot(half[4], half[5]) + _SLACK
    tip = np.hypot(along, up) + shift
    extent = grasp.half_length * np.abs(cp) + grasp.half_height * sp
    slope = np.hypot(grasp.half_length, grasp.half_height)  # of the extent in the pitch
    away = up * sp - along * cp + shift + half[3] * (tip + slope)
    return np.asarray(away >= extent + grasp.palm)


def _typical(grasp: Grasp, cells: Array) -> Array:
    """Grasps (2 n, 7) like those given, with the palm at the box and with the fingertips only."""
    cp, sp = np.cos(cells[:, 3]), np.sin(cells[:, 3])
    touching = grasp.half_length * np.abs(cp) + grasp.half_height * sp + grasp.palm
    within = grasp.high[4:6] / np.maximum(np.abs([cp, sp]).T, 1e-9)
    moved = []
    for extent in (touching, within.min(axis=1)):
        tip = np.stack([-extent * cp, extent * sp], axis=1)
        tip = np.clip(tip, grasp.low[4:6], grasp.high[4:6])
        moved.append(np.column_stack([cells[:, :4], tip, cells[:, 6]]))
    return np.concatenate(moved)


def _rolled(wrists: _Wrists, out: Array, sines: tuple[float, float]) -> Flags:
    """Whether a roll of the upper arm within its limits brings the wrist so far to the side."""
    least, most = sines
    low, high = -wrists.y - wrists.radius, -wrists.y + wrists.radius
    return np.asarray((high >= (least * out).min(axis=0)) & (low <= (most * out).max(axis=0)))


_FIRST_CELLS = np.array([1, 1, 4, 6, 1, 1, 6])
"""Cells of the first division, where a variable is free, in the order of ``Grasp.low``."""


def _sines(limits: Array, centre: float) -> tuple[float, float]:
    """Least and greatest sine of angles within limits and a quarter turn of a centre."""
    found = []
    for turns in range(-2, 3):
        low = max(limits[0], centre + 2 * np.pi * turns - np.pi / 2)
        high = min(limits[1], centre + 2 * np.pi * turns + np.pi / 2)
        found += [np.sin(low), np.sin(high)] if low <= high else []
    return (min(found), max(found)) if found else (np.inf, -np.inf)
