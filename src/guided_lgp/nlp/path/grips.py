"""Ways to hold a box: fingers across a graspable side, approach between the two flat sides."""

from dataclasses import dataclass

import numpy as np

from guided_lgp.nlp.results import Array
from guided_lgp.scene import Box
from guided_lgp.scene.pr2 import MAX_OPENING, PALM_FRONT

PALM_GAP = 0.002
"""Distance (m) of the palm's front from the box."""
FINGER_CLEARANCE = 0.008
"""By how much (m) the open fingers are wider than the box that they close on, at least."""
_PITCHES = np.pi * np.arange(9) / 8


@dataclass(frozen=True)
class Grips:
    """M ways to hold a box, all with the palm at the box."""

    rotation: Array
    """(M, 3, 3) of the tool frame in the box's: x is the approach, the fingers close along y."""
    offset: Array
    """(M, 3) of the tool frame's origin in the box's frame (m)."""
    width: Array
    """(M,) distance of the fingers (m)."""

    def tools(self, position: Array, rotation: Array) -> tuple[Array, Array]:
        """Rotations (M, 3, 3) and origins (M, 3) of the tool frame for a pose of the box."""
        return rotation @ self.rotation, position + self.offset @ rotation.T

    def __getitem__(self, index: int) -> "Grips":
        """One of them, as a set of one."""
        one = slice(index, index + 1)
        return Grips(self.rotation[one], self.offset[one], self.width[one])


def grips_of(box: Box) -> Grips:
    """The grid of grips: side that the fingers close on × pitch from one end over the top to the
    other × flip of the hand.
    """
    half = np.array(box.size) / 2
    up = np.array([0.0, 0.0, 1.0])
    rotations, offsets, widths = [], [], []
    for across in (0, 1):
        if box.size[across] + FINGER_CLEARANCE > MAX_OPENING:
            continue
        along = 1 - across
        for pitch in _PITCHES:
            approach = np.cos(pitch) * np.eye(3)[along] - np.sin(pitch) * up
            depth = half[along] * abs(np.cos(pitch)) + half[2] * abs(np.sin(pitch))
            for flip in (1.0, -1.0):
                closing = flip * np.eye(3)[across]
                rotations.append(
                    np.stack([approach, closing, np.cross(approach, closing)], axis=1)
                )
                offsets.append(-(depth + PALM_FRONT + PALM_GAP) * approach)
                widths.append(box.size[across])
    return Grips(np.array(rotations), np.array(offsets), np.array(widths))
