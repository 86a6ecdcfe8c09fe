"""Of several motions the one whose grips hold: what stands on a held box pulls at the pads, too."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

from guided_lgp.bounds.execution.forces import Grip, chosen_grips, loosest
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
    return best and _held(scene, *best)


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
    grips = chosen_grips(scene, motion.skeleton, motion.trajectory)
    load = max((grip.need for grip in grips), default=motion.load)
    return loosest(grips), replace(motion, load=load)


def _held(scene: Scene, worst: Grip, motion: PathResult) -> PathResult:
    """A motion, or where it would let a box slip."""
    assert motion.trajectory is not None
    if worst.fault is None:
        return motion
    switches = switches_of(scene, motion.skeleton, motion.trajectory)
    assert isinstance(switches, list)
    failure = Failure(
        action=switches.index(worst.start),
        constraint=worst.fault.constraint,
        violation=worst.fault.amount,
        tried="motions of several coarse solutions",
    )
    return PathResult(motion.skeleton, feasible=False, failure=failure)
