"""A plan's motion as pictures in time, and its actions as steps: what every display shows."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from guided_lgp.bounds.results import Trajectory
from guided_lgp.bounds.verify.attachments import switches_of
from guided_lgp.logic import Skeleton
from guided_lgp.poses import Array, compose, inverse
from guided_lgp.scene.model import Scene
from guided_lgp.scene.world import initial_poses

FRAME_RATE = 15.0
"""Frames per second."""


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
    """An action, and the time (s) at which the robot turns to it."""

    text: str
    time: float


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
        shown.append(Frame(float(trajectory.times[index]), joints, dict(boxes)))
    return shown


def _rows(trajectory: Trajectory) -> list[int]:
    """Indices into ``times``: one per frame, and every start and end of an attachment."""
    _, regular = np.unique(np.floor(trajectory.times * FRAME_RATE), return_index=True)
    switches = [i for a in trajectory.attachments for i in (a.start, a.end)]
    return sorted({*regular.tolist(), *switches, len(trajectory.times) - 1})


def steps(scene: Scene, skeleton: Skeleton, trajectory: Trajectory) -> list[Step]:
    """The actions of a plan; one begins when the switch of the one before is done."""
    switches = switches_of(scene, skeleton, trajectory)
    if not isinstance(switches, list):
        return []
    began = [0.0, *trajectory.times[switches[:-1]].tolist()]
    return [Step(str(action), time) for action, time in zip(skeleton, began, strict=True)]


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
            yield following.time - frame.time
