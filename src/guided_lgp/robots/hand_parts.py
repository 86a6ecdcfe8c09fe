"""The parts of a hand that grip."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

from guided_lgp.robots.robot import Robot


@dataclass(frozen=True)
class HandParts:
    """Which links of a hand touch what it holds, and which joints press them on it."""

    pads: tuple[str, ...]
    """Links at the ends of the fingers that move."""
    between: tuple[str, ...]
    """Links between palm and pads, whose hulls bridge the hollow of the fingers."""
    pressing: tuple[str, ...]
    """Joints that press the pads on an object."""
    hanging: tuple[str, ...]
    """Joints of fingertips that hang on fingers: they keep the pads parallel."""


@lru_cache(maxsize=16)
def parts_of(robot: Robot, gripper: str) -> HandParts:
    """The parts of a gripper's hand."""
    arm, tree = robot.arms[gripper], robot.description
    carrying = {above for link in arm.hand_links for above in _above(robot, link)}
    moved = {joint: tree.children[joint] for joint in arm.fingers.joints}
    hanging = tuple(
        joint for joint, link in moved.items() if {*_above(robot, link)} & set(moved.values())
    )
    fingers = arm.hand_links[1:] if arm.fingers.joints else ()
    return HandParts(
        pads=tuple(link for link in fingers if link not in carrying),
        between=tuple(link for link in fingers if link in carrying),
        pressing=tuple(joint for joint in arm.fingers.joints if joint not in hanging),
        hanging=hanging,
    )


def _above(robot: Robot, link: str) -> Iterator[str]:
    """The links that a link hangs on."""
    while link in robot.description.parents:
        link = robot.description.parents[link]
        yield link
