"""Grasps, placements and touches, checked for one configuration by the checks of terms."""

from collections.abc import Collection, Mapping

from guided_lgp.bounds.checks import Pose, Vector, Violation, box_sizes, top_of
from guided_lgp.bounds.terms import balanced, hold, pads, stand
from guided_lgp.robots import Robot
from guided_lgp.scene import Scene
from guided_lgp.scene.world import Penetration

HAND_DEPTH = 0.02
"""How deep (m) a hull of the hand may reach into the box it holds, approaches or leaves. The
hulls bridge the hollow of the fingers: on a box that fills the hand they overlap it by 15 mm."""


def grasp_faults(
    box: str, size: Vector, placement: Pose, tool: Pose, palm_front: float
) -> list[Violation]:
    """Whether the gripper is at the box: closing across it, fingertips on it, palm outside.

    Args:
        box: its name.
        size: its extents (m).
        placement: its pose.
        tool: pose of the gripper's tool frame.
        palm_front: x of the palm's front in the tool frame (m).
    """
    worst = max(hold.check(size, placement, tool, palm_front), pads.check(size, placement, tool))
    return [Violation(f"grasp {box}", worst)] if worst > 0 else []


def placement_faults(
    scene: Scene, boxes: Mapping[str, Pose], support: Mapping[str, str]
) -> list[Violation]:
    """Whether boxes stand level on their supports and do not fall."""
    sizes = box_sizes(scene)
    found = []
    for box, below in support.items():
        top = top_of(scene, boxes, below)
        tilt = max(stand.tilt(boxes[box]), stand.tilt(top.pose))
        if tilt > stand.LEVEL_ANGLE:
            found.append(Violation(f"level {box}", tilt))
            continue
        gap = stand.gap(sizes[box], boxes[box], top)
        if gap > stand.HEIGHT:
            found.append(Violation(f"height {box}", gap))
        overhang = balanced.check(box, boxes, sizes, support, top)
        if overhang > 0:
            found.append(Violation(f"balance {box}", overhang))
    return found


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
        if any(one == box and other in robot.arms[g].hand_links for box, g in held):
            return overlap.depth <= HAND_DEPTH
    return False
