"""Limits of joints along a motion, and fingers that hold what they carry."""

from collections.abc import Mapping, Sequence

import numpy as np

from guided_lgp.bounds.checks import Violation, box_sizes, closing_axis
from guided_lgp.bounds.results import Array, Attachment
from guided_lgp.bounds.verify.attachments import spans
from guided_lgp.bounds.verify.efforts import carried_boxes, derivatives, joint_efforts
from guided_lgp.bounds.verify.keyframes import LIMIT_TOLERANCE
from guided_lgp.logic import Skeleton
from guided_lgp.poses import IDENTITY, inverse
from guided_lgp.robots import Arm, Robot
from guided_lgp.scene import Scene

RATE_TOLERANCE = 1.02
"""Factor on all limits but those of positions, for finite differences."""
JUMP = 3.0
"""A joint that is faster than this multiple of its limit jumps."""
SPREAD = 1e-3
"""How far (rad or m) the fingers of one hand may be from parallel."""
SQUEEZE = 0.004
"""How far (m) the fingers' opening may be off the width of the box they carry."""
AT_REST = 1e-3
"""How far (rad) the joints of an arm move at most while its fingers open or close."""


def limit_faults(
    scene: Scene, skeleton: Skeleton, switches: Sequence[int], q: Array, times: Array
) -> Violation | None:
    """Limits of position, velocity, acceleration and effort.

    Args:
        scene: gives the robot and the loads.
        skeleton: the actions.
        switches: row of each action's switch.
        q: samples (T, m) of all moving joints.
        times: (T,) s.
    """
    robot = scene.robot.description
    excesses = _rate_excesses(robot, q, times)
    fault = _first_fault(robot, excesses, times)
    if fault is not None:
        return fault
    return _first_fault(
        robot, {"effort": _effort_excess(scene, skeleton, switches, q, times)}, times
    )


def rows_outside_limits(
    scene: Scene, skeleton: Skeleton, switches: Sequence[int], q: Array, times: Array
) -> dict[str, int]:
    """How many rows are outside each kind of limit, from positions to jerk.

    The arguments are those of :func:`limit_faults`.
    """
    robot = scene.robot.description
    excesses = _rate_excesses(robot, q, times)
    excesses["jerk"] = _jerk_excess(robot, q, times)
    excesses["effort"] = _effort_excess(scene, skeleton, switches, q, times)
    del excesses["jump"]  # these are too fast, too
    return {kind: int((excess > 0).any(axis=1).sum()) for kind, excess in excesses.items()}


def _first_fault(robot: Robot, excesses: Mapping[str, Array], times: Array) -> Violation | None:
    for kind, excess in excesses.items():
        if excess.size and excess.max() > 0:
            row = int(np.argmax(excess.max(axis=1) > 0))
            joint = int(np.argmax(excess[row]))
            constraint = f"{kind} {robot.moving_joints[joint]}"
            return Violation(constraint, float(excess[row, joint]), time=float(times[row]))
    return None


def _rate_excesses(robot: Robot, q: Array, times: Array) -> dict[str, Array]:
    """By how much rows (·, joints) exceed limits, in rad or units of the limit."""
    fingers = [arm.fingers for arm in robot.arms.values()]
    ranges = [np.sort(np.outer(hand.ratios, (hand.lower, hand.upper)), axis=1) for hand in fingers]
    lower, upper = np.concatenate([robot.position_limits, *ranges]).T
    speeds = [np.abs(hand.ratios) * hand.velocity for hand in fingers]
    limits = np.concatenate([robot.velocity_limits, *speeds])
    steps = np.diff(times)
    velocity = np.diff(q, axis=0) / steps[:, None]
    speed = np.abs(velocity) / limits
    rate = np.abs(np.diff(velocity, axis=0)) / ((steps[1:] + steps[:-1]) / 2)[:, None]
    change = rate[:, : len(robot.joint_names)] / robot.acceleration_limits
    return {
        "joint limit": np.maximum(lower - q, q - upper) - LIMIT_TOLERANCE,
        "jump": speed - JUMP,
        "velocity": speed - RATE_TOLERANCE,
        "acceleration": change - RATE_TOLERANCE,
    }


def _jerk_excess(robot: Robot, q: Array, times: Array) -> Array:
    """Of the arms' joints (T - 3, n), in units of the limit."""
    _, changes = derivatives(q[:, : len(robot.joint_names)], times)
    jerks = np.abs(np.diff(changes, axis=0)) / np.diff(times)[1:-1, None]
    return np.asarray(jerks / robot.jerk_limits - RATE_TOLERANCE)


def _effort_excess(
    scene: Scene, skeleton: Skeleton, switches: Sequence[int], q: Array, times: Array
) -> Array:
    """Of the arms' joints (T - 2, n), in units of the limit."""
    robot = scene.robot.description
    carried = carried_boxes(scene, skeleton, switches, q)
    efforts = joint_efforts(scene, q[:, : len(robot.joint_names)], times, carried)
    return np.abs(efforts) / robot.effort_limits - RATE_TOLERANCE


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
    sizes = box_sizes(scene)
    return {
        load.span: sizes[load.span.box][
            closing_axis(IDENTITY.tolist(), inverse(load.grip).tolist())
        ]
        for load in carried_boxes(scene, skeleton, switches, q)
    }


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
