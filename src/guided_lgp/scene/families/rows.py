"""Rows: boxes of several heights side by side, so near that fingers fit beside the tallest only.

One box shall go to the other table. Whatever stands beside it and is about as tall or taller has
to make way first, and so on along the row.
"""

from collections.abc import Iterator
from itertools import combinations, pairwise
from typing import Annotated

import numpy as np
from pydantic import Field

from guided_lgp.logic import Goal, Objective
from guided_lgp.poses import Array
from guided_lgp.scene.bodies import Box, Table
from guided_lgp.scene.families.family import Drawn, Family, Layout
from guided_lgp.scene.footprints import footprint, gap, inset
from guided_lgp.scene.model import Scene

Length = Annotated[float, Field(gt=0, le=1)]

COLOURS = ("red", "green", "blue", "yellow", "purple", "orange", "white")
"""Names of the boxes; which is which says nothing about heights."""
GOAL_TABLE = "tab2"


class Rows(Layout):
    """The numbers of the family."""

    box: tuple[Length, Length] = (0.12, 0.06)
    """Length, towards the robot, and width of every box."""
    heights: tuple[Length, ...] = (0.05, 0.08, 0.11, 0.14)
    gap: tuple[Length, Length] = (0.012, 0.03)
    """Between neighbours: from, to."""
    wide_gap: tuple[Length, Length] = (0.062, 0.08)
    """Where fingers fit in any case ..."""
    wide_share: Annotated[float, Field(ge=0, le=1)] = 0.15
    """... and how often that is so."""
    x: float = 0.52
    """Where the row is before the robot ..."""
    jitter: Annotated[float, Field(ge=0, le=0.1)] = 0.003
    """... and by how much a box may be off: one that juts out can be taken at its end."""
    blocking_gap: Length = 0.05
    """Up to this distance a neighbour may be in the way of the fingers ..."""
    blocking_height: Length = 0.02
    """... unless it is lower than the box by more than this: as deep as fingers reach."""


TABLES = (
    Table(name="tab1", position=(0.54, 0.36, 0.60), half_extents=(0.17, 0.32)),
    Table(name=GOAL_TABLE, position=(0.54, -0.36, 0.60), half_extents=(0.17, 0.32)),
)
"""The table with the row, at the left, and the other one; seven boxes fit."""


def draw(layout: Rows, size: int, name: str, rng: np.random.Generator) -> Drawn:
    """One row, on the table at the left."""
    places = row(layout, layout.x, rng.choice(layout.heights, size), rng)
    return problem(layout, name, places, rng)


def row(layout: Rows, x: float, heights: Array, rng: np.random.Generator) -> Array:
    """Places (n, 3) of boxes in a row along y, anywhere on the table: x, y and height."""
    if not len(heights):
        return np.zeros((0, 3))
    gaps = [_gap(layout, one, other, rng) for one, other in pairwise(heights)]
    ys = np.concatenate([[0.0], np.cumsum(np.array(gaps) + layout.box[1])])
    xs = x + rng.uniform(-layout.jitter, layout.jitter, len(heights))
    room = max(0.0, TABLES[0].half_extents[1] - (ys[-1] + layout.box[1]) / 2)
    middle = TABLES[0].position[1] + rng.uniform(-room, room)
    return np.column_stack([xs, ys - ys[-1] / 2 + middle, heights])


def _gap(layout: Rows, one: float, other: float, rng: np.random.Generator) -> float:
    """Neighbours of like height would block each other for good."""
    alike = abs(one - other) <= layout.blocking_height
    wide = alike or rng.random() < layout.wide_share
    return float(rng.uniform(*(layout.wide_gap if wide else layout.gap)))


def problem(
    layout: Rows,
    name: str,
    places: Array,
    rng: np.random.Generator,
) -> Drawn:
    """Boxes with permuted names, and the goal: one of those for which most has to make way.

    Args:
        layout: the family's numbers.
        name: of the scene.
        places: (n, 3) x, y (m) and height of each box.
        rng: random numbers.
    """
    names = rng.permutation(COLOURS[: len(places)])
    boxes = sorted(
        (
            _box(layout, str(box), *map(float, place))
            for box, place in zip(names, places, strict=True)
        ),
        key=lambda box: COLOURS.index(box.name),
    )
    scene = Scene(name=name, tables=TABLES, boxes=tuple(boxes))
    ways = {box.name: len(chain(layout, scene, box.name)) for box in boxes}
    target = rng.choice([name for name, way in ways.items() if way == max(ways.values())])
    return Drawn(scene, (_to_other_table(str(target)),))


def _box(layout: Rows, name: str, x: float, y: float, height: float) -> Box:
    table = TABLES[0]
    position = (round(x, 6), round(y, 6), round(table.position[2] + height / 2, 6))
    return Box(name=name, size=(*layout.box, round(height, 6)), position=position, on=table.name)


def blockers(layout: Rows, scene: Scene, box: Box) -> Iterator[Box]:
    """What stands beside a box, near and tall enough to be in the way of fingers."""
    for other in scene.boxes:
        beside = abs(other.position[0] - box.position[0]) < layout.box[0]
        near = abs(other.position[1] - box.position[1]) - layout.box[1] <= layout.blocking_gap
        if (
            other != box
            and beside
            and near
            and other.size[2] > box.size[2] - layout.blocking_height
        ):
            yield other


def chain(layout: Rows, scene: Scene, name: str) -> set[str]:
    """The boxes that have to make way before a box can be taken, itself included."""
    by_name = {box.name: box for box in scene.boxes}
    found: set[str] = set()
    open_ = [name]
    while open_:
        found.add(top := open_.pop())
        ways = (other.name for other in blockers(layout, scene, by_name[top]))
        open_ += [other for other in ways if other not in found]
    return found


def _to_other_table(box: str) -> Goal:
    return Goal("on", (box, GOAL_TABLE))


def on_the_table(layout: Rows, drawn: Drawn) -> bool:
    """Whether all boxes stand wholly on their table."""
    table = footprint(drawn.scene.tables[0])
    return all(np.min(inset(table, footprint(box))) > 0 for box in drawn.scene.boxes)


def apart(layout: Rows, drawn: Drawn) -> bool:
    """Whether no two boxes are nearer than the narrowest gap."""
    pairs = combinations(map(footprint, drawn.scene.boxes), 2)
    return all(gap(one, other) > layout.gap[0] - 1e-6 for one, other in pairs)


def no_deadlock(layout: Rows, drawn: Drawn) -> bool:
    """Whether no two boxes block each other."""
    ways = {
        (box.name, other.name)
        for box in drawn.scene.boxes
        for other in blockers(layout, drawn.scene, box)
    }
    return not any((other, box) in ways for box, other in ways)


def goal_blocked(layout: Rows, drawn: Drawn) -> bool:
    """Whether another box has to make way."""
    return len(chain(layout, drawn.scene, drawn.objective[0].symbols[0])) > 1


def training_objectives(scene: Scene, rng: np.random.Generator) -> list[Objective]:
    """Every box alone to the other table, and two of them."""
    boxes = [box.name for box in scene.boxes]
    pair = sorted(rng.choice(boxes, 2, replace=False).tolist(), key=boxes.index)
    single: list[Objective] = [(_to_other_table(box),) for box in boxes]
    return [*single, tuple(map(_to_other_table, pair))]


FAMILY = Family(
    name="rows",
    summary="a taller neighbour leaves no room for the fingers and has to make way first",
    layout=Rows,
    draw=draw,
    rules={
        "all boxes stand wholly on the table": on_the_table,
        "boxes keep the least gap": apart,
        "no two boxes block each other": no_deadlock,
        "a neighbour blocks the goal's box": goal_blocked,
    },
    training_objectives=training_objectives,
)
