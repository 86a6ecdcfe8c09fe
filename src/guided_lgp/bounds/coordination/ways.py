"""The paths of one arm from one stop to the next: straight on, or by its side."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from guided_lgp.bounds.coordination.itinerary import Stop
from guided_lgp.bounds.path.motions import Motion, Mover, Transit
from guided_lgp.bounds.path.optimise import optimal_path
from guided_lgp.bounds.results import Array
from guided_lgp.robots import PlacedArm

_GUESS = 12
"""Configurations of a straight line in joint space from which a path is optimised."""
_SAMPLED = 3
"""Paths by samples from which one is optimised where nothing else leads to one."""
_INSET = 1e-4
"""Distance (rad) from the joint limits of a path: many a contact is as near."""
_LEG = 2
"""Steps (of about a centimetre) that a hand goes straight at least, off a contact or to one."""


@dataclass(frozen=True)
class Way:
    """Paths (m, n) with rests between them; the first and the last row may be of a straight way."""

    pieces: tuple[Array, ...]
    out: int
    """Rows that lead straight off a contact ..."""
    into: int
    """... and to one; none, or at least two."""

    @property
    def before_contact(self) -> "Way":
        """The same without the straight way to a contact."""
        *others, last = self.pieces
        rest = last[: len(last) - self.into + 1]
        return Way((*others, rest) if len(rest) > 1 else tuple(others), self.out, 0)


class Gap:
    """What is between two stops of an arm."""

    def __init__(
        self, mover: Mover, arm: PlacedArm, stops: tuple[Stop, Stop], turns: Array
    ) -> None:
        """Prepare.

        Args:
            mover: finds free paths.
            arm: whose they are.
            stops: from the first to the second.
            turns: (2, n) full turns (rad) by which joints are wound more than the path bound had
                them, at either.
        """
        self._mover, self._arm = mover, arm
        self._motions = stops[1].motions
        self.start, self.end = stops[0].q + turns[0], stops[1].q + turns[1]
        self._turn, self._wound = turns[0], turns[1] - turns[0]
        way_out, way_in = stops[1].way_out, stops[1].way_in
        self._way_out = self.start[None] if way_out is None else way_out + turns[0]
        self._way_in: Array = self.end[None] if way_in is None else way_in + turns[1]

    @cached_property
    def direct(self) -> Way | None:
        """Straight on, or None if nothing has been found."""
        if not self._motions:
            pieces = tuple(path for path in (self._way_out, self._way_in) if len(path) > 1)
            still = self._way_out[[0, 0]]
            return Way(pieces or (still,), _straight(self._way_out), _straight(self._way_in))
        return self._joined(self._motions)

    @cached_property
    def to_side(self) -> Way | None:
        """To the arm's side, if the path bound has been there on its way."""
        return None if self._side is None else self._joined(self._motions[: self._side])

    @cached_property
    def from_side(self) -> Way | None:
        """On from there."""
        return None if self._side is None else self._joined(self._motions[self._side :])

    @cached_property
    def into(self) -> Array:
        """The straight way (m, n) to the contact, as short as can be."""
        if not self._motions:
            return self._way_in
        way = self._shortened(self._way_in[::-1], self._motions[-1])
        return np.asarray(way[::-1])

    @cached_property
    def _side(self) -> int | None:
        """How many motions lead to the arm's side, if it goes on from there."""
        home = self._arm.arm.home
        ends = [np.array_equal(motion.path[-1], home) for motion in self._motions[:-1]]
        return ends.index(True) + 1 if True in ends else None

    def _shortened(self, way: Array, motion: Motion) -> Array:
        """The beginning (m, n) of a way off a contact after which nothing touches any more."""
        assert motion.transit is not None
        for row in range(_LEG, len(way) - 1):
            if self._mover.collision(motion.transit.surroundings, way[row, None]) is None:
                return np.asarray(way[: row + 1])
        return way

    def _joined(self, motions: Sequence[Motion]) -> Way | None:
        """Some motions in one, and with the straight ways before and after, if possible.

        These are as short as can be, or where no motion is free then, as the path bound has them.
        """
        leaves, arrives = motions[0] is self._motions[0], motions[-1] is self._motions[-1]
        side = (self._arm.arm.home + self._turn)[None]
        longest = self._way_out if leaves else side, self._way_in if arrives else side
        out = self._shortened(self._way_out, motions[0]) if leaves else side
        into = self.into if arrives else side
        found = [motion.path + self._turn for motion in motions]
        transit = motions[-1].transit
        assert transit is not None
        wound = self._wound if arrives else np.zeros_like(self._wound)
        for lines in ((out, into), longest):
            before, after = (longest[0][len(lines[0]) - 1 :], longest[1][::-1][len(lines[1]) - 1 :])
            detour = np.concatenate([before, *found, after[::-1] - wound])
            detour += np.linspace(0.0, 1.0, len(detour))[:, None] * wound
            path = self._free(transit, motions[0].transit, lines, detour)
            if path is not None:
                whole = np.concatenate([lines[0], path[1:], lines[1][1:]])
                return Way((whole,), _straight(out), _straight(into))
        if wound.any():
            return None
        return Way(
            tuple(self._split(transit, longest[0], found, longest[1])),
            _straight(out),
            _straight(into),
        )

    def _split(
        self, transit: Transit, out: Array, paths: Sequence[Array], into: Array
    ) -> list[Array]:
        """Straight ways, and free paths between them that cannot be one, as few: a rest is between
        two.
        """
        if len(paths) == 1:
            return [path for path in (out, *paths, into) if len(path) > 1]
        half = len(paths) // 2
        middle = paths[half][:1]
        parts = (out, paths[:half], middle), (middle, paths[half:], into)
        return [piece for part in parts for piece in self._fewest(transit, *part)]

    def _fewest(
        self, transit: Transit, out: Array, paths: Sequence[Array], into: Array
    ) -> list[Array]:
        """The same with free paths that may be one."""
        guess, beside = np.concatenate(paths), _lines(out, into)
        path = optimal_path(self._mover, transit, guess, *beside, inset=_INSET)
        if path is None:
            return self._split(transit, out, paths, into)
        return [np.concatenate([out, path[1:], into[1:]])]

    def _free(
        self, transit: Transit, first: Transit | None, lines: tuple[Array, Array], detour: Array
    ) -> Array | None:
        """The best free path (m, n) between two straight ways, begun from the line between them,
        from a detour, or else from a path by samples. At first it keeps clear of what is there
        then, too: above all of what the hand leaves, which another one may take.
        """
        assert first is not None
        if not self._possible(transit, detour[[0, -1]]):
            return None
        beside = _lines(*lines)
        for guess in self._guesses(transit, detour):
            path = optimal_path(self._mover, transit, guess, *beside, inset=_INSET)
            if path is not None and (
                first is transit
                or self._mover.collision(first.surroundings, path[: len(path) // 3]) is None
            ):
                return path
        return None

    def _possible(self, transit: Transit, ends: Array) -> bool:
        """Whether a path may have these ends (2, n): if not, it is needless to look for one."""
        low, high = self._arm.arm.limits.T
        inside = np.all((ends > low + _INSET) & (ends < high - _INSET))
        return bool(inside) and self._mover.collision(transit.surroundings, ends) is None

    def _guesses(self, transit: Transit, detour: Array) -> Iterator[Array]:
        if not transit.keep_level:
            yield np.linspace(detour[0], detour[-1], _GUESS)
        yield detour
        plan = self._mover.level_transit if transit.keep_level else self._mover.transit
        for seed in range(_SAMPLED):
            rng = np.random.default_rng(seed)
            found = plan(transit.surroundings, detour[0], detour[-1], rng)
            if found is not None:
                yield np.concatenate([found[0], *(path[1:] for path in found[1:])])


def _lines(before: Array, after: Array) -> tuple[Array | None, Array | None]:
    """Two straight ways; None in place of a single configuration."""
    return before if len(before) > 1 else None, after if len(after) > 1 else None


def _straight(way: Array) -> int:
    """The rows of a straight way; one row is none."""
    return len(way) if len(way) > 1 else 0
