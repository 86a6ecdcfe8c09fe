"""Arithmetic of poses."""

import numpy as np

from guided_lgp.poses import compose


def test_single_poses_are_composed_as_many_are_to_the_last_bit() -> None:
    first, second = np.random.default_rng(0).normal(size=(2, 500, 7))
    together = compose(first, second)
    one_by_one = [compose(a, b) for a, b in zip(first, second, strict=True)]
    assert np.array_equal(together, one_by_one)
