"""A hand may touch a box until it has left it or the box has gone, whatever happens meanwhile."""

import numpy as np
from motions import scene

from guided_lgp.bounds.results import Array
from guided_lgp.bounds.verify.touching import Touch, touches
from guided_lgp.logic import parse_skeleton

TWO_BOXES = scene(red=(0.52, 0.30, 0.65, 0.2, "tab1"), green=(0.52, -0.30, 0.65, -0.2, "tab2"))
BOTH = parse_skeleton("(grasp pr2L red) (place pr2L red tab1) (grasp pr2R green)")
OVERTAKEN = parse_skeleton("(grasp pr2L red) (place pr2L red tab1) (grasp pr2R red)")


def along_x(*positions: float) -> Array:
    """Poses (T, 7) of a tool frame."""
    poses = np.zeros((len(positions), 7))
    poses[:, 0], poses[:, 6] = positions, 1.0
    return poses


def test_a_hand_leaves_a_box_after_the_next_action_has_begun() -> None:
    left = along_x(-0.3, -0.1, 0.0, 0.5, 0.5, 0.55, 0.6, 0.9)
    right = along_x(2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.3)
    found = touches(TWO_BOXES, BOTH, [2, 3, 5], {"pr2L": left, "pr2R": right})
    assert found == [Touch("red", "pr2L", 0, 7), Touch("green", "pr2R", 0, 7)]


def test_a_hand_may_not_touch_what_another_one_carries_away() -> None:
    left = along_x(-0.3, 0.0, 0.0, 0.5, 0.5, 0.5, 0.5, 0.5)
    right = along_x(2.0, 2.0, 2.0, 2.0, 1.0, 1.0, 1.1, 1.2)
    found = touches(TWO_BOXES, OVERTAKEN, [2, 3, 5], {"pr2L": left, "pr2R": right})
    assert found == [Touch("red", "pr2L", 0, 6), Touch("red", "pr2R", 3, 7)]
