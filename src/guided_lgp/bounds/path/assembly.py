"""From the steps of a solution to one trajectory of all moving joints."""

from collections.abc import Iterable

import numpy as np

from guided_lgp.bounds.path.motions import Motion
from guided_lgp.bounds.path.situation import Attach, Fingers, Release, Situation, Step
from guided_lgp.bounds.path.timing import INTERVAL
from guided_lgp.bounds.results import Array, Attachment, Trajectory
from guided_lgp.scene import GRIPPERS
from guided_lgp.scene.pr2 import ARM_JOINTS, FINGER_JOINTS, FINGER_VELOCITY, arm_slice

_FINGER_SHARE = 0.9
"""Share of their velocity limit at which fingers move."""

_CAREFUL = 3.0
"""How many times slower an arm moves that carries boxes on a box: at full acceleration they tip."""


def assemble(start: Situation, steps: Iterable[Step]) -> Trajectory:
    """Time all motions and join them.

    Args:
        start: where the robot is before the first step.
        steps: each continues where the one before ended.
    """
    fingers = [np.full(len(FINGER_JOINTS[gripper]), start.fingers[gripper]) for gripper in GRIPPERS]
    rows = [np.concatenate([start.q, *fingers])[None]]
    times = [np.zeros(1)]
    count = 1
    open_since: dict[str, tuple[str, int]] = {}
    attachments: list[Attachment] = []
    for step in steps:
        last = rows[-1][-1]
        match step:
            case Motion(gripper):
                clock, values = step.timed
                if sum(holder == gripper for holder, _ in open_since.values()) > 1:
                    clock = _CAREFUL * clock
                columns = arm_slice(gripper)
            case Fingers(gripper, value):
                columns = _finger_slice(gripper)
                clock, values = _ramp(last[columns], value)
            case Attach(boxes, gripper):
                ended = [box for box in boxes if box in open_since]
                attachments += [Attachment(box, *open_since.pop(box), count - 1) for box in ended]
                open_since |= dict.fromkeys(boxes, (gripper, count - 1))
                continue
            case Release(boxes):
                attachments += [Attachment(box, *open_since.pop(box), count - 1) for box in boxes]
                continue
        block = np.tile(last, (len(clock) - 1, 1))
        block[:, columns] = values[1:]
        if len(block):
            rows.append(block)
            times.append(times[-1][-1] + clock[1:])
            count += len(block)
    attachments += [Attachment(b, gripper, i, count - 1) for b, (gripper, i) in open_since.items()]
    names = (*ARM_JOINTS, *(joint for g in GRIPPERS for joint in FINGER_JOINTS[g]))
    return Trajectory(names, np.concatenate(times), np.concatenate(rows), tuple(attachments))


def _finger_slice(gripper: str) -> slice:
    width = len(FINGER_JOINTS[gripper])
    start = len(ARM_JOINTS) + width * GRIPPERS.index(gripper)
    return slice(start, start + width)


def _ramp(start: Array, value: float) -> tuple[Array, Array]:
    duration = float(np.max(np.abs(value - start))) / (_FINGER_SHARE * FINGER_VELOCITY)
    count = 1 + int(np.ceil(duration / INTERVAL))
    return np.linspace(0.0, duration, count), np.linspace(start, np.full_like(start, value), count)
