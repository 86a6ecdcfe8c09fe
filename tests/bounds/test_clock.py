"""The clock of an execution stops where hands press, as smoothly as moving arms need it."""

import numpy as np
import pytest
from motions import PR2

from guided_lgp.bounds.execution.clock import GRIP_S, Stop, moments, stops_at
from guided_lgp.bounds.results import Trajectory
from guided_lgp.bounds.verify.efforts import derivatives

RATE = 960
ARMS = len(PR2.joint_names)


def swing(share: float) -> Trajectory:
    """One joint moves all the time, at a share of its largest speed."""
    times = np.linspace(0.0, 4.0, 101)
    q = np.tile(np.r_[PR2.home, np.zeros(len(PR2.moving_joints) - ARMS)], (101, 1))
    q[:, 0] += share * PR2.velocity_limits[0] * (times - 2.0)
    return Trajectory(PR2.moving_joints, times, q, ())


def test_without_a_stop_it_is_the_time() -> None:
    clock = moments(2.0, [], RATE)
    assert np.allclose(clock, np.arange(len(clock)) / RATE, atol=1e-9)


@pytest.mark.parametrize("times", [(1.0,), (1.0, 1.1), (0.01, 3.99), (2.0, 4.0)])
def test_it_stops_long_enough_and_comes_to_the_end(times: tuple[float, ...]) -> None:
    clock = moments(4.0, [Stop(time, 0.8) for time in times], RATE)
    assert np.all(np.diff(clock) >= -1e-12)
    assert np.diff(clock).max() <= 1.001 / RATE
    assert clock[-1] == pytest.approx(4.0)
    for time in times:
        assert np.sum(np.abs(clock - time) < 1e-9) >= GRIP_S * RATE


def test_an_arm_that_moves_slows_down_within_its_limits() -> None:
    motion = swing(1.0)
    (stop,) = stops_at(PR2, motion, [50])
    clock = moments(4.0, [stop], RATE)
    q = np.interp(clock, motion.times, motion.q[:, 0])[:, None]
    times = np.arange(len(clock)) / RATE
    rates, changes = derivatives(q, times)
    assert np.abs(changes).max() < 0.51 * PR2.acceleration_limits[0]
    jerks = np.abs(np.diff(changes[:, 0])) * RATE
    assert np.quantile(jerks, 0.99) < PR2.jerk_limits[0]
    assert np.abs(rates).min() < 1e-6


def test_it_takes_no_longer_than_needed() -> None:
    (fast,), (slow,) = (stops_at(PR2, swing(share), [50]) for share in (1.0, 0.5))
    assert fast.ramp == pytest.approx(2 * slow.ramp)
    assert stops_at(PR2, swing(0.0), [50]) == [Stop(2.0, 0.0)]
