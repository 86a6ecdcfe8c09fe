"""From geometric paths to a trajectory: time-optimal within velocity and acceleration limits.

This is time-optimal path parameterization by reachability analysis (TOPP-RA; Pham and Pham, 2018).
With x the squared and u the half derivative of the squared path velocity, the limits at a grid
point are |a_j u + b_j x| <= g_j, and x_i+1 = x_i + 2 (s_i+1 - s_i) u_i. A pass backwards finds the
largest x_i from which the end can be reached at rest, a pass forwards takes the largest x_i+1.

Both are linear programs in two variables. At the largest x two of their rows meet, one that keeps
u below something and one that keeps it above; so x is the smallest of the numbers at which pairs of
rows meet. All pairs but those with the row of the neighbour are the same whatever the neighbour's x
is, and those with it are affine in it: a step of a pass is the minimum of a few affine functions.
"""

import ctypes
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from guided_lgp.bounds.path.spline import Cubic
from guided_lgp.bounds.results import Array
from guided_lgp.compiled import address, load_compiled
from guided_lgp.robots import Arm

INTERVAL = 0.04
"""Longest time (s) between two rows of a trajectory: a controller's curve through them then stays
within a millimetre of the straight lines between them."""
_SHARE = 0.97
"""Share of the limits that is used, so that the rounded rows keep them too."""
_GRID_STEP = 0.04
"""Distance (m of the arm's motion) of grid points."""
_NEAR = 1e-4
"""Distance (m of the arm's motion) up to which points of a path count as one: a spline through
both would bend between them so sharply that the arm had to creep."""
_SLOWEST = 1e-10
"""Squared path velocity (m^2/s^2) between the ends, at least: rounding must not bring a stop."""
_CREEPING = 1e-3
"""Path velocity (m/s) below which an arm creeps: 4 cm then take 20 s and more."""
_STILL = 1e-10
"""Derivative (rad/m) below which a joint does not move along the path."""


def time_path(path: Array, arm: Arm) -> tuple[Array, Array]:
    """Follow a path of one arm from rest to rest.

    Args:
        path: configurations (m, n) in rad, close enough for a cubic spline to stay on the path.
        arm: whose it is.

    Returns:
        times (T,) from 0 (s), and configurations (T, n).
    """
    law = fastest_law(path, arm, _SHARE)
    if law.duration == 0.0:
        return np.zeros(1), law.path
    count = 1 + int(np.ceil(law.duration / INTERVAL))
    times, step = np.linspace(0.0, law.duration, count, retstep=True)
    rows = law(times)
    velocity, acceleration = _SHARE * arm.velocity_limits, _SHARE * arm.acceleration_limits
    return times * _stretch(rows, float(step), velocity, acceleration), rows


@dataclass(frozen=True)
class Law:
    """Where an arm is on a path that it follows from rest to rest."""

    path: Array
    """(m, n) rad"""
    curve: Cubic | None
    """Through the path; None where that is one configuration."""
    grid: Array
    """(N + 1,) parameters of the curve."""
    speeds: Array
    """(N + 1,) velocities of the parameter there."""
    moments: Array
    """(N + 1,) s, when it is there."""

    @property
    def duration(self) -> float:
        """How long it takes (s)."""
        return float(self.moments[-1])

    def __call__(self, times: Array) -> Array:
        """Configurations (k, n) at ascending times (k,) from 0 to ``duration``."""
        if self.curve is None:
            return np.repeat(self.path, len(times), axis=0)
        rows = np.asarray(self.curve(_along(self.grid, self.speeds, self.moments, times)))
        rows[times <= 0.0], rows[times >= self.duration] = self.path[0], self.path[-1]
        return rows


def fastest_law(path: Array, arm: Arm, share: float) -> Law:
    """The fastest law for a path (m, n) of one arm within a share of its limits."""
    path = path[_apart(_lengths(path, arm))]
    s = np.concatenate([[0.0], np.cumsum(_lengths(path, arm))])
    if len(path) == 1:
        return Law(path, None, s, s, s)
    curve = Cubic(s, path)
    velocity, acceleration = share * arm.velocity_limits, share * arm.acceleration_limits
    grid = np.linspace(0.0, s[-1], max(10, int(s[-1] / _GRID_STEP)))
    speeds = _speeds(grid, *curve.derivatives(grid), velocity, acceleration)
    return Law(path, curve, grid, speeds, _moments(grid, speeds))


def _speeds(
    grid: Array, slopes: Array, bends: Array, velocity: Array, acceleration: Array
) -> Array:
    """The path velocities (N + 1,) of the fastest law, with the arguments of :func:`fastest`.

    Of the laws on a grid, the one that is always as fast as it can be may run into a bend at which
    it can only stop. Backwards it comes from the other side, and most often does not.
    """
    speeds = np.sqrt(fastest(grid, slopes, bends, velocity, acceleration))
    if speeds[1:-1].min() >= _CREEPING:
        return speeds
    turned = grid[-1] - grid[::-1], -slopes[::-1], np.ascontiguousarray(bends[::-1])
    back = np.sqrt(fastest(*turned, velocity, acceleration))[::-1]
    return min(speeds, back, key=lambda found: _moments(grid, found)[-1])


def _moments(grid: Array, speeds: Array) -> Array:
    """When (N + 1,) a law is at its grid points."""
    return np.concatenate([[0.0], np.cumsum(2 * np.diff(grid) / (speeds[1:] + speeds[:-1]))])


def fastest(
    grid: Array, slopes: Array, bends: Array, velocity: Array, acceleration: Array
) -> Array:
    """The largest squared path velocities (N + 1,) from rest to rest.

    Args:
        grid: (N + 1,) path parameters.
        slopes: (N + 1, n) first derivatives of the path.
        bends: (N + 1, n) second derivatives.
        velocity: (n,) limits (rad/s).
        acceleration: (n,) limits (rad/s^2).
    """
    library = _library()
    if library is None:
        return fastest_in_numpy(grid, slopes, bends, velocity, acceleration)
    x = np.empty(len(grid))
    arrays = (grid, slopes, bends, velocity, acceleration)
    limits = (ctypes.c_double(_STILL), ctypes.c_double(_SLOWEST))
    library.fastest(*slopes.shape, *map(address, arrays), *limits, address(x))
    return x


def fastest_in_numpy(
    grid: Array, slopes: Array, bends: Array, velocity: Array, acceleration: Array
) -> Array:
    """The same without a compiler."""
    double = 2 * np.diff(grid)[:, None]
    # The limits of a point hold at its neighbour, too, for the same u.
    a = np.hstack([slopes[:-1], slopes[1:] + double * bends[1:]])
    b = np.hstack([bends[:-1], bends[1:]])
    g = np.tile(acceleration, 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        moves = np.abs(a) > _STILL
        width = np.where(moves, g / np.abs(a), np.inf)  # of the interval of u at x = 0 ...
        drift = np.where(moves, b / a, 0.0)  # ... which moves by this with x, downwards
        at_rest = np.where(moves, np.inf, g / np.abs(b)).min(axis=1)
        limits = (velocity / np.abs(slopes)).min(axis=1) ** 2
        pairs = (width[:, :, None] + width[:, None, :]) / (drift[:, :, None] - drift[:, None, :])
        stops = width / (drift - 1 / double)
        offset, factor = double * width, 1 - double * drift
        back, rest = 1 / factor, offset / factor
    most = np.minimum(limits[:-1], at_rest)
    most = np.minimum(most, np.where(pairs > 0, pairs, np.inf).min(axis=(1, 2)))
    most = np.minimum(most, np.where(stops > 0, stops, np.inf).min(axis=1))
    back, rest = np.where(factor > 0, back, 0.0), np.where(factor > 0, rest, np.inf)
    x = np.zeros(len(grid))
    for i in reversed(range(1, len(most))):
        x[i] = min(most[i], (back[i] * x[i + 1] + rest[i]).min())
    for i in range(len(most) - 1):
        x[i + 1] = max(_SLOWEST, min(x[i + 1], (factor[i] * x[i] + offset[i]).min()))
    return x


def _lengths(path: Array, arm: Arm) -> Array:
    """How far (m) the arm moves between the configurations of a path: (m - 1,)."""
    return np.asarray(np.sum(np.abs(np.diff(path, axis=0)) * arm.metric, axis=1))


def _apart(lengths: Array) -> NDArray[np.bool_]:
    """Which points of a path (m,) a spline goes through: of near ones one, but always both ends."""
    apart = np.concatenate([[True], lengths > _NEAR])
    if lengths.sum() > 1e-9:  # beyond rounding: it moves at all
        apart[np.flatnonzero(apart)[-1]] = False
        apart[[0, -1]] = True
    return apart


def _along(grid: Array, speeds: Array, moments: Array, times: Array) -> Array:
    """Path parameters at times: constant acceleration between grid points."""
    i = np.clip(np.searchsorted(moments, times, side="right") - 1, 0, len(grid) - 2)
    since, lasts = times - moments[i], moments[i + 1] - moments[i]
    gain = (speeds[i + 1] - speeds[i]) / lasts
    return np.asarray(grid[i] + since * (speeds[i] + 0.5 * since * gain))


def _stretch(rows: Array, step: float, velocity: Array, acceleration: Array) -> float:
    """The factor on time that keeps the limits between grid points, too.

    Finite differences of rows (T, n) at equal steps (s), before and after at rest.
    """
    rates = np.diff(rows, axis=0) / step
    changes = np.diff(np.pad(rates, ((1, 1), (0, 0))), axis=0) / step
    changes[[0, -1]] *= 2.0  # from rest to the middle of the first interval: half a step
    excess = max(
        np.max(np.abs(rates) / velocity),
        np.sqrt(np.max(np.abs(changes) / acceleration)),
    )
    return max(1.0, float(excess))


@cache
def _library() -> ctypes.CDLL | None:
    source = Path(__file__).with_name("timing.c").read_text(encoding="utf-8")
    return load_compiled("timing", source)
