"""What each arm has to do in a plan: the stops that it makes, and the ways between them.

An action is a contact of the acting hand. It reads and writes bodies: it moves one and all that
stands on it, off what is below it and onto what is below its place. Two actions of different arms
of which one writes what the other reads or writes keep their order; all others may change places.
Where one hand acts on what another one holds, the other one waits for it: from before the straight
way in until after the straight way out.
"""

from collections.abc import Iterable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field, replace

from guided_lgp.bounds.path.assembly import CAREFUL
from guided_lgp.bounds.path.motions import Motion
from guided_lgp.bounds.path.situation import Fingers, Situation, Step
from guided_lgp.bounds.results import Array
from guided_lgp.logic import Action, Skeleton, State, successor
from guided_lgp.robots import PlacedArm


@dataclass
class Stop:
    """Where an arm has to come, and what happens there."""

    motions: tuple[Motion, ...]
    """Free motions that lead there from the stop before, as the path bound has found them."""
    way_out: Array | None
    """Straight way (m, n) off the stop before."""
    way_in: Array | None
    """Straight way (m, n) to the contact."""
    q: Array
    """(n,) rad"""
    fingers: float
    """Their value on arrival."""
    slower: float
    """How many times slower the arm comes there than it could."""
    contact: int | None = None
    """The action in whose contact the hand is ..."""
    acts: bool = False
    """... and whether it makes it."""
    closing: float | None = None
    """Value to which the fingers close before the action takes effect."""
    opening: float | None = None
    """Value to which they open afterwards."""
    after: dict[str, int] = field(default_factory=dict)
    """By gripper, the stop that must be over before the action takes effect here."""
    way_in_after: dict[str, int] = field(default_factory=dict)
    """The same before the straight way in begins; without any, the arm need not rest there."""
    open_after: dict[str, int] = field(default_factory=dict)
    """The same before the fingers open."""
    leave_after: dict[str, int] = field(default_factory=dict)
    """The same before the arm leaves."""


@dataclass(frozen=True)
class Change:
    """What an action does to bodies."""

    body: str
    """The one in the hand."""
    contacts: tuple[str, str]
    """What holds or supports it before, and afterwards."""
    holder: str | None
    """The hand that holds it afterwards."""
    carried: Mapping[str, tuple[str, Array]]
    """Of the bodies moved, those in a hand afterwards: gripper, and pose (7,) in its tool frame."""
    standing: Mapping[str, Array]
    """The others: pose (7,) in the world."""


@dataclass(frozen=True)
class Itinerary:
    """A plan as the stops of all arms."""

    start: Situation
    stops: Mapping[str, Sequence[Stop]]
    """By gripper; the first one is where the arm starts."""
    changes: Sequence[Change]
    """By action."""

    def bodies(self, done: Iterable[int]) -> "Bodies":
        """Where all bodies are when some actions have taken effect."""
        standing, carried = dict(self.start.standing), dict(self.start.carried)
        holders: dict[str, str | None] = dict(self.start.state.held)
        for change in (self.changes[number] for number in sorted(done)):
            for body in (*change.carried, *change.standing):
                standing.pop(body, None)
                carried.pop(body, None)
            standing |= change.standing
            carried |= change.carried
            holders[change.body] = change.holder
        return Bodies(standing, carried, holders)


@dataclass(frozen=True)
class Bodies:
    """Where all bodies are."""

    standing: Mapping[str, Array]
    """World pose (7,) of every one that no hand carries."""
    carried: Mapping[str, tuple[str, Array]]
    """Gripper, and pose (7,) in its tool frame, of every other one."""
    holders: Mapping[str, str | None]
    """The hands that hold some of them; None where one did."""


def itinerary(
    start: Situation,
    skeleton: Skeleton,
    steps: Sequence[Step],
    arms: Mapping[str, PlacedArm],
    in_order: bool,
) -> Itinerary:
    """Sort the steps of a plan by arms.

    Args:
        start: the situation before the first step.
        skeleton: the actions.
        steps: one after the other, as the path bound has found them: every action has two straight
            motions, into the contact and out of it.
        arms: by gripper.
        in_order: whether no action may change places with another one.
    """
    lines = [i for i, step in enumerate(steps) if isinstance(step, Motion) and not step.transit]
    reader, last = _Reader(start, arms, in_order), 0
    for action, into, out in zip(skeleton, lines[::2], lines[1::2], strict=True):
        reader.pass_by(steps[last:into])
        reader.act(action, steps[into : out + 1])
        last = out + 1
    reader.pass_by(steps[last:])
    return reader.result()


class _Reader:
    """Follows the steps, and keeps what each arm has done since its last stop."""

    def __init__(self, start: Situation, arms: Mapping[str, PlacedArm], in_order: bool) -> None:
        self._start = self._now = start
        self._arms = arms
        self._in_order = in_order
        self._motions: dict[str, list[Motion]] = {gripper: [] for gripper in arms}
        self._ways_out: dict[str, Array] = {}
        self._stops: dict[str, list[Stop]] = {gripper: [] for gripper in arms}
        self._changes: list[Change] = []
        self._concerns: list[_Concern] = []
        for gripper in arms:
            self._add(gripper)

    def pass_by(self, steps: Sequence[Step]) -> None:
        """Take up what is between two actions."""
        for step in steps:
            if isinstance(step, Motion):
                self._motions[step.gripper].append(step)
            self._now = self._now.after(step, self._arms)

    def act(self, action: Action, steps: Sequence[Step]) -> None:
        """Take up an action, from the straight way in to the straight way out."""
        into, *switch, out = steps
        assert isinstance(into, Motion)
        assert isinstance(out, Motion)
        acting, after = into.gripper, successor(self._now.state, action)
        concern = _concern(acting, self._arms.keys(), self._now.state, after, action)
        partners = {gripper: self._add(gripper) for gripper in concern.partners}
        number = self._add(acting, into.path)
        stop = self._stops[acting][number]
        stop.acts, stop.way_in_after, stop.after = True, partners, self._earlier(concern)
        for gripper in (acting, *partners):
            self._stops[gripper][-1].contact = len(self._changes)
        self._concerns.append(concern)
        self._now = self._now.after(into, self._arms)
        self._switch(acting, number, switch)
        self._now = replace(self._now, state=after)
        self._changes.append(self._change(concern))
        self._now = self._now.after(out, self._arms)
        self._ways_out[out.gripper] = out.path
        if partners:
            left = {out.gripper: self._add(out.gripper)}
            for gripper in {acting, *partners} - {out.gripper}:
                self._stops[gripper][-1].leave_after = left

    def result(self) -> Itinerary:
        """All stops, the last ones being where the arms stay."""
        for gripper in self._arms:
            if self._motions[gripper] or gripper in self._ways_out:
                self._add(gripper)
        return Itinerary(self._start, self._stops, self._changes)

    def _add(self, gripper: str, way_in: Array | None = None) -> int:
        """A stop where an arm is now, or where a straight way leads."""
        motions, self._motions[gripper] = tuple(self._motions[gripper]), []
        carrying = sum(carrier == gripper for carrier, _ in self._now.carried.values())
        here = self._now.q[self._arms[gripper].arm.slice]
        stop = Stop(
            motions,
            self._ways_out.pop(gripper, None),
            way_in,
            here if way_in is None else way_in[-1],
            self._now.fingers[gripper],
            slower=CAREFUL if carrying > 1 else 1.0,
        )
        self._stops[gripper].append(stop)
        return len(self._stops[gripper]) - 1

    def _switch(self, acting: str, number: int, steps: Sequence[Step]) -> None:
        """Fingers close, the body changes its parent, fingers open."""
        switched = False
        for step in steps:
            if not isinstance(step, Fingers):
                switched = True
            elif switched:
                stop = self._stops[step.gripper][-1]
                stop.opening = step.value
                stop.open_after = {} if step.gripper == acting else {acting: number}
            else:
                self._stops[step.gripper][-1].closing = step.value
            self._now = self._now.after(step, self._arms)

    def _change(self, concern: "_Concern") -> Change:
        """What has become of the bodies that the last action has moved."""
        carried = {b: c for b, c in self._now.carried.items() if b in concern.writes}
        standing = {b: p for b, p in self._now.standing.items() if b in concern.writes}
        holder = self._now.state.holder(concern.body)
        return Change(concern.body, concern.contacts, holder, carried, standing)

    def _earlier(self, concern: "_Concern") -> dict[str, int]:
        """By gripper, the last stop of another arm whose action an action must not overtake."""
        found: dict[str, int] = {}
        for gripper, stops in self._stops.items():
            for number, stop in enumerate(stops):
                if not stop.acts or stop.contact is None or gripper == concern.acting:
                    continue
                if self._in_order or concern.depends(self._concerns[stop.contact]):
                    found[gripper] = number
        return found


@dataclass(frozen=True)
class _Concern:
    """What an action has to do with."""

    acting: str
    body: str
    contacts: tuple[str, str]
    writes: frozenset[str]
    """Bodies that it moves."""
    reads: frozenset[str]
    """What is below them, before and afterwards."""
    partners: tuple[str, ...]
    """The other hands among that."""

    def depends(self, other: "_Concern") -> bool:
        """Whether it must not change places with another one."""
        return bool(self.writes & (other.writes | other.reads) or self.reads & other.writes)


def _concern(
    acting: str, grippers: AbstractSet[str], before: State, after: State, action: Action
) -> _Concern:
    body = before.domain.bind(action).body
    below = [_below(state, body) for state in (before, after)]
    reads = frozenset(name for names in below for name in names)
    partners = tuple(sorted(reads & grippers - {acting}))
    writes = frozenset((body, *before.carried_by(body)))
    return _Concern(acting, body, (below[0][0], below[1][0]), writes, reads, partners)


def _below(state: State, body: str) -> list[str]:
    """What is below a body, down to the hand or the support that carries all."""
    found = []
    while (support := state.support_of(body)) is not None:
        found.append(support)
        body = support
    holder = state.holder(body)
    return found if holder is None else [*found, holder]
