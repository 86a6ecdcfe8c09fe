"""When the fingers of a hand are open around what it takes or has left."""

import numpy as np

from guided_lgp.bounds.results import Trajectory
from guided_lgp.robots import Arm


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
