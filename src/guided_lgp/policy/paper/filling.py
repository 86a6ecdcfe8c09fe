"""Which symbol of a problem fills which slot of the networks."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from guided_lgp.logic import Goal, Objective


@dataclass(frozen=True)
class Slots:
    """The symbols and goals of a problem that the networks see; None is an empty slot."""

    own: tuple[tuple[str, tuple[str | None, ...]], ...]
    """The slots of each logic type for its own symbols, in the order of the state."""
    goals: Objective

    def of(self, kinds: Iterable[str]) -> tuple[str | None, ...]:
        """The slots for the own symbols of logic types, in the order of these."""
        own = dict(self.own)
        return tuple(name for kind in kinds for name in own.get(kind, ()))

    @property
    def symbols(self) -> tuple[str | None, ...]:
        """All slots, in the order of the state."""
        return tuple(name for _, names in self.own for name in names)


def named(goals: Iterable[Goal], symbols: Sequence[str]) -> list[str]:
    """Those of the symbols that goals name, as what moves or as what it shall stand on."""
    names = (name for goal in goals for name in goal.symbols)
    return list(dict.fromkeys(name for name in names if name in symbols))


def supports_first(goals: Objective) -> Objective:
    """The goals in their order, except that the goal of a support precedes what stands on it."""
    by_body = {goal.symbols[0]: goal for goal in goals}
    ordered: dict[Goal, None] = {}

    def add(goal: Goal) -> None:
        if goal not in ordered:
            for support in goal.symbols[1:]:
                if support in by_body:
                    add(by_body[support])
            ordered[goal] = None

    for goal in goals:
        add(goal)
    return tuple(ordered)


def fill(
    count: int, declared: Sequence[str], first: Iterable[str], in_order: bool = False
) -> tuple[str | None, ...]:
    """Fill slots with ``first``, then with the others; whoever has a slot of its own keeps it.

    Args:
        count: the number of slots.
        declared: all symbols.
        first: those that are to have a slot in any case.
        in_order: leave nobody where it is; the slots are taken in order.
    """
    chosen = list(dict.fromkeys((*first, *declared)))[:count]
    slots = [None if in_order or name not in chosen else name for name in declared[:count]]
    slots += [None] * (count - len(slots))
    moved = iter([name for name in chosen if name not in slots])
    return tuple(name if name is not None else next(moved, None) for name in slots)
