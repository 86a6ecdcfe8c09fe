"""What stands in a scene beside the robot, as displays draw it."""

from collections.abc import Iterator
from colorsys import hsv_to_rgb
from dataclasses import dataclass
from itertools import count

from guided_lgp.poses import Array, pose
from guided_lgp.scene.model import Scene
from guided_lgp.scene.world import COLOURS, TABLE_THICKNESS
from guided_lgp.view.robot_shapes import Colour

_OTHER_TABLE = (0.81, 0.75, 0.66)
_FIRST_HUE, _HUE_STEP = 0.51, (5**0.5 - 1) / 2
"""Hues of the boxes that no colour is named after, in turns from red: teal, then golden sections
of the circle, which keep any number of hues apart."""


@dataclass(frozen=True)
class Body:
    """A cuboid with its place in the display's tree."""

    path: str
    name: str
    """What is written beside it; empty: nothing."""
    size: tuple[float, float, float]
    """Whole lengths (m)."""
    placement: Array
    """Pose (7,) of its centre in the world."""
    colour: Colour
    label: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where its name stands, in its own frame (m)."""


def box_path(name: str) -> str:
    """Where a box is in the tree."""
    return f"/boxes/{name}"


def fixed_bodies(scene: Scene) -> Iterator[Body]:
    """What the robot stands on, and the tables."""
    for column in scene.robot.columns:
        length, width, height = (2 * half for half in column.half)
        yield Body("/column", "", (length, width, height), column.placement, _OTHER_TABLE)
    for table in scene.tables:
        x, y, top = table.position
        length, width = (2 * half for half in table.half_extents)
        yield Body(
            f"/tables/{table.name}",
            table.name,
            (length, width, TABLE_THICKNESS),
            pose((x, y, top - TABLE_THICKNESS / 2), table.yaw),
            COLOURS.get(table.name, _OTHER_TABLE),
            label=(length / 2, 0.0, -0.05),
        )


def movable_bodies(scene: Scene) -> Iterator[Body]:
    """The boxes where they start."""
    for box, colour in zip(scene.boxes, box_colours(scene), strict=True):
        yield Body(
            box_path(box.name),
            box.name,
            box.size,
            pose(box.position, box.yaw),
            colour,
            label=(0.0, 0.0, box.size[2] / 2 + 0.01),
        )


def box_colours(scene: Scene) -> list[Colour]:
    """The colour of each box: what its name says, else one of its own."""
    hues = (_FIRST_HUE + number * _HUE_STEP for number in count())
    return [
        COLOURS[box.name] if box.name in COLOURS else hsv_to_rgb(next(hues) % 1, 0.63, 0.68)
        for box in scene.boxes
    ]
