"""Where the palm of a two-fingered hand ends, and how far its fingers are apart.

In the tool frame x points out of the palm and the fingers close along y. A shape of the hand that
lies on both sides of the plane between the fingers belongs to the palm; the others are fingers.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from guided_lgp.errors import InputError
from guided_lgp.robots.chain import Array
from guided_lgp.robots.measures.hulls import between, link_hulls

_STEPS = 65
"""Values of the finger joints at which the gap is measured."""
_MIDDLE = 0.002
"""How far (m) a shape may reach over the plane between the fingers and still be a finger."""
_LENGTH = 0.02
"""Length (m) of the fingers before and behind the tool frame's origin where the gap counts."""


@dataclass(frozen=True)
class HandShape:
    """Measures of a hand."""

    palm_front: float
    """x of the palm's front in the tool frame (m)."""
    values: Array
    """(k,) values of the finger joints (rad or m), from closed to open; one for fixed jaws."""
    gaps: Array
    """(k,) distances between the fingers there (m)."""
    radius: float
    """Reach (m) of the open hand beyond the tool frame's x axis."""
    lever: float
    """How far (m) a point of the fingers moves at most per unit of the value."""

    @property
    def opened(self) -> float:
        """The value at which the fingers are widest open."""
        return float(self.values[-1])

    def gap(self, value: float) -> float:
        """Distance (m) between the fingers at a value of the finger joints."""
        order = np.argsort(self.values)
        return float(np.interp(value, self.values[order], self.gaps[order]))

    def value(self, gap: float) -> float:
        """Value of the finger joints, within their limits, that opens the fingers so far (m)."""
        return float(np.interp(gap, self.gaps, self.values))


def measure_hand(
    where: str,
    urdf: Path,
    tool: tuple[str, Array, Array],
    links: Sequence[str],
    fingers: Mapping[str, float],
    limits: tuple[float, float],
) -> HandShape:
    """Measure a hand on the hulls of its shapes.

    Args:
        where: file and field of the arm, for messages.
        urdf: the description's file.
        tool: link, and rotation (3, 3) and position (3,) of the tool frame in it.
        links: palm and fingers.
        fingers: the joints that open the hand, and what each makes of their common value: a factor.
            None for jaws that do not move.
        limits: of the common value.

    Raises:
        InputError: the links have no palm, or not a finger on either side of the tool.
    """
    hand = _Hand(urdf, tool, links, fingers)
    closed, opened = sorted(limits, key=lambda value: _spread(hand.shapes(value)))
    widest = hand.shapes(opened)
    sides = [_side(shape) for shape in widest]
    if set(sides) != {-1, 0, 1}:
        accepted = "a palm and a finger on either side of the tool frame's plane y = 0"
        raise InputError(f"{where}.hand_links", ", ".join(links), accepted)
    palm = max(shape[:, 0].max() for shape, side in zip(widest, sides, strict=True) if side == 0)
    values = np.linspace(closed, opened, _STEPS) if fingers else np.array([opened])
    shapes = [hand.shapes(value) for value in values]
    return HandShape(
        palm_front=float(palm),
        values=values,
        gaps=np.array([_gap(shape, sides) for shape in shapes]),
        radius=float(np.linalg.norm(np.concatenate(widest)[:, 1:], axis=1).max()),
        lever=_lever(shapes, values),
    )


class _Hand:
    def __init__(
        self,
        urdf: Path,
        tool: tuple[str, Array, Array],
        links: Sequence[str],
        fingers: Mapping[str, float],
    ) -> None:
        import pinocchio as pin  # heavy: only where a robot is measured

        self._model = pin.buildModelFromUrdf(str(urdf))
        self._data = self._model.createData()
        self._tool = self._model.getFrameId(tool[0]), pin.SE3(tool[1], tool[2])
        self._fingers = {
            self._model.joints[self._model.getJointId(joint)].idx_q: factor
            for joint, factor in fingers.items()
        }
        self._hulls = [
            (self._model.getFrameId(link), vertices)
            for link in links
            for vertices in link_hulls(urdf).get(link, ())
        ]

    def shapes(self, value: float) -> list[Array]:
        """Vertices of all shapes in the tool frame, at a value of the finger joints."""
        import pinocchio as pin

        q = pin.neutral(self._model)
        for index, factor in self._fingers.items():
            q[index] = factor * value
        pin.framesForwardKinematics(self._model, self._data, q)
        frame, offset = self._tool
        tool = self._data.oMf[frame] * offset
        placements = [(tool.actInv(self._data.oMf[link]), v) for link, v in self._hulls]
        return [v @ place.rotation.T + place.translation for place, v in placements]


def _spread(shapes: Sequence[Array]) -> float:
    """How far (m) the hand reaches along y."""
    return float(np.ptp(np.concatenate(shapes)[:, 1]))


def _lever(shapes: Sequence[Sequence[Array]], values: Array) -> float:
    """The fastest motion of a vertex from one value to the next, per unit of the value."""
    if len(values) == 1:
        return 0.0
    points = np.array([np.concatenate(hand) for hand in shapes])
    ways = np.linalg.norm(np.diff(points, axis=0), axis=-1).max(axis=1)
    return float((ways / np.abs(np.diff(values))).max())


def _side(shape: Array) -> int:
    """-1 or 1 for a finger right or left of the tool, 0 for the palm."""
    low, high = shape[:, 1].min(), shape[:, 1].max()
    return int(low > -_MIDDLE) - int(high < _MIDDLE)


def _gap(shapes: Sequence[Array], sides: Sequence[int]) -> float:
    """The smallest distance along y between the fingers, over the length that holds an object."""
    ahead = np.array([1.0, 0.0, 0.0])
    inner: dict[int, float] = {-1: np.inf, 1: np.inf}
    for shape, side in zip(shapes, sides, strict=True):
        if side and shape[:, 0].max() > -_LENGTH and shape[:, 0].min() < _LENGTH:
            held = between(shape, ahead, -_LENGTH, _LENGTH)
            inner[side] = min(inner[side], float((side * held[:, 1]).min()))
    return inner[1] + inner[-1]
