"""The factorisation within a skyline: against numpy, and the same on every processor."""

import ctypes
from pathlib import Path

import numpy as np
import pytest

from guided_lgp import compiled
from guided_lgp.bounds.coarse import compiler
from guided_lgp.bounds.results import Array
from guided_lgp.compiled import address, load_compiled

_EXPORTED = """
int solve(int n, int *first, int *end, double *H, const double *g, const char *held,
          double damping, double *L, double *panel, int *used, double *d)
{
    skyline shape = {first, end};
    hold(n, &shape, H, held);
    return step(n, &shape, H, g, held, damping, L, (lanes *)panel, used, d);
}
"""
_PLAIN = "#define WIDEST\n#define INLINE inline\n"
DAMPING = 0.1


def library() -> ctypes.CDLL:
    source = Path(compiler.__file__).with_name("cholesky.c").read_text(encoding="utf-8")
    found = load_compiled("cholesky", source + _EXPORTED)
    assert found is not None
    return found


def problem(n: int, seed: int) -> tuple[Array, Array, Array, Array]:
    """A positive definite matrix with zeros before its skyline, where that begins, g, and held."""
    rng = np.random.default_rng(seed)
    first = np.maximum(np.arange(n) - rng.integers(0, 9, n), 0)
    first[rng.random(n) < 0.1] = 0
    factor = np.tril(rng.normal(size=(n, n))) * (rng.random((n, n)) < 0.7)
    factor[np.arange(n) < first[:, None]] = 0.0
    factor += np.diag(2 + rng.random(n))
    return factor @ factor.T, first, rng.normal(size=n), rng.random(n) < 0.15


def solved(matrix: Array, first: Array, g: Array, held: Array) -> Array:
    n = len(g)
    end = np.cumsum(np.arange(n) - first + 1) - 1
    entries = np.concatenate([matrix[i, first[i] : i + 1] for i in range(n)])
    d, lower, panel = np.empty(n), np.empty(len(entries)), np.empty(16 * n)
    arrays = [first.astype(np.intc), end.astype(np.intc), entries, g, held.astype(np.int8)]
    scratch = [lower, panel, np.empty(2 * n, dtype=np.intc), d]
    assert library().solve(
        n, *map(address, arrays), ctypes.c_double(DAMPING), *map(address, scratch)
    )
    return d


@pytest.mark.parametrize(("n", "seed"), [(1, 0), (7, 1), (16, 2), (17, 3), (90, 4), (200, 5)])
def test_steps_are_those_of_numpy(n: int, seed: int) -> None:
    matrix, first, g, held = problem(n, seed)
    free = ~held
    expected = np.zeros(n)
    part = matrix[np.ix_(free, free)] + DAMPING * np.eye(free.sum())
    expected[free] = np.linalg.solve(part, -g[free])
    assert solved(matrix, first, g, held) == pytest.approx(expected, abs=1e-9)


def test_without_wide_vectors_the_same_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    problems = [problem(120, seed) for seed in range(20)]
    wide = [solved(*each) for each in problems]
    monkeypatch.setattr(compiled, "_PRELUDE", _PLAIN)
    plain = [solved(*each) for each in problems]
    assert [a.tobytes() for a in wide] == [b.tobytes() for b in plain]
