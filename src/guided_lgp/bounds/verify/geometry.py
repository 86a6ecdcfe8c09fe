"""Grasps, placements and touches, checked for one configuration by the checks of terms."""

import math
from collections.abc import Collection, Mapping
from functools import partial

from guided_lgp.bounds.checks import Pose, Violation, box_sizes, top_of, turned_to_fingers, volumes
from guided_lgp.bounds.results import Array
from guided_lgp.bounds.terms import balanced, hold, pads, stand
from guided_lgp.robots import Arm, Robot
from guided_lgp.robots.hand_parts import parts_of
from guided_lgp.scene import Scene
from guided_lgp.scene.shapes import Convex
from guided_lgp.scene.tolerances import MARGIN
from guided_lgp.scene.world import Penetration, initial_poses

HAND_DEPTH = 0.02
"""How deep (m) a hull of the hand may reach into the box it holds, approaches or leaves. The
hulls bridge the hollow of the fingers: on a box that fills the hand they overlap it by 15 mm. For
fingertips, whose hulls end where the pads do, it is ``MARGIN``."""

Stack = tuple[str, Pose | None, Mapping[str, Pose]]
"""What a box stands on, with its pose if it is a box, and the poses of all above that, by name."""
NOTHING: Mapping[str, Stack] = {}
"""No stacks."""

_SAME = 1e-6
"""Distance (m) of places that are one, but for rounding."""


def grasp_faults(
    arm: Arm, box: str, body: Convex, placement: Pose, tool: Pose, given: Array | None = None
) -> list[Violation]:
    """Whether the gripper holds the box: closing across it, fingertips on it, palm outside.

    Where the scene gives the grasps: whether it is at one of them.

    Args:
        arm: of the gripper.
        box: its name.
        body: what it is.
        placement: its pose.
        tool: pose of the gripper's tool frame.
        given: (n, 7) the box's own grasps, if it has some.

    Returns:
        The greater violation first.
    """
    if given is not None:
        excess = hold.check_given(placement, tool, given)
        return [Violation(f"hold {arm.gripper} {box}", excess)] if excess > 0 else []
    if body.shape == "cylinder":
        placement = turned_to_fingers(placement, tool)
    excesses = {
        "hold": hold.check(body.size, placement, tool, arm.palm_front, arm.fingers.grasp_width),
        "pads": pads.check(body, placement, tool),
    }
    found = [Violation(f"{term} {arm.gripper} {box}", e) for term, e in excesses.items() if e > 0]
    return sorted(found, key=lambda violation: -violation.amount)


def stacks(boxes: Mapping[str, Pose], support: Mapping[str, str]) -> dict[str, Stack]:
    """All that it depends on whether boxes stand: a support, and boxes with all that they carry."""
    loaded = set(support.values())
    carried = {
        box: balanced.whole_stack(box, support) if box in loaded else (box,) for box in support
    }
    return {
        box: (below, boxes.get(below), {name: boxes[name] for name in carried[box]})
        for box, below in support.items()
    }


def placement_faults(
    scene: Scene,
    boxes: Mapping[str, Pose],
    support: Mapping[str, str],
    among: Collection[str] | None = None,
) -> list[Violation]:
    """Whether boxes, by default all, stand level on their supports and do not fall.

    Near an edge, a stack that nobody has touched may stay as the scene has it.
    """
    sizes, masses = box_sizes(scene), volumes(scene)
    found = []
    for box in support if among is None else among:
        below = support[box]
        top = top_of(scene, boxes, below)
        stack = partial(balanced.check, box, boxes, masses, support, top)
        excess = {"stand": stand.check(sizes[box], boxes[box], top), "balanced": stack()}
        if excess["balanced"] > 0 and _untouched(scene, box, boxes, support):
            excess["balanced"] = stack(placed=False)
        found += [Violation(f"{term} {box} {below}", e) for term, e in excess.items() if e > 0]
    return found


def _untouched(
    scene: Scene, box: str, boxes: Mapping[str, Pose], support: Mapping[str, str]
) -> bool:
    """Whether a box and all that it carries are where the scene has them."""
    start, below = initial_poses(scene), dict(scene.state.support)
    return all(
        below.get(name) == support[name] and math.dist(start[name][:3], boxes[name][:3]) < _SAME
        for name in balanced.whole_stack(box, support)
    )


def declared(
    overlap: Penetration,
    robot: Robot,
    held: Collection[tuple[str, str]],
    support: Mapping[str, str],
) -> bool:
    """Whether two bodies may touch: hand and held box, box and its support.

    Args:
        overlap: of the two bodies.
        robot: whose hands they may be.
        held: pairs of a box and a gripper that may touch it.
        support: what each box stands on.
    """
    for one, other in ((overlap.first, overlap.second), (overlap.second, overlap.first)):
        if support.get(one) == other:
            return True
        for gripper in (gripper for box, gripper in held if box == one):
            if other in robot.arms[gripper].hand_links:
                pad = other in parts_of(robot, gripper).pads
                return overlap.depth <= (MARGIN if pad else HAND_DEPTH)
    return False
