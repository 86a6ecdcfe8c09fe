"""The parts of a hand that grip, and when they do."""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from guided_lgp.bounds.results import Trajectory
from guided_lgp.robots import Arm, Robot


@dataclass(frozen=True)
class HandParts:
    """Which links of a hand touch what it holds, and which joints press them on it."""

    pads: tuple[str, ...]
    """Links at the ends of the fingers."""
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
    fingers = arm.hand_links[1:]
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


def closing_rows(arm: Arm, trajectory: Trajectory, before: int, switch: int) -> int:
    """Row at which the hand is open at what it takes at a switch, after an earlier row.

    Its fingers close from there on. Jaws that do not move are at it all the time.
    """
    moving = _moving(arm, trajectory, before, switch)
    if moving is None or not moving.any():
        return before
    still = np.flatnonzero(~moving)
    return before + int(still[-1]) + 1 if len(still) else before


def opening_rows(arm: Arm, trajectory: Trajectory, switch: int, after: int) -> int:
    """Row at which the fingers are open that begin to move between a switch and a later row."""
    moving = _moving(arm, trajectory, switch, len(trajectory.times) - 1)
    if moving is None or not moving[: after - switch].any():
        return after
    first = int(np.argmax(moving))
    still = np.flatnonzero(~moving[first:])
    return switch + first + int(still[0]) if len(still) else len(trajectory.times) - 1


def _moving(arm: Arm, trajectory: Trajectory, first: int, last: int) -> np.ndarray | None:
    """For each interval between two rows, whether the fingers move; None where they cannot."""
    if not arm.fingers.joints:
        return None
    (values,) = trajectory.joints(arm.fingers.joints[:1])[first : last + 1].T
    return np.asarray(np.diff(values) != 0.0)
