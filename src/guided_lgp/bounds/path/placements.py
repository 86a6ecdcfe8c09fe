"""Where a box may stand on its support: the coarse bound's place, its half turn, and samples.

Placements are rows (x, y, yaw) of the box's centre in the frame of its support's top (m, rad).
"""

from collections.abc import Sequence

import numpy as np

from guided_lgp.bounds.results import Array
from guided_lgp.poses import compose, inverse, pose, yaw_of
from guided_lgp.scene.footprints import gaps

MARGIN = 0.02
"""Distance (m) of a centre of mass from the edge of what it stands on."""
_JITTER = np.array([0.006, 0.006, 0.08])
_SAMPLES_DRAWN = 120


def placement_of(support: Array, box: Array) -> Array:
    """The placement (3,) of a box by the poses (7,) of the support's top and of the box."""
    relative = compose(inverse(support), box)
    return np.array([relative[0], relative[1], float(yaw_of(relative))])


def placed(support: Array, placement: Array, half_height: float) -> Array:
    """The pose (7,) of a box that stands level on its support."""
    upright = pose(support[:3], float(yaw_of(support)))
    x, y, yaw = placement
    return compose(upright, pose((x, y, half_height), yaw))


def alternatives(
    reference: Array,
    support_half: Array,
    half: Array,
    masses: Array,
    others: Sequence[tuple[Array, Array]],
    clearance: float,
    anywhere: bool,
    rng: np.random.Generator,
    count: int,
) -> list[Array]:
    """Other placements than the coarse bound's, the nearest ones first.

    Args:
        reference: the coarse placement.
        support_half: half extents (2,) of the support's top.
        half: half extents (2,) of the box.
        masses: (n, 2) centres of mass in the box's frame: its own, and with what it will carry.
        others: placement and half extents (2,) of the boxes that stand there or will.
        clearance: distance (m) from the others.
        anywhere: sample the whole support; otherwise vary the coarse placement a little, since
            what stands below depends on it for its balance.
        rng: source of randomness.
        count: largest number of samples to return.
    """
    half_turn = reference + np.array([0.0, 0.0, np.pi])
    if anywhere:
        low = np.array([*-support_half, -np.pi])
        drawn = rng.uniform(low, -low, (_SAMPLES_DRAWN, 3))
    else:
        drawn = np.concatenate([reference + _JITTER * rng.standard_normal((count // 2, 3))] * 2)
        drawn[count // 2 :, 2] += np.pi
    c, s = np.cos(drawn[:, 2]), np.sin(drawn[:, 2])
    x = drawn[:, :1] + c[:, None] * masses[:, 0] - s[:, None] * masses[:, 1]
    y = drawn[:, 1:2] + s[:, None] * masses[:, 0] + c[:, None] * masses[:, 1]
    inside = np.all(
        (np.abs(x) <= support_half[0] - MARGIN) & (np.abs(y) <= support_half[1] - MARGIN),
        axis=1,
    )
    drawn = drawn[inside]
    distance = np.hypot(drawn[:, 0] - reference[0], drawn[:, 1] - reference[1])
    drawn = drawn[np.argsort(distance, kind="stable")]
    if others:
        standing = np.concatenate([_corners(place[None], size) for place, size in others])
        drawn = drawn[np.all(gaps(_corners(drawn, half), standing) >= clearance, axis=1)]
    return [half_turn, *drawn[:count]]


def _corners(placements: Array, half: Array) -> Array:
    """Corners (n, 4, 2) of a box with half extents (2,) at placements (n, 3)."""
    c, s = np.cos(placements[:, 2]), np.sin(placements[:, 2])
    turn = np.stack([c, s, -s, c], axis=-1).reshape(-1, 2, 2)
    corners = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]) * half
    return np.asarray(corners @ turn + placements[:, None, :2])
