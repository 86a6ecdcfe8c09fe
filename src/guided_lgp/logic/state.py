"""Symbolic states: what holds what and what stands on what."""

from collections.abc import Mapping
from dataclasses import dataclass

from guided_lgp.logic.actions import Goal


@dataclass(frozen=True)
class State:
    """What holds what and what stands on what.

    ``support`` maps every box that stands to what it stands on; ``held`` maps every box that is
    held to its gripper. Both are sorted tuples of pairs, so that equal states compare equal.
    """

    support: tuple[tuple[str, str], ...]
    held: tuple[tuple[str, str], ...] = ()

    @classmethod
    def of(cls, support: Mapping[str, str], held: Mapping[str, str] | None = None) -> "State":
        """Build a state from dictionaries."""
        return cls(tuple(sorted(support.items())), tuple(sorted((held or {}).items())))

    def holder(self, box: str) -> str | None:
        """The gripper that holds the box, if any."""
        return next((gripper for held, gripper in self.held if held == box), None)

    def held_by(self, gripper: str) -> str | None:
        """The box that the gripper holds, if any."""
        return next((box for box, holder in self.held if holder == gripper), None)

    def support_of(self, box: str) -> str | None:
        """What the box stands on; None while it is held."""
        return next((table for standing, table in self.support if standing == box), None)

    def standing_on(self, table: str) -> tuple[str, ...]:
        """The boxes that stand directly on a table or box, sorted."""
        return tuple(box for box, support in self.support if support == table)

    def carried_by(self, table: str) -> tuple[str, ...]:
        """The boxes that stand on a table or box directly or through others."""
        direct = self.standing_on(table)
        return direct + tuple(box for below in direct for box in self.carried_by(below))

    def satisfies(self, goal: Goal) -> bool:
        """Whether the goal holds in this state."""
        if goal.kind == "held":
            return self.holder(goal.box) is not None
        return self.support_of(goal.box) == goal.table
