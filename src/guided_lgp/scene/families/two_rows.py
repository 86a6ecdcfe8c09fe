"""Two rows, one before the other, of boxes that may block their neighbours, or none at all."""

from collections.abc import Callable

import numpy as np

from guided_lgp.scene.families import rows
from guided_lgp.scene.families.family import Drawn, Family


class TwoRows(rows.Rows):
    """The numbers of the family."""

    box: tuple[rows.Length, rows.Length] = (0.10, 0.06)
    wide_share: float = 0.4
    x: float = 0.47
    """Of the row in front ..."""
    behind: rows.Length = 0.14
    """... and how far the other one is behind it."""


def with_front(least: int) -> Callable[[TwoRows, int, str, np.random.Generator], Drawn]:
    """The draw of boxes in two rows along y, with at least so many in the one in front."""

    def draw(layout: TwoRows, size: int, name: str, rng: np.random.Generator) -> Drawn:
        front = int(rng.integers(least, size + 1))
        heights = rng.choice(layout.heights, size)
        places = np.concatenate(
            [
                rows.row(layout, layout.x, heights[:front], rng),
                rows.row(layout, layout.x + layout.behind, heights[front:], rng),
            ]
        )
        return rows.problem(layout, name, places, rng)

    return draw


FAMILY = Family(
    name="two_rows",
    summary="two rows with equal heights and wide gaps: some neighbours are in the way",
    layout=TwoRows,
    draw=with_front(0),
    rules=rows.FAMILY.rules,
    training_objectives=rows.training_objectives,
)
