"""Proofs about room: on a support, below what covers it, on a body's sides for fingertips."""

from collections.abc import Iterator, Sequence

import numpy as np

from guided_lgp.bounds.program.grasp import INSET
from guided_lgp.scene import Box, Scene, Table
from guided_lgp.scene.bodies import Body
from guided_lgp.scene.footprints import inner_radius, inset, seat
from guided_lgp.scene.grasps import grasp_axes
from guided_lgp.scene.tolerances import MARGIN
from guided_lgp.search.finding import Finding

_ROUNDING = 1e-6
"""By how much (m) numbers of a scene that should be the same may differ."""


def untouchable(box: Box, widest: float) -> Iterator[Finding]:
    """No two sides, up to ``widest`` (m) from each other, have room for fingertips."""
    axes = grasp_axes(box.size, widest) or (2,)
    if box.grasps or any(np.delete(box.convex.side(k), k).min() > INSET for k in axes):
        return
    if box.shape == "mesh":
        text = f"{box.name} has no two parallel faces, across its x or y, for fingers to close on"
        yield Finding("width", text, "a frame in which it has; or grasps of its own")
    else:
        text = f"{box.name} is too small for the fingers: they need {2 * INSET:.3f} m of its sides"
        yield Finding("width", f"{text} either way", "a larger body; or grasps of its own")


def cover(scene: Scene, support: Table | Box, box: Box) -> Body | None:
    """What is above all of a support, but not as high above it as a box is high."""
    top, level = support.top[2], (o for o in scene.obstacles if o.quaternion is None)
    for other in (*scene.supports, *level):
        bottom = other.placement[2] - other.convex.half[2]
        low = top < bottom < top + box.size[2] - MARGIN
        if low and inset(seat(other), seat(support)).min() >= -_ROUNDING:
            return other
    return None


def crowded(support: Table | Box, boxes: Sequence[Box], counterweights: bool) -> Iterator[Finding]:
    """Too many boxes on one support, however they are turned.

    Around its middle every box has a disc to itself, and the middle is above the support, but for
    a counterweight, which shifts it within the box.
    """
    half = np.array(support.convex.rest) + counterweights * max(map(_longest, boxes), default=0.0)
    yield from _discs(support, boxes, 2 * float(np.hypot(*half)))
    covered = sum(4 * box.convex.half[0] * box.convex.half[1] for box in boxes)
    free = 4 * float(np.prod(half + max(map(_longest, boxes), default=0.0)))
    if len(boxes) > 1 and all(box.shape == "box" for box in boxes) and covered > free:
        names = ", ".join(box.name for box in boxes)
        yield Finding(
            "room",
            f"no room on {support.name} for {names}: they cover {covered:.3f} m², and no more than "
            f"{free:.3f} m² is above and around it",
            "a larger support, or another one for some of them",
        )


def _discs(support: Table | Box, boxes: Sequence[Box], most: float) -> Iterator[Finding]:
    """Two boxes whose middles can be no farther apart than ``most`` (m)."""
    for i, one in enumerate(boxes):
        for other in boxes[:i]:
            need = inner_radius(one) + inner_radius(other) - MARGIN
            if need > most:
                yield Finding(
                    "room",
                    f"no room on {support.name} for {other.name} and {one.name}: their middles "
                    f"would be {need:.3f} m apart at least, and can be {most:.3f} m at most",
                    "a larger support, or another one for one of them",
                )


def is_wide_for(support: Table | Box, one: Box, other: Box) -> bool:
    """Whether two boxes have a place beside each other, however they are turned."""
    return max(support.convex.rest) >= _longest(one) + _longest(other)


def _longest(box: Box) -> float:
    """How far (m) a corner of a box is from its middle."""
    return float(np.hypot(*box.convex.half[:2]))
