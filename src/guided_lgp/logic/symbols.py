"""The set of symbols L and their logic types (paper, Sec. II)."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Symbols:
    """Symbols of a problem by logic type, in declaration order.

    Every box is also a table. ``box_is_table=False`` removes that second type: the reduced
    branching that the paper grants the breadth-first planner (Table II, starred problems).
    """

    grippers: tuple[str, ...]
    boxes: tuple[str, ...]
    surfaces: tuple[str, ...]
    box_is_table: bool = True

    @property
    def tables(self) -> tuple[str, ...]:
        """All symbols of logic type table: surfaces, then boxes."""
        return self.surfaces + self.boxes if self.box_is_table else self.surfaces
