"""Of several motions the one whose grips hold: what stands on a held box pulls at the pads, too."""

from collections.abc import Iterator

from guided_lgp.bounds.deadline import OutOfTimeError
from guided_lgp.bounds.execution.forces import RATIO, grips_of
from guided_lgp.bounds.results import PathResult
from guided_lgp.bounds.verify.attachments import switches_of
from guided_lgp.scene import Scene

_ROUNDING = 1e-6
"""Of a ratio that a force just meets."""


def firmest(scene: Scene, motions: Iterator[PathResult]) -> PathResult | None:
    """The first motion whose grips hold, or else the one whose worst grip holds best.

    Args:
        scene: the initial configuration.
        motions: verified; no more of them are asked for than needed, nor when time is over.

    Raises:
        OutOfTimeError: before there was any motion.
    """
    best: tuple[float, PathResult] | None = None
    try:
        for motion in motions:
            load = _load(scene, motion)
            if best is None or load < best[0]:
                best = load, motion
            if load <= RATIO + _ROUNDING:
                break
    except OutOfTimeError:
        if best is None:
            raise
    return best[1] if best else None


def _load(scene: Scene, motion: PathResult) -> float:
    """The largest share of what its pads can carry that any grip of a motion has to."""
    assert motion.trajectory is not None
    rows = switches_of(scene, motion.skeleton, motion.trajectory)
    assert isinstance(rows, list)
    grips = grips_of(scene, motion.skeleton, rows, motion.trajectory)
    return max((grip.ratio for grip in grips), default=0.0)
