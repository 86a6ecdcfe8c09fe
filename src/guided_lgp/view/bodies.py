"""What stands in a scene beside the robot, as displays draw it."""

from collections.abc import Iterator
from colorsys import hsv_to_rgb
from dataclasses import dataclass
from itertools import count

from guided_lgp.poses import Array
from guided_lgp.scene.bodies import colour_of
from guided_lgp.scene.model import Scene
from guided_lgp.scene.shapes import Convex
from guided_lgp.view.robot_shapes import Colour

_OTHER_TABLE = (0.81, 0.75, 0.66)
_FIRST_HUE, _HUE_STEP = 0.51, (5**0.5 - 1) / 2
"""Hues of the boxes that no colour is named after, in turns from red: teal, then golden sections
of the circle, which keep any number of hues apart."""


@dataclass(frozen=True)
class Body:
    """A convex body with its place in the display's tree."""

    path: str
    name: str
    """What is written beside it; empty: nothing."""
    convex: Convex
    placement: Array
    """Pose (7,) of its frame in the world."""
    colour: Colour
    label: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Where its name stands, in its own frame (m)."""


def box_path(name: str) -> str:
    """Where a box is in the tree."""
    return f"/boxes/{name}"


def fixed_bodies(scene: Scene) -> Iterator[Body]:
    """What is in the way, and what may be stood on and stays where it is."""
    for column in scene.robot.columns:
        yield Body("/column", "", column.convex, column.placement, _OTHER_TABLE)
    for obstacle in scene.obstacles:
        colour, path = colour_of(obstacle) or _OTHER_TABLE, f"/obstacles/{obstacle.name}"
        yield Body(path, "", obstacle.convex, obstacle.placement, colour)
    for support in scene.supports:
        length, _, height = support.convex.half
        yield Body(
            f"/tables/{support.name}",
            support.name,
            support.convex,
            support.placement,
            colour_of(support) or _OTHER_TABLE,
            label=(length, 0.0, -height - 0.03),
        )


def movable_bodies(scene: Scene) -> Iterator[Body]:
    """The boxes where they start."""
    for box, colour in zip(scene.movable, box_colours(scene), strict=True):
        yield Body(
            box_path(box.name),
            box.name,
            box.convex,
            box.placement,
            colour,
            label=(0.0, 0.0, box.size[2] / 2 + 0.01),
        )


def box_colours(scene: Scene) -> list[Colour]:
    """The colour of each box: as declared, or what its name says, else one of its own."""
    hues = (_FIRST_HUE + number * _HUE_STEP for number in count())
    return [colour_of(box) or hsv_to_rgb(next(hues) % 1, 0.63, 0.68) for box in scene.movable]
