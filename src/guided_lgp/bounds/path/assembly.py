"""From the steps of a solution to one trajectory of all moving joints."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from guided_lgp.bounds.path.motions import Motion
from guided_lgp.bounds.path.situation import (
    Attach,
    Fingers,
    Release,
    Situation,
    Step,
    situation_at_start,
)
from guided_lgp.bounds.path.timing import INTERVAL
from guided_lgp.bounds.results import Array, Attachment, PathResult, Trajectory
from guided_lgp.robots import Fingers as FingerJoints
from guided_lgp.robots import Robot
from guided_lgp.scene import Scene

_FINGER_SHARE = 0.9
"""Share of their velocity limit at which fingers move."""

CAREFUL = 3.0
"""How many times slower an arm moves that carries boxes on a box: at full acceleration they tip."""


class Clock(NamedTuple):
    """When joints are where: times (T,) from 0 (s), and their values (T, n)."""

    follow: Callable[[Motion, float, Array], tuple[Array, Array]]
    """An arm moves so many times slower than it could, after rows (m, n) without a rest."""
    ramp: Callable[[FingerJoints, Array, float], tuple[Array, Array]]
    """Fingers go from joint values (n,) to one value."""


def _follow(motion: Motion, slower: float, before: Array) -> tuple[Array, Array]:
    times, values = motion.timed
    return slower * times, values


def _ramp(joints: FingerJoints, start: Array, value: float) -> tuple[Array, Array]:
    end = joints.ratios * value
    duration = float(np.abs(end - start).max(initial=0.0)) / (_FINGER_SHARE * joints.velocity)
    count = 1 + int(np.ceil(duration / INTERVAL))
    return np.linspace(0.0, duration, count), np.linspace(start, end, count)


FASTEST = Clock(_follow, _ramp)
"""Within velocities and accelerations."""


def stay(scene: Scene) -> PathResult:
    """The plan of no actions: the robot rests where it is for an interval."""
    start = assemble(scene.robot.description, situation_at_start(scene), ())
    rest = replace(start, times=np.array([0.0, INTERVAL]), q=np.tile(start.q, (2, 1)))
    return PathResult((), feasible=True, trajectory=rest)


def assemble(
    robot: Robot, start: Situation, steps: Iterable[Step], pace: float = 1.0, clock: Clock = FASTEST
) -> Trajectory:
    """Time all motions and join them.

    Args:
        robot: whose joints move.
        start: where the robot is before the first step.
        steps: each continues where the one before ended.
        pace: how many times slower arms move than they could.
        clock: times the steps.
    """
    fingers = [arm.fingers.ratios * start.fingers[g] for g, arm in robot.arms.items()]
    rows = [np.concatenate([start.q, *fingers])[None]]
    times = [np.zeros(1)]
    count = 1
    open_since = {box: (gripper, 0) for box, (gripper, _) in start.carried.items()}
    attachments: list[Attachment] = []
    for step in steps:
        last = rows[-1][-1]
        match step:
            case Motion(arm):
                stacked = sum(holder == arm.gripper for holder, _ in open_since.values()) > 1
                columns = arm.slice
                before = rows[-1][:, columns]
                moments, values = clock.follow(step, CAREFUL if stacked else pace, before)
            case Fingers(gripper, value):
                joints = robot.arms[gripper].fingers
                columns = joints.slice
                moments, values = clock.ramp(joints, last[columns], value)
            case Attach(boxes, gripper):
                ended = [box for box in boxes if box in open_since]
                attachments += [Attachment(box, *open_since.pop(box), count - 1) for box in ended]
                open_since |= dict.fromkeys(boxes, (gripper, count - 1))
                continue
            case Release(boxes):
                attachments += [Attachment(box, *open_since.pop(box), count - 1) for box in boxes]
                continue
        block = np.tile(last, (len(moments) - 1, 1))
        block[:, columns] = values[1:]
        if len(block):
            rows.append(block)
            times.append(times[-1][-1] + moments[1:])
            count += len(block)
    attachments += [Attachment(b, gripper, i, count - 1) for b, (gripper, i) in open_since.items()]
    return Trajectory(
        robot.moving_joints, np.concatenate(times), np.concatenate(rows), tuple(attachments)
    )
