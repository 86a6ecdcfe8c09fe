import numpy as np
import pytest

from guided_lgp.bounds.path import spline, timing
from guided_lgp.bounds.path.timing import INTERVAL, time_path
from guided_lgp.robots import load_robot

ARM = load_robot("pr2").arms["pr2L"]
ENDS = np.stack([ARM.home, ARM.home + np.array([-1.0, 0.4, 0.5, -0.3, 2.0, -0.3, -2.5])])


def _curved() -> np.ndarray:
    path = np.linspace(*ENDS, 30)
    path[:, 2] += 0.3 * np.sin(np.linspace(0, 3 * np.pi, 30))
    return path


@pytest.mark.parametrize("path", [ENDS, _curved()], ids=["line", "curve"])
def test_limits_hold_from_rest_to_rest(path: np.ndarray) -> None:
    times, rows = time_path(path, ARM)
    steps = np.diff(times)
    assert steps.min() > 0
    assert rows[0] == pytest.approx(path[0])
    assert rows[-1] == pytest.approx(path[-1])
    rates = np.diff(rows, axis=0) / steps[:, None]
    changes = np.diff(np.vstack([np.zeros(7), rates, np.zeros(7)]), axis=0) / steps[0]
    assert np.all(np.abs(rates) <= ARM.velocity_limits)
    assert np.all(np.abs(changes[1:-1]) <= ARM.acceleration_limits)
    assert np.all(2 * np.abs(changes[[0, -1]]) <= ARM.acceleration_limits)


def test_a_long_line_is_near_the_time_optimum() -> None:
    times, _ = time_path(ENDS, ARM)
    turn = np.abs(ENDS[1] - ENDS[0])
    top, gain = ARM.velocity_limits, ARM.acceleration_limits
    optimum = np.where(
        turn > top**2 / gain, turn / top + top / gain, 2 * np.sqrt(turn / gain)
    ).max()
    assert optimum <= times[-1] <= 1.1 * optimum
    assert np.diff(times).max() <= 1.1 * INTERVAL


@pytest.mark.parametrize("where", [1, 15, -1])
def test_points_that_nearly_coincide_cost_no_time(where: int) -> None:
    path = _curved()
    near = path[where] + 1e-5 * np.array([-1.0, 1, -1, 1, -1, 1, -1])
    times, rows = time_path(np.insert(path, where, near, axis=0), ARM)
    assert times[-1] == pytest.approx(time_path(path, ARM)[0][-1], rel=0.02)
    assert rows[[0, -1]].tolist() == path[[0, -1]].tolist()


def test_a_tiny_motion_still_arrives() -> None:
    ends = np.stack([ARM.home, ARM.home + 1e-5])
    assert time_path(ends, ARM)[1][[0, -1]].tolist() == ends.tolist()


BENT = (
    (-0.4971, -0.0544, -0.9761, -1.5957, -1.6871, -1.6826, 0.5542),
    (-0.4887, -0.0855, -0.9768, -1.6226, -1.6462, -1.6975, 0.5647),
    (-0.4801, -0.1145, -0.9787, -1.6515, -1.6067, -1.7119, 0.5759),
    (-0.4713, -0.1401, -0.9826, -1.6839, -1.5696, -1.7259, 0.5884),
    (-0.4620, -0.1586, -0.9897, -1.7237, -1.5376, -1.7394, 0.6032),
    (-0.4520, -0.1653, -1.0022, -1.7758, -1.5143, -1.7523, 0.6219),
    (-0.4479, -0.1386, -1.0162, -1.8172, -1.5303, -1.7549, 0.6346),
)
"""Half a second of motion whose fastest law forwards stops before its last bend: 8,955 s."""


def test_an_arm_does_not_creep_through_a_bend_that_it_cannot_take_forwards() -> None:
    path = np.array(BENT)
    (times, rows), (times_back, _) = time_path(path, ARM), time_path(path[::-1], ARM)
    assert times[-1] < 1.0
    assert times[-1] == pytest.approx(times_back[-1], rel=0.1)
    np.testing.assert_array_equal(rows[[0, -1]], path[[0, -1]])


def test_no_motion_takes_no_time() -> None:
    times, rows = time_path(np.stack([ARM.home, ARM.home]), ARM)
    assert times.tolist() == [0.0]
    assert rows.shape == (1, 7)


@pytest.mark.parametrize("path", [ENDS, _curved(), _curved()[:3]], ids=["line", "curve", "short"])
def test_compiled_and_numpy_agree(path: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> None:
    times, rows = time_path(path, ARM)
    for module in (timing, spline):
        monkeypatch.setattr(module, "_library", lambda: None)
    others, same = time_path(path, ARM)
    assert times == pytest.approx(others, rel=1e-6)
    assert rows == pytest.approx(same, abs=1e-6)


@pytest.mark.parametrize("count", [2, 3, 12])
def test_splines_are_those_of_scipy(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(count)
    s, points, ends = (
        np.cumsum(rng.uniform(0.1, 1, count)),
        rng.normal(size=(count, 3)),
        rng.normal(size=(2, 3)),
    )
    at = np.linspace(s[0], s[-1], 40)
    for out, into in ((None, None), (ends[0], None), (None, ends[1]), (ends[0], ends[1])):
        ours = spline.Cubic(s, points, out, into)
        with monkeypatch.context() as patch:
            patch.setattr(spline, "_library", lambda: None)
            theirs = spline.Cubic(s, points, out, into)
        assert ours(at) == pytest.approx(theirs(at), abs=1e-9)
        for one, other in zip(ours.derivatives(at), theirs.derivatives(at), strict=True):
            assert one == pytest.approx(other, abs=1e-8)
