"""Lever arms against the motion of random configurations."""

import numpy as np
import pytest
from descriptions import ARMS, ArmDescription

from guided_lgp.robots.measures.levers import lever_arms


@pytest.mark.parametrize("arm", ARMS.values(), ids=ARMS)
def test_levers_bound_the_tools_velocity_and_are_nearly_reached(arm: ArmDescription) -> None:
    limits = arm.limits()
    q = np.random.default_rng(0).uniform(*limits.T, (20_000, len(limits)))
    velocity = np.linalg.norm(arm.chain.jacobian(q)[2][:, :3], axis=1).max(axis=0)
    levers = lever_arms(arm.chain)
    assert np.all(velocity <= levers + 1e-6)
    assert np.all(levers <= 1.6 * velocity + 0.01)
