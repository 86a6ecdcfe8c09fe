"""Of several motions the one whose grips hold: what stands on a held box pulls at the pads, too."""

from collections.abc import Iterable, Iterator
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
        worst, loaded = _loaded(scene, motion)
        if worst is None or _is_firm(worst):
            return loaded
        if best is None or worst.ratio < best[0].ratio:
            best = worst, loaded
    if best is None or best[0].ratio <= MOST:
        return best and best[1]
    return _refused(scene, *best)


def firm_ones(scene: Scene, motions: Iterable[PathResult]) -> Iterator[PathResult]:
    """Those motions whose grips all hold firmly."""
    for motion in motions:
        worst, loaded = _loaded(scene, motion)
        if worst is None or _is_firm(worst):
            yield loaded


def _is_firm(grip: Grip) -> bool:
    return grip.ratio <= RATIO + _ROUNDING


def _loaded(scene: Scene, motion: PathResult) -> tuple[Grip | None, PathResult]:
    """The worst of the grips that a motion chooses, if any, and the motion with their load."""
    assert motion.trajectory is not None
    grips = grips_of(scene, motion.skeleton, _switches(scene, motion), motion.trajectory)
    chosen = [grip for grip in grips if grip.start > 0]
    load = max((grip.need for grip in chosen), default=motion.load)
    worst = max(chosen, key=lambda grip: grip.ratio, default=None)
    return worst, replace(motion, load=load)


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
