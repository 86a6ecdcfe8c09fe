"""Cubic splines in compiled code; without a compiler by scipy."""

import ctypes
from functools import cache
from pathlib import Path

import numpy as np

from guided_lgp.bounds.results import Array
from guided_lgp.compiled import address, load_compiled


class Cubic:
    """The cubic spline through points (m, n) at ascending parameters (m,)."""

    def __init__(
        self, s: Array, points: Array, out: Array | None = None, into: Array | None = None
    ) -> None:
        """Lay a spline.

        Args:
            s: (m,) parameters, at least two.
            points: (m, n).
            out: derivative (n,) at the start; without it the second derivative vanishes there.
            into: the same at the end.
        """
        self._s, self._points = s, np.ascontiguousarray(points)
        self._library, self._curve = _library(), None
        if self._library is None:
            from scipy.interpolate import CubicSpline  # takes a quarter of a second

            ends = ((2, np.zeros(points.shape[1])) if v is None else (1, v) for v in (out, into))
            self._curve = CubicSpline(s, points, bc_type=tuple(ends))
            return
        self._second = np.empty_like(self._points)
        arrays = (s, self._points, out, into, self._second)
        self._library.spline(*points.shape, *map(address, arrays))

    def __call__(self, at: Array) -> Array:
        """Points (k, n) at ascending parameters (k,)."""
        if self._curve is not None:
            return np.asarray(self._curve(at))
        value = np.empty((len(at), self._points.shape[1]))
        self._evaluate(at, value, None, None)
        return value

    def derivatives(self, at: Array) -> tuple[Array, Array]:
        """The first and the second (k, n)."""
        if self._curve is not None:
            return self._curve(at, 1), self._curve(at, 2)
        slope, bend = np.empty((2, len(at), self._points.shape[1]))
        self._evaluate(at, None, slope, bend)
        return slope, bend

    def _evaluate(self, at: Array, *found: Array | None) -> None:
        assert self._library is not None
        arrays = (self._s, self._points, self._second)
        wanted = (len(at), *map(address, (at, *found)))
        self._library.evaluate(*self._points.shape, *map(address, arrays), *wanted)


@cache
def _library() -> ctypes.CDLL | None:
    source = Path(__file__).with_name("spline.c").read_text(encoding="utf-8")
    return load_compiled("spline", source)
