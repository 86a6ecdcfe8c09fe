"""Rows with decoys: what is tall need not be in the way.

Two rows, one before the other; neighbours of equal height; wide gaps. The tallest box need not
move, so that "the tallest first" costs actions, or room.
"""

import numpy as np

from guided_lgp.scene.families import rows
from guided_lgp.scene.families.family import Drawn, Family


class Decoys(rows.Rows):
    """The numbers of the family."""

    box: tuple[rows.Length, rows.Length] = (0.10, 0.06)
    wide_share: float = 0.4
    x: float = 0.47
    """Of the row in front ..."""
    behind: rows.Length = 0.14
    """... and how far the other one is behind it."""


def draw(layout: Decoys, size: int, name: str, rng: np.random.Generator) -> Drawn:
    """Boxes in two rows along y; at least two in the one in front."""
    front = int(rng.integers(2, size + 1))
    heights = rng.choice(layout.heights, size)
    places = np.concatenate(
        [
            rows.row(layout, layout.x, heights[:front], rng),
            rows.row(layout, layout.x + layout.behind, heights[front:], rng),
        ]
    )
    return rows.problem(layout, name, places, rng)


def tallest_stays(layout: Decoys, drawn: Drawn) -> bool:
    """Whether no box of the greatest height has to make way, or to move at all."""
    moved = rows.chain(layout, drawn.scene, drawn.objective[0].symbols[0])
    tallest = max(box.size[2] for box in drawn.scene.boxes)
    return all(box.size[2] < tallest for box in drawn.scene.boxes if box.name in moved)


FAMILY = Family(
    name="rows_decoys",
    summary="rows in which the tallest box need not move: equal heights, wide gaps, two rows",
    layout=Decoys,
    draw=draw,
    rules={**rows.FAMILY.rules, "the tallest box need not move": tallest_stays},
    training_objectives=rows.training_objectives,
)
