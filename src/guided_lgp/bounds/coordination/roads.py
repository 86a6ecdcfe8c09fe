"""The motions of one arm from stop to stop, as a graph of places where it may wait.

Between two stops an arm goes straight on, without a rest where a straight way ends; or it waits at
its side, or before the straight way in. Fingers move on the way, clear of what they leave and take.
At a contact the hand rests while they are near the body: it comes as they begin to close, and
leaves before they are wide open.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from guided_lgp.bounds.coordination.itinerary import Stop
from guided_lgp.bounds.coordination.law import jerk_limited, ramp
from guided_lgp.bounds.coordination.turns import best_turns
from guided_lgp.bounds.coordination.ways import Gap, Way
from guided_lgp.bounds.path.motions import Mover
from guided_lgp.bounds.results import Array
from guided_lgp.robots import Arm, PlacedArm

_PATIENCE = 8
"""How often a motion is made slower until the fingers have time to move."""
_SLOWER = 1.15
"""By what factor each time."""
_OFF = 0.004
"""Distance (m) of either finger from the body between them at which the hand may move; planning
keeps 3 mm from everything."""
_NEAR, _FAR = 0.2, 1.0
"""How far (m of the arm's motion) from a straight way fingers are as open as it asks for: free ways
are looked for with such fingers, and come within 3 mm of the body. The second is for plans in which
they would touch it with the first."""


class Manner(NamedTuple):
    """How an arm moves."""

    unwinds: bool
    """Whether joints come to a stop by the best of their full turns, or by those that the path
    bound has found."""
    opens: float
    """How far (m of its motion) from a straight way fingers are as open as it asks for."""
    touches: float
    """How far (m of its motion) from a straight way the hand may come within 3 mm of the body."""


MANNERS = (
    *(Manner(unwinds, opens, 0.0) for unwinds in (True, False) for opens in (_NEAR, _FAR)),
    *(Manner(unwinds=True, opens=far, touches=far) for far in (_NEAR, _FAR)),
)
"""In the order in which they are tried."""


class Place(IntEnum):
    """Where an arm may rest, on the way to a stop and there."""

    SIDE = 0
    BEFORE = 1
    """Before the straight way in."""
    AT = 2
    """The fingers that close have closed."""
    OPENED = 3
    """They have opened, where the arm stays."""


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
    leaves: frozenset[int]
    """The action whose contact it leaves ..."""
    left: int
    """... and the first row off the straight way from there."""
    comes: frozenset[int]
    """The action to whose contact it comes ..."""
    coming: int
    """... and the last row before the straight way."""

    @property
    def ticks(self) -> int:
        """How long it takes."""
        return len(self.q) - 1

    def contacts(self, row: int) -> frozenset[int]:
        """The actions in whose contacts the hand is, or straight before or after it."""
        leaves = self.leaves if row < self.left else frozenset[int]()
        return leaves | self.comes if row > self.coming else leaves


class Road:
    """All motions of one arm."""

    def __init__(
        self,
        mover: Mover,
        gripper: str,
        stops: Sequence[Stop],
        waits: bool,
        manner: Manner = MANNERS[0],
    ) -> None:
        """Prepare.

        Args:
            mover: finds free paths.
            gripper: whose arm it is.
            stops: what it has to do.
            waits: whether there is another arm for which it may have to wait.
            manner: how it moves.
        """
        self._manner = manner
        self._arm = mover.arms[gripper].arm
        self._stops = stops
        self._waits = waits
        self._gaps = _gaps(mover, mover.arms[gripper], stops, manner.unwinds)
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
        return node.stop if node.place >= Place.AT else node.stop - 1

    def action(self, node: Node) -> int | None:
        """The action that takes effect as the arm arrives at a node."""
        stop = self._stops[node.stop]
        return stop.contact if stop.acts and node.place == Place.AT else None

    def contacts(self, node: Node) -> frozenset[int]:
        """The action whose contact is at a node."""
        contact = self._stops[node.stop].contact
        return frozenset() if node.place < Place.AT or contact is None else frozenset([contact])

    def is_end(self, node: Node) -> bool:
        """Whether the arm stays there."""
        last = Place.AT if self._stops[-1].opening is None else Place.OPENED
        return node == Node(len(self._stops) - 1, last)

    def rest(self, node: Node) -> tuple[Array, float]:
        """Joints (n,) and fingers at a node that a motion has led to, or at the start."""
        return self._rests[node]

    def _found(self, node: Node) -> Iterator[Edge]:
        stop = self._stops[node.stop]
        if node.place == Place.SIDE:
            yield from self._arriving(node, self._gaps[node.stop - 1].from_side, {})
        elif node.place == Place.BEFORE:
            into = self._gaps[node.stop - 1].into
            yield from self._moving(node, Place.AT, Way((into,), 0, len(into)), stop.way_in_after)
        elif node.stop < len(self._stops) - 1:
            yield from self._leaving(node)
        elif not self.is_end(node):
            yield self._opening(node)

    def _leaving(self, node: Node) -> Iterator[Edge]:
        """Straight on, or to the arm's side."""
        gap, stop = self._gaps[node.stop], self._stops[node.stop]
        needs = {**stop.open_after, **stop.leave_after}
        yield from self._arriving(node, gap.direct, needs)
        if self._waits and gap.to_side is not None:
            yield from self._moving(node, Place.SIDE, gap.to_side, needs)

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
        """The arm moves, and the fingers with it."""
        end = Node(node.stop if node.place < Place.AT else node.stop + 1, place)
        fingers = self._finger_ways(node, end)
        slower = self._stops[end.stop].slower
        for _ in range(_PATIENCE):
            q = self._timed(way, slower)
            away = self._between(way, q, self._manner.opens, end.place == Place.BEFORE)
            lacking = max(len(fingers[1]) - 1 - (away[1] - away[0]), 0)
            if not lacking or not self.contacts(node):
                q = np.pad(q, ((lacking, 0), (0, 0)), mode="edge")
                free, near = self._between(way, q), away[1] + lacking
                apart = self._between(way, q, self._manner.touches)
                lead, q, values = self._together(q, free, near, *fingers)
                yield self._edge(node, end, q, values, (lead + apart[0], lead + apart[1]), needs)
                return
            slower *= _SLOWER

    def _finger_ways(self, start: Node, end: Node) -> tuple[Array, Array, Array]:
        """How the fingers open at the start, move on the way, and close at the end."""
        stop, opening = self._stops[end.stop], self._opening_from(start)
        wanted = opening[-1] if end.place == Place.SIDE else stop.fingers
        closed = stop.closing if end.place == Place.AT else None
        between = ramp(self._arm.fingers, opening[-1], wanted)
        closing = ramp(self._arm.fingers, wanted, wanted if closed is None else closed)
        return opening, between, closing

    def _together(
        self,
        q: Array,
        free: tuple[int, int],
        near: int,
        opening: Array,
        between: Array,
        closing: Array,
    ) -> tuple[int, Array, Array]:
        """Rows for which the arm waits at first, and rows of the arm and of the fingers: they move
        on the free way, until the hand is near; on the straight ways, and before and after, they do
        so while the hand is at the body.
        """
        first, last = free
        lead = len(opening) - 1 - min(self._clear(opening[::-1]), first)
        reached = lead + len(q) - 1 - min(self._clear(closing), len(q) - 1 - last)
        rest = reached + len(closing) - lead - len(q)
        values = _joined(
            (0, opening), (lead + near - len(between) + 1, between), (reached, closing)
        )
        return lead, np.pad(q, ((lead, rest), (0, 0)), mode="edge"), values

    def _opening_from(self, node: Node) -> Array:
        """How the fingers (T,) leave what they have held; one value where they only go on."""
        stop = self._stops[node.stop]
        if node.place == Place.BEFORE:
            return np.array([stop.fingers])
        if node.place == Place.SIDE:
            return np.array([self._rests[node][1]])
        held = stop.fingers if stop.closing is None else stop.closing
        return ramp(self._arm.fingers, held, held if stop.opening is None else stop.opening)

    def _clear(self, values: Array) -> int:
        """The rows (of T,) after the first one until fingers that close are near the body."""
        openings = [self._arm.fingers.opening(float(value)) for value in values]
        near = np.array(openings) / 2 < openings[-1] / 2 + _OFF
        return max(int(np.argmax(near)) - 1, 0)

    def _timed(self, way: Way, slower: float) -> Array:
        """The rows of a way, at least two."""
        pieces = [jerk_limited(piece, self._arm, slower) for piece in way.pieces]
        rows = np.concatenate([pieces[0], *(piece[1:] for piece in pieces[1:])])
        return rows if len(rows) > 1 else np.tile(rows, (2, 1))

    def _between(
        self, way: Way, q: Array, farther: float = 0.0, before: bool = False
    ) -> tuple[int, int]:
        """The first and the last row (of T, n) off the straight ways at the ends, or farther (m)
        from them, but for what is left of a short way; it may end before a straight way.
        """
        gone, left = _lengths(q, self._arm), _lengths(q[::-1], self._arm)[::-1]
        out = _lengths(way.pieces[0][: way.out], self._arm)[-1:].sum()
        into = _lengths(way.pieces[-1][len(way.pieces[-1]) - way.into :], self._arm)[-1:].sum()
        farther = min(farther, max(gone[-1] - out - into, 0.0) / 3)
        out += farther if out else 0.0
        into += farther if into or before else 0.0
        out, into = min(out, gone[-1]), min(into, gone[-1])  # rows cut corners
        return int(np.argmax(gone >= out)), len(q) - 1 - int(np.argmax(left[::-1] >= into))

    def _opening(self, node: Node) -> Edge:
        """Fingers open where the arm stays."""
        values = self._opening_from(node)
        q = np.tile(self._rests[node][0], (len(values), 1))
        needs = self._stops[node.stop].open_after
        return self._edge(node, Node(node.stop, Place.OPENED), q, values, (len(q), -1), needs)

    def _edge(
        self,
        start: Node,
        end: Node,
        q: Array,
        fingers: Array,
        free: tuple[int, int],
        needs: Mapping[str, int],
    ) -> Edge:
        after = self._stops[end.stop].after if self.action(end) is not None else {}
        leaves, comes = self.contacts(start), self.contacts(end)
        self._rests[end] = q[-1], float(fingers[-1])
        ends = leaves, free[0], comes, free[1]
        return Edge(end, q, fingers, self.over(start), needs, after, *ends)


def _joined(*parts: tuple[int, Array]) -> Array:
    """Values (T,) of parts that begin at rows, the last value of each until the next."""
    values = np.empty(parts[-1][0] + len(parts[-1][1]))
    for row, part in parts:
        values[row : row + len(part)], values[row + len(part) :] = part, part[-1]
    return values


def _lengths(q: Array, arm: Arm) -> Array:
    """How far (T,) an arm has moved along configurations (T, n), in m."""
    steps = np.sum(np.abs(np.diff(q, axis=0)) * arm.metric, axis=1)
    return np.concatenate([[0.0], np.cumsum(steps)])[: len(q)]


def _gaps(mover: Mover, arm: PlacedArm, stops: Sequence[Stop], unwinds: bool) -> list[Gap]:
    """What is between the stops; joints keep their turns where the arm finds no other way."""
    pairs = list(pairwise(stops))
    kept = set[int]() if unwinds else set(range(len(pairs)))
    made: dict[tuple[int, bytes], Gap] = {}
    while True:
        gaps = []
        for number, turns in enumerate(map(np.stack, pairwise(best_turns(arm, stops, kept)))):
            new = Gap(mover, arm, pairs[number], turns)
            gaps.append(made.setdefault((number, turns.tobytes()), new))
        stuck = {number for number, gap in enumerate(gaps) if gap.direct is None}
        if not stuck:
            return gaps
        kept |= stuck
