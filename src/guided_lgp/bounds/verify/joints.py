"""Limits of joints along a motion, and fingers that hold what they carry."""

from collections.abc import Sequence

import numpy as np

from guided_lgp.bounds.checks import Violation, box_sizes, closing_axis
from guided_lgp.bounds.results import Array, Attachment
from guided_lgp.bounds.verify.attachments import carriers, spans
from guided_lgp.bounds.verify.keyframes import LIMIT_TOLERANCE
from guided_lgp.logic import Skeleton
from guided_lgp.poses import compose, inverse
from guided_lgp.robots import Arm, Robot
from guided_lgp.scene import Scene
from guided_lgp.scene.world import initial_poses

RATE_TOLERANCE = 1.02
"""Factor on velocity and acceleration limits, for finite differences."""
JUMP = 3.0
"""A joint that is faster than this multiple of its limit jumps."""
SPREAD = 1e-3
"""How far (rad or m) the fingers of one hand may be from parallel."""
SQUEEZE = 0.004
"""How far (m) the fingers' opening may be off the width of the box they carry."""
AT_REST = 1e-3
"""How far (rad) the joints of an arm move at most while its fingers open or close."""


def rate_faults(robot: Robot, q: Array, times: Array) -> Violation | None:
    """Position, velocity and acceleration limits of the samples (T, m) of all moving joints."""
    fingers = [arm.fingers for arm in robot.arms.values()]
    ranges = [np.sort(np.outer(hand.ratios, (hand.lower, hand.upper)), axis=1) for hand in fingers]
    lower, upper = np.concatenate([robot.position_limits, *ranges]).T
    speeds = [np.abs(hand.ratios) * hand.velocity for hand in fingers]
    limits = np.concatenate([robot.velocity_limits, *speeds])
    steps = np.diff(times)
    velocity = np.diff(q, axis=0) / steps[:, None]
    speed = np.abs(velocity) / limits
    rate = np.abs(np.diff(velocity, axis=0)) / ((steps[1:] + steps[:-1]) / 2)[:, None]
    effort = rate[:, : len(robot.joint_names)] / robot.acceleration_limits
    for kind, excess in (
        ("joint limit", np.maximum(lower - q, q - upper) - LIMIT_TOLERANCE),
        ("jump", speed - JUMP),
        ("velocity", speed - RATE_TOLERANCE),
        ("acceleration", effort - RATE_TOLERANCE),
    ):
        if excess.size and excess.max() > 0:
            row = int(np.argmax(excess.max(axis=1) > 0))
            joint = int(np.argmax(excess[row]))
            constraint = f"{kind} {robot.moving_joints[joint]}"
            return Violation(constraint, float(excess[row, joint]), time=float(times[row]))
    return None


def finger_faults(
    scene: Scene, skeleton: Skeleton, switches: Sequence[int], q: Array, times: Array
) -> Violation | None:
    """Fingers of one hand that are not parallel, or not closed on the box they carry."""
    arms, widths = scene.robot.description.arms, _widths(scene, skeleton, switches, q)
    holds = list(spans(scene.state, skeleton, switches, len(q), lambda state: dict(state.held)))
    for gripper, arm in arms.items():
        if not arm.fingers.joints:
            continue
        fingers = q[:, arm.fingers.slice] / arm.fingers.ratios
        spread = np.ptp(fingers, axis=1)
        if spread.max() > SPREAD:
            time = float(times[np.argmax(spread)])
            return Violation(f"fingers {gripper}", float(spread.max()), time=time)
        held = (span for span in holds if span.gripper == gripper)
        for span in sorted(held, key=lambda span: span.start):
            rows = slice(span.start, span.end + 1)
            play = _play(arm, widths[span], q[rows, arm.slice], fingers[rows, 0])
            if play.max() > 0:
                time = float(times[span.start + np.argmax(play)])
                return Violation(f"fingers {gripper}", float(play.max()), time=time)
    return None


def _widths(
    scene: Scene, skeleton: Skeleton, switches: Sequence[int], q: Array
) -> dict[Attachment, float]:
    """Width (m) of what each gripper closes on, for every span in which it carries a box."""
    sizes, boxes, widths = box_sizes(scene), initial_poses(scene), {}
    arms = q[:, : len(scene.robot.description.joint_names)]
    carried = spans(scene.state, skeleton, switches, len(q), carriers)
    for span in sorted(carried, key=lambda span: span.start):
        start, end = scene.robot.tool_poses(arms[[span.start, span.end]])[span.gripper]
        across = closing_axis(boxes[span.box].tolist(), start.tolist())
        widths[span] = sizes[span.box][across]
        boxes[span.box] = compose(end, compose(inverse(start), boxes[span.box]))
    return widths


def _play(arm: Arm, width: float, q: Array, fingers: Array) -> Array:
    """How far (T,) the fingers are off a box of a width (m) that they carry.

    They may open and close where the box is grasped and let go of: while the arm (T, n) rests there
    at the start and the end.
    """
    closed, loose = arm.fingers.value(width), arm.fingers.value(width + SQUEEZE)
    play = np.abs(fingers - closed) - abs(loose - closed)
    for end in (q[0], q[-1]):
        play[np.abs(q - end).max(axis=1) <= AT_REST] = 0.0
    return play
