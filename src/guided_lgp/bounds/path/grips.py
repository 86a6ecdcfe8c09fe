"""Ways to hold a box: fingers across one of its sides, approach between its two ends."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np

from guided_lgp.bounds.program.grasp import INSET, PALM_GAP
from guided_lgp.bounds.results import Array
from guided_lgp.poses import pose, rotation_matrix
from guided_lgp.robots import Arm
from guided_lgp.scene import Box
from guided_lgp.scene.grasps import ROUND_TURNS, grasp_axes
from guided_lgp.scene.shapes import Convex

_PITCHES = 8
"""Steps of the approach from one end of the box over the top to the other."""
_SHIFTS = (0.0, 0.02, -0.02)
"""Offsets (m) of the hand along its third axis, across approach and fingers."""
_LEAST = 1e-9
"""Cosine that stands for a right angle."""
_DEPTHS = 3
"""Distances of the palm from the box: from the least one to where only the fingertips hold it."""


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


def grips_of(box: Box, arm: Arm) -> dict[float, tuple[Grips, Grips]]:
    """The grips of a box, by its width (m) between the fingers.

    Grids over sides of the box, pitch and flip of the hand: the deep and centred grips, and all
    others. Nothing for a box that is too wide for the hand; where the scene gives grasps, these.
    """
    if box.grasps:
        return _given(box, arm.fingers.grasp_width)
    return _grips(box.convex, arm.palm_front, arm.fingers.grasp_width)


def _given(box: Box, widest: float) -> dict[float, tuple[Grips, Grips]]:
    found: dict[float, list[_Frame]] = {}
    for grasp, width in zip(box.grasp_poses, box.grasp_widths, strict=True):
        if width <= widest:
            found.setdefault(width, []).append((rotation_matrix(grasp[3:]), grasp[:3]))
    return {width: (_stacked(frames), _stacked([])) for width, frames in found.items()}


@cache
def _grips(body: Convex, palm_front: float, widest: float) -> dict[float, tuple[Grips, Grips]]:
    found: dict[float, tuple[list[_Frame], list[_Frame]]] = {}
    for across, approach, shift in _approaches(body, widest):
        central, others = found.setdefault(body.size[across], ([], []))
        closing = np.eye(3)[across]
        third = np.cross(approach, closing)
        half, touched = np.array(body.half), np.array(body.side(across))
        touched[across] = np.inf
        if min(touched) <= INSET:
            continue
        reaches = _reaches(half, touched - INSET, palm_front, approach, shift * third)
        for number, reach in enumerate(reaches):
            offset = shift * third - reach * approach
            for flip in (1.0, -1.0):
                frame = np.stack([approach, flip * closing, flip * third], axis=1), offset
                (others if shift or number else central).append(frame)
    if body.shape == "cylinder":
        for central, others in found.values():
            others.extend(_all_around(central))
    return {width: (_stacked(one), _stacked(other)) for width, (one, other) in found.items()}


def _approaches(body: Convex, widest: float) -> Iterator[tuple[int, Array, float]]:
    """Axis that the fingers close along, approach of the hand (3,), and its shift (m).

    Where no upright sides are near enough to each other: top and bottom, level from each end.
    """
    axes, down = grasp_axes(body.size, widest), np.array([0.0, 0.0, -1.0])
    pitches = np.pi * np.arange(_PITCHES + 1) / _PITCHES
    for across, pitch, shift in product(axes, pitches, _SHIFTS):
        yield across, np.cos(pitch) * np.eye(3)[1 - across] + np.sin(pitch) * down, shift
    if not axes and body.size[2] <= widest:
        for along, sense in product(np.eye(3)[:2], (1.0, -1.0)):
            yield 2, sense * along, 0.0


_Frame = tuple[Array, Array]
"""Rotation and origin of the tool frame in the box's."""


def _all_around(frames: list[_Frame]) -> list[_Frame]:
    """Grips of a cylinder, turned about its axis."""
    turns = [rotation_matrix(pose(np.zeros(3), turn)[3:]) for turn in ROUND_TURNS]
    return [(turn @ rotation, turn @ offset) for turn in turns for rotation, offset in frames]


def _reaches(half: Array, inner: Array, palm_front: float, approach: Array, shift: Array) -> Array:
    """How far (m) the tool may stay behind the box's centre, deepest first; none that holds it."""
    palm = np.abs(approach) @ half + palm_front + PALM_GAP
    ahead = np.copysign(1.0, approach) * shift
    slope = np.maximum(np.abs(approach), _LEAST)
    nearest, farthest = max(palm, *((ahead - inner) / slope)), min((ahead + inner) / slope)
    return np.linspace(nearest, farthest, _DEPTHS if nearest <= farthest else 0)


def _stacked(grips: list[tuple[Array, Array]]) -> Grips:
    return Grips(
        np.array([rotation for rotation, _ in grips]).reshape(-1, 3, 3),
        np.array([offset for _, offset in grips]).reshape(-1, 3),
    )
