"""What a relational policy may see beside relations: sizes, and where boxes stand to each other.

All of it is the same in a mirror but for the yaw, whose sine changes its sign. Distances are given
once as they are and once as flags, so that a layer can ask for "near *and* taller".
"""

from dataclasses import dataclass

import numpy as np

from guided_lgp.policy.arrays import BoolArray, FloatArray

SIZES = ("length", "width", "height", "cosine of twice the yaw", "sine of twice the yaw")
"""Of every node."""
RELATIVE = ("ahead", "aside", "above")
"""Where the other box of a pair stands, in m / :data:`_FAR`."""

_GAPS = (0.01, 0.02, 0.03, 0.04, 0.05, 0.07)
_TOPS = (-0.04, -0.025, -0.01, 0.01)
BESIDE = (
    "gap",
    *(f"gap below {gap:g} m" for gap in _GAPS),
    "its top above this one's",
    *(f"its top above this one's by {top:g} m" for top in _TOPS),
)
"""What is between two boxes, and how their tops differ."""
_FAR = 0.2
_NEAR = 0.1


@dataclass(frozen=True)
class Sight:
    """The inputs beside relations, by their names."""

    nodes: tuple[str, ...] = ()
    edges: tuple[str, ...] = ()

    @property
    def known(self) -> bool:
        """Whether these are inputs that this program can compute."""
        return set(self.nodes) <= set(SIZES) and set(self.edges) <= set(PAIRS)


PAIRS = RELATIVE + BESIDE
"""Of every ordered pair of boxes that stand, from the first one's point of view."""
BLIND = Sight()
"""Relations alone."""
EVERYTHING = Sight(SIZES, PAIRS)


def node_inputs(shapes: FloatArray, side: float, sight: Sight) -> FloatArray:
    """(B, T, len(sight.nodes)) of one gripper.

    Args:
        shapes: (B, T, 4) half extents (m) and yaw (rad).
        side: sign of y on the gripper's own side.
        sight: which are wanted.
    """
    twice = 2 * shapes[..., 3:]
    every = [shapes[..., :3] / _NEAR, np.cos(twice), side * np.sin(twice)]
    chosen = [SIZES.index(name) for name in sight.nodes]
    inputs: FloatArray = np.concatenate(every, axis=-1, dtype=np.float32)[..., chosen]
    return inputs


def edge_inputs(
    positions: FloatArray, shapes: FloatArray, standing: BoolArray, sight: Sight
) -> FloatArray:
    """(B, T, T, len(sight.edges)); zero but for two boxes that stand.

    Args:
        positions: (B, T, 3) of the middle of each bottom (m).
        shapes: (B, T, 4) half extents (m) and yaw (rad).
        standing: (B, T) whether it is a box that no gripper holds.
        sight: which are wanted.
    """
    apart = positions[:, None] - positions[:, :, None]
    tops = positions[..., 2] + 2 * shapes[..., 2]
    higher = tops[:, None] - tops[:, :, None]
    gap = _gaps(apart[..., :2], shapes)
    ahead, aside, above = np.moveaxis(np.clip(apart / _FAR, -1, 1), -1, 0)
    every = [
        *(ahead, np.abs(aside), above),
        np.clip(gap / _NEAR, -1, 1),
        *(gap < limit for limit in _GAPS),
        np.clip(higher / _NEAR, -1, 1),
        *(higher > limit for limit in _TOPS),
    ]
    chosen = [every[PAIRS.index(name)] for name in sight.edges]
    pairs = standing[:, None] & standing[:, :, None] & ~np.eye(standing.shape[1], dtype=bool)
    inputs: FloatArray = np.stack(chosen, axis=-1, dtype=np.float32) * pairs[..., None]
    return inputs


def _gaps(apart: FloatArray, shapes: FloatArray) -> FloatArray:
    """(B, T, T) the widest gap (m) between two footprints along a side of either."""
    yaw = shapes[..., 3]
    axes = np.stack([np.cos(yaw), np.sin(yaw), -np.sin(yaw), np.cos(yaw)], axis=-1)
    axes = axes.reshape(*yaw.shape, 2, 2)  # (B, T, side, xy)
    widest = []
    for one in (axes[:, :, None], axes[:, None]):  # sides of the first box, then of the second
        between = np.abs(np.sum(apart[..., None, :] * one, axis=-1))
        for own in (axes[:, :, None], axes[:, None]):
            half = shapes[:, :, None, :2] if own.shape[2] == 1 else shapes[:, None, :, :2]
            reach = np.abs(np.sum(one[..., :, None, :] * own[..., None, :, :], axis=-1))
            between = between - np.sum(reach * half[..., None, :], axis=-1)
        widest.append(between.max(axis=-1))
    return np.asarray(np.maximum(*widest))
