"""From geometric paths to a trajectory: time-optimal within velocity and acceleration limits."""

import logging
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from types import ModuleType

import numpy as np

from guided_lgp.bounds.results import Array
from guided_lgp.robots import Arm


@contextmanager
def _without_plots() -> Iterator[None]:
    """Stand in for matplotlib while toppra is imported: it would load it, for plots, in 0.4 s."""
    absent = {"matplotlib", "matplotlib.pyplot"} - sys.modules.keys()
    sys.modules.update({name: ModuleType(name) for name in absent})
    try:
        yield
    finally:
        for name in absent:
            del sys.modules[name]


with _without_plots():
    import toppra
    import toppra.algorithm
    import toppra.constraint

INTERVAL = 0.05
"""Longest time (s) between two rows of a trajectory."""
_SHARE = 0.97
"""Share of the limits that is used, so that the rounded rows keep them too."""
_GRID_STEP = 0.04
"""Distance (m of the arm's motion) of toppra's grid points."""

logging.getLogger("toppra").setLevel(logging.ERROR)


def time_path(path: Array, arm: Arm) -> tuple[Array, Array]:
    """Follow a path of one arm from rest to rest.

    Args:
        path: configurations (m, n) in rad, close enough for a cubic spline to stay on the path.
        arm: whose it is.

    Returns:
        times (T,) from 0 (s), and configurations (T, n).
    """
    lengths = np.sum(np.abs(np.diff(path, axis=0)) * arm.reaches, axis=1)
    path = path[np.concatenate([[True], lengths > 1e-9])]
    s = np.concatenate([[0.0], np.cumsum(lengths[lengths > 1e-9])])
    if len(path) == 1:
        return np.zeros(1), path
    curve = toppra.SplineInterpolator(s, path, bc_type="natural")
    velocity = _SHARE * arm.velocity_limits
    acceleration = _SHARE * arm.acceleration_limits
    instance = toppra.algorithm.TOPPRA(
        [
            toppra.constraint.JointVelocityConstraint(np.stack([-velocity, velocity], axis=1)),
            toppra.constraint.JointAccelerationConstraint(
                np.stack([-acceleration, acceleration], axis=1)
            ),
        ],
        curve,
        gridpoints=np.linspace(0.0, s[-1], max(10, int(s[-1] / _GRID_STEP))),
        parametrizer="ParametrizeConstAccel",
    )
    trajectory = instance.compute_trajectory(0, 0)
    count = 1 + int(np.ceil(trajectory.duration / INTERVAL))
    times, step = np.linspace(0.0, trajectory.duration, count, retstep=True)
    rows = np.asarray(trajectory(times))
    rows[0], rows[-1] = path[0], path[-1]
    return times * _stretch(rows, float(step), velocity, acceleration), rows


def _stretch(rows: Array, step: float, velocity: Array, acceleration: Array) -> float:
    """The factor on time that keeps the limits between toppra's grid points, too.

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
