from itertools import pairwise

import numpy as np
import pytest

from guided_lgp.bounds.path.connect import connect, shortcut
from guided_lgp.bounds.results import Array


class Slit:
    """The square [-2, 2]² with a wall at x = 0 that has a gap at the top."""

    low, high, scale = np.array([-2.0, -2.0]), np.array([2.0, 2.0]), np.ones(2)

    def __init__(self, gap: float) -> None:
        self.gap = gap

    def free(self, start: Array, end: Array) -> bool:
        points = np.linspace(start, end, 200)
        return not np.any((np.abs(points[:, 0]) < 0.05) & (points[:, 1] < 2.0 - self.gap))


START, GOAL = np.array([-1.0, -1.0]), np.array([1.0, -1.0])


def _length(path: list[Array]) -> float:
    return float(np.linalg.norm(np.diff(path, axis=0), axis=1).sum())


def test_direct_line_where_it_is_free() -> None:
    path = connect(Slit(0.5), START, START + 0.5, np.random.default_rng(0), 10)
    assert path is not None
    assert np.array_equal(path, [START, START + 0.5])


def test_way_around_the_wall_and_shortcut() -> None:
    space, rng = Slit(0.5), np.random.default_rng(0)
    path = connect(space, START, GOAL, rng, 500)
    assert path is not None
    short = shortcut(space, list(path), rng, 100)
    for way in (path, short):
        assert np.array_equal(way[0], START)
        assert np.array_equal(way[-1], GOAL)
        assert all(space.free(a, b) for a, b in pairwise(way))
    shortest = 2 * np.hypot(1.0, 2.5)
    assert shortest <= _length(short) <= _length(path)
    assert _length(short) < 1.25 * shortest


def test_gives_up_within_its_iterations() -> None:
    assert connect(Slit(0.0), START, GOAL, np.random.default_rng(0), 200) is None


@pytest.mark.parametrize("seed", [0, 1])
def test_same_seed_same_path(seed: int) -> None:
    paths = [connect(Slit(0.5), START, GOAL, np.random.default_rng(seed), 500) for _ in range(2)]
    assert paths[0] is not None
    assert np.array_equal(paths[0], paths[1])
