"""A plan as a self-contained 3D page: viser's recording, played back in a browser."""

import html
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Protocol

import numpy as np

from guided_lgp.bounds.results import Trajectory
from guided_lgp.documents import write_text
from guided_lgp.poses import Array, compose, inverse, pose
from guided_lgp.scene.model import Scene
from guided_lgp.view.viewer import Viewer

FRAME_RATE = 15.0
"""Frames per second of a recording."""

_STILL_S = 1.0
"""How long the first and the last frame stay (s)."""


def replay_html(trajectory: Trajectory, scene: Scene, path: Path) -> None:
    """Write a page that plays a motion: one file, no network.

    Args:
        trajectory: the motion of a plan.
        scene: the scene it starts in.
        path: the HTML file to write; its folder is made.

    Raises:
        InputError: the file cannot be written.
    """
    with Viewer(scene) as viewer:
        # A serializer of viser records until it is asked for its page, once.
        recording = viewer.server.get_scene_serializer()
        recording.insert_sleep(_STILL_S)
        for wait in play(viewer, trajectory):
            recording.insert_sleep(wait)
        recording.insert_sleep(_STILL_S)
        page = recording.as_html()
    title = f"<title>Replay: {html.escape(scene.name)}</title>"
    write_text(path, page.replace("<title>Viser</title>", title, 1))


class Stage(Protocol):
    """What shows a motion: the 3D viewer, or whatever else has a robot and boxes to move."""

    @property
    def scene(self) -> Scene:
        """The scene that is shown."""
        ...

    def configure(self, joints: Mapping[str, float]) -> None:
        """Set joint values (rad) by name."""
        ...

    def tool_pose(self, gripper: str) -> Array:
        """Pose (7,) of the gripper's tool frame in the world."""
        ...

    def move_box(self, name: str, box_pose: Array) -> None:
        """Put a box at a pose (7,) in the world."""
        ...


def play(stage: Stage, trajectory: Trajectory) -> Iterator[float]:
    """Move a scene through a motion, from its first to its last configuration.

    The boxes start where the scene has them.

    Yields:
        After each frame, the time (s) until the next one.
    """
    boxes = {box.name: pose(box.position, box.yaw) for box in stage.scene.boxes}
    for name, start in boxes.items():
        stage.move_box(name, start)
    grasps: dict[int, Array] = {}
    shown = _frames(trajectory)
    for step, index in enumerate(shown):
        stage.configure(dict(zip(trajectory.joint_names, trajectory.q[index], strict=True)))
        for number, attachment in enumerate(trajectory.attachments):
            if not attachment.start <= index <= attachment.end:
                continue
            tool = stage.tool_pose(attachment.gripper)
            if index == attachment.start:
                grasps[number] = compose(inverse(tool), boxes[attachment.box])
            boxes[attachment.box] = compose(tool, grasps[number])
            stage.move_box(attachment.box, boxes[attachment.box])
        if step + 1 < len(shown):
            yield float(trajectory.times[shown[step + 1]] - trajectory.times[index])


def _frames(trajectory: Trajectory) -> list[int]:
    """Indices into ``times``: one per frame, and every start and end of an attachment."""
    _, regular = np.unique(np.floor(trajectory.times * FRAME_RATE), return_index=True)
    switches = [i for a in trajectory.attachments for i in (a.start, a.end)]
    return sorted({*regular.tolist(), *switches, len(trajectory.times) - 1})
