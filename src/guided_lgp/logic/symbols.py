"""The set of symbols L and their logic types (paper, Sec. II)."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from guided_lgp.logic.domain import Domain

GRIPPER = "gripper"
"""The type of the robot's hands; each holds one thing at a time."""


@dataclass(frozen=True)
class Symbols:
    """Symbols of a problem by logic type, in declaration order; made by ``Domain.symbols``."""

    domain: "Domain"
    members: Mapping[str, tuple[str, ...]] = field(hash=False)
    """All symbols of each type: first its own, then those of other types that are of it, too."""
    names: tuple[str, ...]
    """All symbols, also those that a restriction has left out."""

    @property
    def movable(self) -> tuple[str, ...]:
        """What has a parent, in the order of the types."""
        kinds = [declared.name for declared in self.domain.types if declared.parents]
        return tuple(dict.fromkeys(name for kind in kinds for name in self.members[kind]))

    def of(self, kind: str) -> tuple[str, ...]:
        """All symbols of a logic type."""
        return self.members[kind]

    def is_a(self, name: str, kind: str) -> bool:
        """Whether a symbol is of a logic type."""
        return name in self.members[kind]

    def restricted(self, **members: tuple[str, ...]) -> "Symbols":
        """The same with other symbols of some types, such as fewer tables.

        This is the reduced branching that the paper grants the breadth-first planner (Table II,
        starred problems).
        """
        others = (name for names in members.values() for name in names)
        names = tuple(dict.fromkeys((*self.names, *others)))
        return Symbols(self.domain, {**self.members, **members}, names)

    @property
    def grippers(self) -> tuple[str, ...]:
        """All symbols of logic type gripper."""
        return self.members[GRIPPER]

    @property
    def boxes(self) -> tuple[str, ...]:
        """All symbols of logic type box."""
        return self.members["box"]

    @property
    def tables(self) -> tuple[str, ...]:
        """All symbols of logic type table: surfaces, then boxes."""
        return self.members["table"]

    @property
    def surfaces(self) -> tuple[str, ...]:
        """The tables that stay where they are."""
        return tuple(name for name in self.tables if name not in self.movable)
