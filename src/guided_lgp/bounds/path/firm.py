"""Of several motions the one whose grips hold: what stands on a held box pulls at the pads, too."""

from collections.abc import Iterator
from dataclasses import replace

from guided_lgp.bounds.execution.forces import MOST, Grip, grips_of
from guided_lgp.bounds.results import Failure, PathResult
from guided_lgp.bounds.terms.steady import RATIO
from guided_lgp.bounds.verify.attachments import switches_of
from guided_lgp.scene import Scene

_ROUNDING = 1e-6
"""Of a ratio that a force just meets."""


def firmest(scene: Scene, motions: Iterator[PathResult]) -> PathResult | None:
    """The first motion whose grips hold firmly, or else the firmest that holds.

    If none holds, it says which grip of the best one does not.

    Args:
        scene: the initial configuration.
        motions: verified; no more of them are asked for than needed.
    """
    best: tuple[Grip, PathResult] | None = None
    for motion in motions:
        grips = _chosen_grips(scene, motion)
        worst = max(grips, key=lambda grip: grip.ratio, default=None)
        if worst is None:
            return motion
        loaded = replace(motion, load=max(grip.need for grip in grips))
        if worst.ratio <= RATIO + _ROUNDING:
            return loaded
        if best is None or worst.ratio < best[0].ratio:
            best = worst, loaded
    if best is None or best[0].ratio <= MOST:
        return best and best[1]
    return _refused(scene, *best)


def _chosen_grips(scene: Scene, motion: PathResult) -> list[Grip]:
    """Those that the motion chooses."""
    assert motion.trajectory is not None
    grips = grips_of(scene, motion.skeleton, _switches(scene, motion), motion.trajectory)
    return [grip for grip in grips if grip.start > 0]


def _refused(scene: Scene, grip: Grip, motion: PathResult) -> PathResult:
    """A motion with a grip whose pads would slip."""
    failure = Failure(
        action=_switches(scene, motion).index(grip.start),
        constraint=f"grip {grip.gripper} {grip.box}",
        violation=grip.ratio - MOST,
        tried="motions of several coarse solutions",
    )
    return PathResult(motion.skeleton, feasible=False, failure=failure)


def _switches(scene: Scene, motion: PathResult) -> list[int]:
    assert motion.trajectory is not None
    rows = switches_of(scene, motion.skeleton, motion.trajectory)
    assert isinstance(rows, list)
    return rows
