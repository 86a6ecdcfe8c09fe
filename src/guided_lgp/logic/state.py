"""Symbolic states: the mode tree, and what else is true."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from guided_lgp.logic.actions import Goal

if TYPE_CHECKING:
    from guided_lgp.logic.domain import Domain

Fact = tuple[str, ...]
"""A predicate and its symbols."""


@dataclass(frozen=True)
class State:
    """A state of a domain: what hangs on what, and further facts; made by ``Domain.state``.

    Everything movable has one parent: ``support`` maps what stands to what it stands on, ``held``
    what is held to its gripper. All are sorted, so that equal states compare equal.
    """

    support: tuple[tuple[str, str], ...]
    held: tuple[tuple[str, str], ...]
    facts: tuple[Fact, ...]
    domain: "Domain" = field(compare=False, repr=False)

    @cached_property
    def _supports(self) -> Mapping[str, str]:
        return dict(self.support)

    @cached_property
    def _standing(self) -> Mapping[str, tuple[str, ...]]:
        """The bodies that stand directly on each support, sorted."""
        found: dict[str, tuple[str, ...]] = {}
        for body, below in self.support:
            found[below] = (*found.get(below, ()), body)
        return found

    def holder(self, body: str) -> str | None:
        """The gripper that holds the body, if any."""
        return next((gripper for held, gripper in self.held if held == body), None)

    def held_by(self, gripper: str) -> str | None:
        """The body that the gripper holds, if any."""
        return next((body for body, holder in self.held if holder == gripper), None)

    def support_of(self, body: str) -> str | None:
        """What the body stands on; None while it is held."""
        return self._supports.get(body)

    def parent_of(self, body: str) -> str:
        """What the body hangs on: its support or gripper."""
        return dict(self.support + self.held)[body]

    def children_of(self, parent: str) -> tuple[str, ...]:
        """What stands directly on a support or is in a gripper, sorted."""
        return tuple(body for body, above in self.support + self.held if above == parent)

    def standing_on(self, support: str) -> tuple[str, ...]:
        """The bodies that stand directly on a table or body, sorted."""
        return self._standing.get(support, ())

    def carried_by(self, support: str) -> tuple[str, ...]:
        """The bodies that stand on a table or body directly or through others."""
        direct = self.standing_on(support)
        return direct and direct + tuple(b for below in direct for b in self.carried_by(below))

    def satisfies(self, goal: Goal) -> bool:
        """Whether the goal holds in this state."""
        return all(atom.holds_in(self) for atom in self.domain.conditions(goal))


class GroundAtom(NamedTuple):
    """A statement about a state, or its negation, with symbols in place of variables."""

    predicate: str
    symbols: tuple[str, ...]
    negated: bool

    def __abs__(self) -> "GroundAtom":
        """The same without negation."""
        return self._replace(negated=False)

    def holds_in(self, state: State) -> bool:
        """Whether it is true in a state."""
        predicate, symbols, negated = self
        test = _PREDICATES.get(predicate)
        if test is None:
            return ((predicate, *symbols) in state.facts) != negated
        return bool(test(state, *symbols)) != negated


_PREDICATES: Mapping[str, Callable[..., bool]] = {
    "holds": lambda state, gripper, body: (body, gripper) in state.held,
    "held": lambda state, body: state.holder(body) is not None,
    "free": lambda state, gripper: state.held_by(gripper) is None,
    "on": lambda state, body, support: (body, support) in state.support,
    "clear": lambda state, support: not state.children_of(support),
    "carries": lambda state, body, other: other == body or other in state.carried_by(body),
    "same": lambda state, one, other: one == other,
    "idle": lambda state: not state.held,
}
"""What the mode tree says; every other predicate is a fact of the domain."""
