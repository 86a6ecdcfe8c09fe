"""Rows with decoys: what is tall need not be in the way.

Two rows, one before the other; neighbours of equal height; wide gaps. The tallest box need not
move, so that "the tallest first" costs actions, or room.
"""

from guided_lgp.scene.families import rows, two_rows
from guided_lgp.scene.families.family import Drawn, Family


def tallest_stays(layout: two_rows.TwoRows, drawn: Drawn) -> bool:
    """Whether no box of the greatest height has to make way, or to move at all."""
    moved = rows.chain(layout, drawn.scene, drawn.objective[0].symbols[0])
    tallest = max(box.size[2] for box in drawn.scene.boxes)
    return all(box.size[2] < tallest for box in drawn.scene.boxes if box.name in moved)


FAMILY = Family(
    name="rows_decoys",
    summary="rows in which the tallest box need not move: equal heights, wide gaps, two rows",
    layout=two_rows.TwoRows,
    draw=two_rows.with_front(2),
    rules={**rows.FAMILY.rules, "the tallest box need not move": tallest_stays},
    training_objectives=rows.training_objectives,
)
