"""Ways to hold a box: fingers across its narrower side, approach between its two ends."""

from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np

from guided_lgp.bounds.results import Array
from guided_lgp.robots import Arm
from guided_lgp.scene import Box
from guided_lgp.scene.model import grasp_axis

PALM_GAP = 0.002
"""Distance (m) of the palm's front from the box, at least."""
_PITCHES = 8
"""Steps of the approach from one end of the box over the top to the other."""
_SHIFTS = (0.0, 0.02, -0.02)
"""Offsets (m) of the hand along its third axis, across approach and fingers."""
_DEPTHS = (0.0, 0.02)
"""Distances (m) by which the hand may stay back from the deepest grasp."""
_INSET = 0.008
"""How far inside the box's side the fingertips' centre is (m), at least."""


@dataclass(frozen=True)
class Grips:
    """M ways to hold a box."""

    rotation: Array
    """(M, 3, 3) of the tool frame in the box's: x is the approach, the fingers close along y."""
    offset: Array
    """(M, 3) of the tool frame's origin in the box's frame (m)."""

    def __len__(self) -> int:
        return len(self.offset)

    def __add__(self, other: "Grips") -> "Grips":
        return Grips(
            np.concatenate([self.rotation, other.rotation]),
            np.concatenate([self.offset, other.offset]),
        )

    def tools(self, position: Array, rotation: Array) -> tuple[Array, Array]:
        """Rotations (M, 3, 3) and origins (M, 3) of the tool frame for a pose of the box."""
        return rotation @ self.rotation, position + self.offset @ rotation.T


def grips_of(box: Box, arm: Arm) -> tuple[Grips, Grips]:
    """Grids over pitch × flip of the hand: the deep and centred grips, and all others.

    Both are empty for a box that is too wide for the hand.
    """
    return _grips(box.size, arm.palm_front, arm.fingers.widest)


@cache
def _grips(
    size: tuple[float, float, float], palm_front: float, widest: float
) -> tuple[Grips, Grips]:
    half = np.array(size) / 2
    across = grasp_axis(size)
    along, closing = np.eye(3)[1 - across], np.eye(3)[across]
    central: list[tuple[Array, Array]] = []
    others: list[tuple[Array, Array]] = []
    pitches = np.pi * np.arange(_PITCHES + 1) / _PITCHES
    if 2 * half[across] > widest:
        pitches = pitches[:0]
    for pitch, shift, back, flip in product(pitches, _SHIFTS, _DEPTHS, (1.0, -1.0)):
        approach = np.cos(pitch) * along - np.sin(pitch) * np.array([0.0, 0.0, 1.0])
        depth = np.abs(approach) @ half + palm_front + PALM_GAP + back
        third = np.cross(approach, closing)
        offset = shift * third - depth * approach
        if np.all(np.abs(offset) <= half - _INSET):
            grip = np.stack([approach, flip * closing, flip * third], axis=1), offset
            (others if shift or back else central).append(grip)
    return _stacked(central), _stacked(others)


def _stacked(grips: list[tuple[Array, Array]]) -> Grips:
    return Grips(
        np.array([rotation for rotation, _ in grips]).reshape(-1, 3, 3),
        np.array([offset for _, offset in grips]).reshape(-1, 3),
    )
