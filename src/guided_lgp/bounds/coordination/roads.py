"""The motions of one arm from stop to stop, as a graph of places where it may wait.

Between two stops an arm goes straight on, without a rest where a straight way ends; or it waits at
its side, or before the straight way in. Fingers move on the way, clear of what they leave and take.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise

import numpy as np

from guided_lgp.bounds.coordination.itinerary import Stop
from guided_lgp.bounds.coordination.law import jerk_limited, ramp
from guided_lgp.bounds.coordination.ways import Gap, Way
from guided_lgp.bounds.path.motions import Mover
from guided_lgp.bounds.results import Array
from guided_lgp.robots import Arm, PlacedArm

_CAREFUL = 3.0
"""How many times slower an arm moves that carries boxes on a box: at full acceleration they tip."""
_PATIENCE = 8
"""How often a motion is made slower until the fingers have time to move."""
_SLOWER = 1.15
"""By what factor each time."""


class Place(IntEnum):
    """Where an arm may rest, on the way to a stop and there."""

    SIDE = 0
    BEFORE = 1
    """Before the straight way in."""
    AT = 2
    CLOSED = 3
    """The fingers have closed."""
    OPENED = 4
    """They have opened."""


@dataclass(frozen=True)
class Node:
    """A place where an arm rests."""

    stop: int
    """To which it is on the way, or where it is."""
    place: Place


@dataclass(frozen=True, eq=False)
class Edge:
    """A motion from rest to rest, a row per tick."""

    end: Node
    q: Array
    """(T, n) rad"""
    fingers: Array
    """(T,)"""
    over: int
    """The last stop of the arm that is over while it moves."""
    needs: Mapping[str, int]
    """By gripper, the stop that must be over before it begins ..."""
    needs_at_end: Mapping[str, int]
    """... and before it ends."""
    contacts: frozenset[int]
    """The actions whose contacts are at its ends."""

    @property
    def ticks(self) -> int:
        """How long it takes."""
        return len(self.q) - 1


class Road:
    """All motions of one arm."""

    def __init__(
        self, mover: Mover, gripper: str, stops: Sequence[Stop], waits: bool, unwinds: bool
    ) -> None:
        """Prepare.

        Args:
            mover: finds free paths.
            gripper: whose arm it is.
            stops: what it has to do.
            waits: whether there is another arm for which it may have to wait.
            unwinds: whether joints come to a stop by the nearest of their full turns, or by those
                that the path bound has found.
        """
        self._arm = mover.arms[gripper].arm
        self._stops = stops
        self._waits = waits
        still = [np.zeros(len(stop.q)) for stop in stops]
        turns = _turns(mover.arms[gripper], stops) if unwinds else still
        self._gaps = [
            Gap(mover, mover.arms[gripper], pair, np.stack(wound))
            for pair, wound in zip(pairwise(stops), pairwise(turns), strict=True)
        ]
        self._edges: dict[Node, tuple[Edge, ...]] = {}
        self._remaining: dict[Node, float] = {}
        self.start = Node(0, Place.AT)
        self._rests = {self.start: (stops[0].q, stops[0].fingers)}

    def edges(self, node: Node) -> tuple[Edge, ...]:
        """The motions that begin at a node; none where the arm stays."""
        if node not in self._edges:
            self._edges[node] = tuple(self._found(node))
        return self._edges[node]

    def remaining(self, node: Node) -> float:
        """Ticks from a node to the last one, at least; infinite if there is no way."""
        if node not in self._remaining:
            ways = [edge.ticks + self.remaining(edge.end) for edge in self.edges(node)]
            self._remaining[node] = min(ways, default=0.0 if self.is_end(node) else np.inf)
        return self._remaining[node]

    def over(self, node: Node) -> int:
        """The last stop that is over at a node."""
        return node.stop if node.place >= self._effect(node.stop) else node.stop - 1

    def action(self, node: Node) -> int | None:
        """The action that takes effect as the arm arrives at a node."""
        stop = self._stops[node.stop]
        return stop.contact if stop.acts and node.place == self._effect(node.stop) else None

    def contacts(self, node: Node) -> frozenset[int]:
        """The action whose contact is at a node."""
        contact = self._stops[node.stop].contact
        return frozenset() if node.place < Place.AT or contact is None else frozenset([contact])

    def is_end(self, node: Node) -> bool:
        """Whether the arm stays there."""
        return node.stop == len(self._stops) - 1 and node.place == self._last(node.stop)

    def rest(self, node: Node) -> tuple[Array, float]:
        """Joints (n,) and fingers at a node that a motion has led to, or at the start."""
        return self._rests[node]

    def _effect(self, stop: int) -> Place:
        """Where a stop is over but for what follows from it."""
        return Place.AT if self._stops[stop].closing is None else Place.CLOSED

    def _last(self, stop: int) -> Place:
        """Where an arm is when all is done at a stop."""
        return self._effect(stop) if self._stops[stop].opening is None else Place.OPENED

    def _found(self, node: Node) -> Iterator[Edge]:
        stop = self._stops[node.stop]
        if node.place == Place.SIDE:
            yield from self._arriving(node, self._gaps[node.stop - 1].from_side, {})
        elif node.place == Place.BEFORE:
            into = self._gaps[node.stop - 1].into
            way = Way((into,), len(into), 0)
            yield from self._moving(node, Place.AT, way, stop.way_in_after)
        elif node.place < self._effect(node.stop):
            assert stop.closing is not None
            yield self._resting(node, Place.CLOSED, stop.fingers, stop.closing, {})
        elif node.place < self._last(node.stop):
            assert stop.opening is not None
            held = stop.fingers if stop.closing is None else stop.closing
            yield self._resting(node, Place.OPENED, held, stop.opening, stop.open_after)
        elif not self.is_end(node):
            yield from self._leaving(node)

    def _leaving(self, node: Node) -> Iterator[Edge]:
        """Straight on, or to the arm's side."""
        gap, needs = self._gaps[node.stop], self._stops[node.stop].leave_after
        ahead = Node(node.stop + 1, Place.SIDE)
        yield from self._arriving(node, gap.direct, needs)
        if self._waits and gap.to_side is not None:
            yield from self._moving(node, ahead.place, gap.to_side, needs)

    def _arriving(self, node: Node, way: Way | None, needs: Mapping[str, int]) -> Iterator[Edge]:
        """A way to the next stop, and the same with a rest before the straight way in."""
        number = node.stop if node.place < Place.AT else node.stop + 1
        stop = self._stops[number]
        if way is None:
            return
        if not stop.way_in_after:
            yield from self._moving(node, Place.AT, way, needs)
        waits = self._waits or stop.way_in_after
        if stop.way_in is not None and waits and way.before_contact.pieces:
            yield from self._moving(node, Place.BEFORE, way.before_contact, needs)

    def _moving(
        self, node: Node, place: Place, way: Way, needs: Mapping[str, int]
    ) -> Iterator[Edge]:
        """The arm moves, and the fingers to what they have to be at the stop."""
        end = Node(node.stop if node.place < Place.AT else node.stop + 1, place)
        stop = self._stops[end.stop]
        start = stop.fingers if node.place == Place.BEFORE else self._fingers(end.stop - 1)
        values = ramp(self._arm.fingers, start, start if place == Place.SIDE else stop.fingers)
        slower = _CAREFUL if stop.careful else 1.0
        for _ in range(_PATIENCE):
            q = self._timed(way, slower)
            first, last = self._between(way, q)
            if last - first >= len(values) - 1:
                row = last - len(values) + 1
                fingers = np.pad(values, (row, len(q) - row - len(values)), mode="edge")
                yield self._edge(node, end, q, fingers, needs)
                return
            slower *= _SLOWER

    def _timed(self, way: Way, slower: float) -> Array:
        """The rows of a way, at least two."""
        pieces = [jerk_limited(piece, self._arm, slower) for piece in way.pieces]
        rows = np.concatenate([pieces[0], *(piece[1:] for piece in pieces[1:])])
        return rows if len(rows) > 1 else np.tile(rows, (2, 1))

    def _between(self, way: Way, q: Array) -> tuple[int, int]:
        """The first and the last row (of T, n) off the straight ways at the ends."""
        gone, left = _lengths(q, self._arm), _lengths(q[::-1], self._arm)[::-1]
        out = _lengths(way.pieces[0][: way.out], self._arm)[-1:].sum()
        into = _lengths(way.pieces[-1][len(way.pieces[-1]) - way.into :], self._arm)[-1:].sum()
        return int(np.argmax(gone >= out)), len(q) - 1 - int(np.argmax(left[::-1] >= into))

    def _resting(
        self, node: Node, place: Place, start: float, end: float, needs: Mapping[str, int]
    ) -> Edge:
        """Fingers move while the arm rests."""
        values = ramp(self._arm.fingers, start, end)
        q = np.tile(self._gaps[node.stop - 1].end, (len(values), 1))
        return self._edge(node, Node(node.stop, place), q, values, needs)

    def _edge(
        self, start: Node, end: Node, q: Array, fingers: Array, needs: Mapping[str, int]
    ) -> Edge:
        after = self._stops[end.stop].after if self.action(end) is not None else {}
        contacts = self.contacts(start) | self.contacts(end)
        self._rests[end] = q[-1], float(fingers[-1])
        return Edge(end, q, fingers, self.over(start), needs, after, contacts)

    def _fingers(self, number: int) -> float:
        """Where they are when the arm leaves a stop."""
        stop = self._stops[number]
        values = (stop.opening, stop.closing, stop.fingers)
        return next(value for value in values if value is not None)


def _lengths(q: Array, arm: Arm) -> Array:
    """How far (T,) an arm has moved along configurations (T, n), in m."""
    steps = np.sum(np.abs(np.diff(q, axis=0)) * arm.metric, axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])[: len(q)]


def _turns(arm: PlacedArm, stops: Sequence[Stop]) -> list[Array]:
    """Full turns (n,) by which to wind the joints at every stop, so that none winds up or back.

    Where an arm stays in the end it is as the path bound had it.
    """
    limits = arm.arm.limits.T
    turns = [np.zeros(len(limits.T))]
    for before, stop in pairwise(stops):
        left = (before.q if stop.way_out is None else stop.way_out[-1]) + turns[-1]
        path = np.stack([stop.q]) if stop.way_in is None else stop.way_in
        turn = arm.near(path[0], left) - path[0]
        beyond = (path + turn < limits[0]) | (path + turn > limits[1])
        turns.append(np.zeros_like(turn) if beyond.any() or stop is stops[-1] else turn)
    return turns
