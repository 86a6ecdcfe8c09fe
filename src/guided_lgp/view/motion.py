"""A plan's motion as pictures in time, and its actions as steps: what every display shows."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Protocol

import numpy as np

from guided_lgp.bounds.results import Trajectory
from guided_lgp.bounds.verify.attachments import switches_of
from guided_lgp.logic import Action, Skeleton
from guided_lgp.poses import Array, compose, inverse
from guided_lgp.scene.model import Scene
from guided_lgp.scene.world import initial_poses

FRAME_RATE = 15.0
"""Frames per second."""
DIGITS = 6
"""To which times (s) and poses (m) are shown: further ones differ from processor to processor."""
_STAND_S = 0.4
"""A hand that stands for so long has nothing to do; fingers close and arms turn back in less."""


@dataclass(frozen=True)
class Frame:
    """Where everything is at a time."""

    time: float
    """s."""
    joints: Mapping[str, float]
    """rad, m where prismatic, by name."""
    boxes: Mapping[str, Array]
    """Pose (7,) in the world, by name."""


@dataclass(frozen=True)
class Step:
    """An action, and from when to when (s) its hand is at it."""

    action: Action
    time: float
    end: float


class Stage(Protocol):
    """What can show a frame."""

    def configure(self, joints: Mapping[str, float]) -> None:
        """Set joint values (rad, m where prismatic) by name."""
        ...

    def move_box(self, name: str, box_pose: Array) -> None:
        """Put a box at a pose (7,) in the world."""
        ...


def frames(scene: Scene, trajectory: Trajectory) -> list[Frame]:
    """The frames of a motion, from its first to its last configuration.

    Args:
        scene: where the boxes start.
        trajectory: the motion.
    """
    robot = scene.robot.description
    tools = scene.robot.tool_poses(trajectory.joints(robot.joint_names))
    boxes = dict(initial_poses(scene))
    grasps: dict[int, Array] = {}
    shown = []
    for index in _rows(trajectory):
        for number, attachment in enumerate(trajectory.attachments):
            if attachment.start <= index <= attachment.end:
                tool = tools[attachment.gripper][index]
                grasp = grasps.setdefault(number, compose(inverse(tool), boxes[attachment.box]))
                boxes[attachment.box] = compose(tool, grasp)
        joints = dict(zip(trajectory.joint_names, trajectory.q[index].tolist(), strict=True))
        shown.append(Frame(round(float(trajectory.times[index]), DIGITS), joints, dict(boxes)))
    return shown


def _rows(trajectory: Trajectory) -> list[int]:
    """Indices into ``times``: one per frame, and every start and end of an attachment."""
    numbers = np.floor(np.round(trajectory.times, DIGITS) * FRAME_RATE + 10.0**-DIGITS)
    _, regular = np.unique(numbers, return_index=True)
    switches = [i for a in trajectory.attachments for i in (a.start, a.end)]
    return sorted({*regular.tolist(), *switches, len(trajectory.times) - 1})


def steps(scene: Scene, skeleton: Skeleton, trajectory: Trajectory) -> list[Step]:
    """The actions of a plan, in their order; those of different hands may overlap.

    One begins when its hand sets out, or has done the one before, and ends when the hand stands,
    or turns to the next one.
    """
    switches = switches_of(scene, skeleton, trajectory)
    if not isinstance(switches, list):
        return []
    hands = [action.symbols[0] for action in skeleton]
    spans = {
        hand: iter(_spans(_stands(scene, trajectory, hand), switches_of_hand))
        for hand, switches_of_hand in _by_hand(hands, switches).items()
    }
    times = trajectory.times
    return [
        Step(action, *(float(times[row]) for row in next(spans[hand])))
        for action, hand in zip(skeleton, hands, strict=True)
    ]


def _by_hand(hands: Sequence[str], switches: Sequence[int]) -> dict[str, list[int]]:
    pairs = list(zip(hands, switches, strict=True))
    return {hand: [switch for other, switch in pairs if other == hand] for hand in hands}


def _spans(stands: Sequence[tuple[int, int]], switches: Sequence[int]) -> list[tuple[int, int]]:
    """First and last row of every action of a hand."""
    begun = [
        max([before, *(end for _, end in stands if end <= switch)])
        for before, switch in pairwise([0, *switches])
    ]
    ended = [min(max(row, switch) for row, end in stands if end > switch) for switch in switches]
    following = [*begun[1:], ended[-1]]
    return [(a, min(b, after)) for a, b, after in zip(begun, ended, following, strict=True)]


def _stands(scene: Scene, trajectory: Trajectory, hand: str) -> list[tuple[int, int]]:
    """First and last row of every stretch in which arm and fingers stand; the end is one, too."""
    arm = scene.robot.description.arms[hand]
    moved = np.diff(trajectory.joints((*arm.joints, *arm.fingers.joints)), axis=0).any(axis=1)
    turns = np.flatnonzero(np.diff(np.pad((~moved).astype(int), 1))).tolist()
    long = [
        (start, end)
        for start, end in zip(turns[::2], turns[1::2], strict=True)
        if trajectory.times[end] - trajectory.times[start] >= _STAND_S
    ]
    return [*long, (len(trajectory.times) - 1, len(trajectory.times))]


def show(stage: Stage, frame: Frame) -> None:
    """Put robot and boxes where a frame has them."""
    stage.configure(frame.joints)
    for name, box_pose in frame.boxes.items():
        stage.move_box(name, box_pose)


def play(stage: Stage, shown: Sequence[Frame]) -> Iterator[float]:
    """Show frame after frame.

    Yields:
        After each frame but the last, the time (s) until the next one.
    """
    for frame, following in zip(shown, [*shown[1:], None], strict=True):
        show(stage, frame)
        if following is not None:
            yield round(following.time - frame.time, DIGITS)
