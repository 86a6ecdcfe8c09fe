"""Time laws with limited jerk, on a clock that all arms share.

A path is first followed as fast as velocities and accelerations allow. Then every configuration
becomes the mean of those of the last moments: an acceleration that jumped from one limit to the
other now takes a while for it. Every motion lasts a whole number of ticks, so that the motions of
several arms have common rows: as few as keep the limits of velocity, acceleration and jerk from row
to row.
"""

import numpy as np

from guided_lgp.bounds.path.assembly import Clock
from guided_lgp.bounds.path.motions import Motion
from guided_lgp.bounds.path.timing import Law, fastest_law
from guided_lgp.bounds.results import Array
from guided_lgp.robots import Arm
from guided_lgp.robots.robot import Fingers

TICK = 0.025
"""Time (s) between two rows: so little that a smooth curve through them, as controllers follow it,
stays within a millimetre of the straight lines between them."""
_WINDOWS = (4, 8, 6, 3, 2)
"""Ticks over which configurations may be averaged: a jump from one acceleration limit to the other
needs the first, which is the best most often; several in a row, on a path that winds, need more,
and one by a single limit needs the last."""
_FINE = 2
"""Samples per tick that are averaged."""
_SHARE = 0.99
"""Share of the limits that is used, so that the rounded rows keep them too."""
_FINGER_SHARE = 0.97
"""Share of their velocity limit at which fingers move."""
_REST = 2
"""Ticks between two motions of one arm, at most: jerks at their ends do not add up then."""


def jerk_limited(path: Array, arm: Arm, slower: float = 1.0) -> Array:
    """Follow a path of one arm from rest to rest.

    Args:
        path: configurations (m, n) in rad, close enough for a cubic spline to stay on the path.
        arm: whose it is.
        slower: how many times longer it takes than it could.

    Returns:
        Configurations (T, n), one per tick.
    """
    law = fastest_law(path, arm, _SHARE)
    if law.duration == 0.0:
        return law.path
    fewest = _followed(law, arm, slower, _WINDOWS[0])
    for window in _WINDOWS[1:]:
        fewest = _followed(law, arm, slower, window, fewest)
    return fewest


def _followed(
    law: Law, arm: Arm, slower: float, window: int, otherwise: Array | None = None
) -> Array:
    """The fewest rows of a law, averaged over some ticks, that keep the limits; or others (T, n),
    if these are as few.
    """
    ticks = int(np.ceil(slower * law.duration / TICK)) + window
    while otherwise is None or ticks < len(otherwise) - 1:
        rows = _averaged(law, ticks, window)
        excess = _excess(rows, arm, slower)
        if excess <= 1.0:
            return rows
        ticks = max(ticks + 1, int(excess * ticks) - 1)
    return otherwise


def ramp(fingers: Fingers, start: float, end: float) -> Array:
    """Values (T,) of fingers from one to another, one per tick, without a jump of the speed."""
    duration = abs(end - start) / (_FINGER_SHARE * fingers.velocity)
    moving = int(np.ceil(duration / TICK - 1e-9))
    if moving == 0:
        return np.array([start])
    shares = _fine_times(moving + _WINDOWS[-1], _WINDOWS[-1]) / (moving * TICK)
    values = start + (end - start) * _means(np.clip(shares, 0.0, 1.0)[:, None], _WINDOWS[-1])[:, 0]
    values[-1] = end
    return np.asarray(values)


def _follow(motion: Motion, slower: float, before: Array) -> tuple[Array, Array]:
    rows = jerk_limited(motion.path, motion.arm, slower)
    for _ in range(_REST if len(rows) > 1 else 0):
        if _excess(np.concatenate([before, rows[1:]]), motion.arm) <= 1.0:
            break
        rows = np.pad(rows, ((1, 0), (0, 0)), mode="edge")
    return _ticks(len(rows)), rows


def _ramp(fingers: Fingers, start: Array, value: float) -> tuple[Array, Array]:
    end = fingers.ratios * value
    way = float(np.abs(end - start).max(initial=0.0))
    shares = ramp(fingers, 0.0, way) / (way or 1.0)
    return _ticks(len(shares)), np.outer(1.0 - shares, start) + np.outer(shares, end)


def _ticks(count: int) -> Array:
    return TICK * np.arange(count, dtype=float)


SMOOTH = Clock(_follow, _ramp)
"""Within limited jerk, too, for one motion after the other."""


def _averaged(law: Law, ticks: int, window: int) -> Array:
    """Means (ticks + 1, n) over the window of every row of a law that is followed slower."""
    slower = (ticks - window) * TICK / law.duration
    times = np.clip(_fine_times(ticks, window) / slower, 0.0, law.duration)
    rows = _means(law(times), window)
    rows[0], rows[-1] = law.path[0], law.path[-1]
    return rows


def _fine_times(ticks: int, window: int) -> Array:
    """Times at which rows are sampled, from the first row's window on, which is before zero."""
    return np.asarray(TICK / _FINE * (np.arange((ticks + window) * _FINE) + 0.5) - window * TICK)


def _means(samples: Array, window: int) -> Array:
    """Means (ticks + 1, n) of samples (m, n) over the window before every tick."""
    sums = np.cumsum(np.pad(samples, ((1, 0), (0, 0))), axis=0)
    wide = window * _FINE
    return np.asarray((sums[wide::_FINE] - sums[:-wide:_FINE]) / wide)


def _excess(rows: Array, arm: Arm, slower: float = 1.0) -> float:
    """The factor on time that brings rows (T, n) within the limits, before and after at rest.

    What is to be slower is so in velocity and acceleration: they are what tips a load.
    """
    rates = np.diff(np.pad(rows, ((3, 3), (0, 0)), mode="edge"), axis=0) / TICK
    changes = np.diff(rates, axis=0) / TICK
    jerks = np.diff(changes, axis=0) / TICK
    limits = (
        _SHARE * arm.velocity_limits / slower,
        _SHARE * arm.acceleration_limits / slower**2,
        _SHARE * arm.jerk_limits,
    )
    shares = [
        float(np.max(np.abs(values) / limit))
        for values, limit in zip((rates, changes, jerks), limits, strict=True)
    ]
    return float(max(shares[0], shares[1] ** (1 / 2), shares[2] ** (1 / 3)))
