"""The clock of a plan that is carried out: it stops where fingers have to press before all goes on.

Where another arm moves meanwhile, it slows down and takes up speed again smoothly: in the share of
a second T, u of which has passed, the speed of the clock is 3u² - 2u³ of that of the plan.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from guided_lgp.bounds.results import Array, Trajectory
from guided_lgp.robots import Robot

GRIP_S = 0.25
"""How long (s) a hand waits after its fingers have closed: until they press."""
_SHARE = 0.5
"""Of the acceleration limits, for what slowing down adds: the plan's own accelerations shrink with
the square of the speed meanwhile."""
_STEEPEST = 1.5
"""Largest slope of the speed, in units of 1 / T."""
_AROUND = 0.75
"""s before and after a stop in which speeds count."""
_STILL = 0.05
"""Share of its largest speed with which a joint is as good as at rest."""


@dataclass(frozen=True)
class Stop:
    """The clock stands still."""

    time: float
    """Of the plan (s)."""
    ramp: float
    """How long (s) it takes to stop, and then to be as fast as the plan."""


def stops_at(robot: Robot, trajectory: Trajectory, rows: Sequence[int]) -> list[Stop]:
    """Stops at some rows of a motion, as smooth as the arms that move then need them."""
    q, times = trajectory.joints(robot.joint_names), trajectory.times
    speeds = np.abs(np.diff(q, axis=0)) / np.diff(times)[:, None]
    return [_stop(robot, speeds, times, row) for row in sorted(set(rows))]


def _stop(robot: Robot, speeds: Array, times: Array, row: int) -> Stop:
    near = speeds[max(row - 1, 0) : row + 1]
    moving = (near > _STILL * robot.velocity_limits).any(axis=0)
    around = np.abs(times[:-1] - times[row]) < _AROUND
    slopes = speeds[around].max(axis=0, initial=0.0) / robot.acceleration_limits
    ramp = _STEEPEST / _SHARE * slopes[moving].max(initial=0.0)
    return Stop(float(times[row]), float(ramp))


def moments(end: float, stops: Sequence[Stop], rate: int) -> Array:
    """Where in a plan (s) the clock is at each step of a simulation, from 0 to its end.

    Args:
        end: of the plan (s).
        stops: in their order.
        rate: steps per second.
    """
    marks = [Stop(0.0, 0.0), *stops, Stop(end, 0.0)]
    parts = [np.zeros(1)]
    for one, other in pairwise(marks):
        parts.append(one.time + np.cumsum(_ways(one, other, rate)))
        if other is not marks[-1]:
            parts.append(np.full(round(GRIP_S * rate), other.time))
    return np.concatenate(parts)


def _ways(one: Stop, other: Stop, rate: int) -> Array:
    """How far (s) the clock of the plan goes at each step between two stops."""
    way = other.time - one.time
    up, down = (_rising(stop.ramp, rate) for stop in (one, other))
    steady = int(np.ceil(max(way * rate - up.sum() - down.sum(), way > 0)))
    speeds = np.concatenate([up, np.ones(steady), down[::-1]])
    return np.asarray(speeds * way / speeds.sum())


def _rising(ramp: float, rate: int) -> Array:
    """The speed of the clock at the steps of a ramp (s), as a share of that of the plan."""
    steps = round(ramp * rate)
    done = (np.arange(steps) + 0.5) / max(steps, 1)
    return done**2 * (3 - 2 * done)
