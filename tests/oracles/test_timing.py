"""The timing of motions against toppra, the implementation by the method's authors."""

import logging

import numpy as np
import pytest
import toppra
import toppra.algorithm
import toppra.constraint

from guided_lgp.bounds.path.timing import time_path
from guided_lgp.robots import Arm, load_robot

logging.getLogger("toppra").setLevel(logging.ERROR)


def _duration(path: np.ndarray, arm: Arm) -> float:
    """The time (s) at 97 % of the limits, on a grid of 4 cm of the arm's motion."""
    lengths = np.sum(np.abs(np.diff(path, axis=0)) * arm.metric, axis=1)
    s = np.concatenate([[0.0], np.cumsum(lengths)])
    limits = [
        toppra.constraint.JointVelocityConstraint(_both_ways(0.97 * arm.velocity_limits)),
        toppra.constraint.JointAccelerationConstraint(_both_ways(0.97 * arm.acceleration_limits)),
    ]
    instance = toppra.algorithm.TOPPRA(
        limits,
        toppra.SplineInterpolator(s, path, bc_type="natural"),
        gridpoints=np.linspace(0.0, s[-1], max(10, int(s[-1] / 0.04))),
        parametrizer="ParametrizeConstAccel",
    )
    return float(instance.compute_trajectory(0, 0).duration)


def _both_ways(limits: np.ndarray) -> np.ndarray:
    return np.stack([-limits, limits], axis=1)


@pytest.mark.parametrize("robot", ["pr2", "panda", "ur5"])
def test_the_time_is_that_of_toppra(robot: str) -> None:
    arm = next(iter(load_robot(robot).arms.values()))
    rng = np.random.default_rng(5)
    moments = np.linspace(0.0, 1.0, 60)
    for _ in range(30):
        waves = rng.normal(0.0, 0.5, (3, len(arm.joints)))
        path = arm.home + np.sin(np.pi * moments[:, None] * [0.5, 1.0, 1.7]) @ waves
        times, rows = time_path(path, arm)
        assert rows[[0, -1]] == pytest.approx(path[[0, -1]])
        expected = _duration(path, arm)
        # Beyond it, time is stretched where the limits do not hold between grid points.
        assert expected - 1e-4 <= times[-1] <= 1.15 * expected
