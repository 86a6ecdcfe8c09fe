"""A plan as a short film: PyBullet's pictures of its motion in an animated GIF."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from PIL import Image

from guided_lgp.bounds.results import Trajectory
from guided_lgp.documents import written_whole
from guided_lgp.poses import Array
from guided_lgp.scene.model import Scene
from guided_lgp.scene.world import Camera, World
from guided_lgp.view.motion import frames, play

_FRAMES_PER_S = 12.5
"""GIF counts hundredths of a second: eight of them."""
_COLOURS = 128
"""One palette for the whole film, from its first picture."""


class _Stage:
    """PyBullet in the place of the 3D viewer; see :class:`guided_lgp.view.motion.Stage`."""

    def __init__(self, scene: Scene, world: World) -> None:
        self._robot = scene.robot.description
        self._world = world
        self._q: Array = scene.robot.start
        self._fingers: dict[str, float] = {}

    def configure(self, joints: Mapping[str, float]) -> None:
        robot = self._robot
        self._q = np.array([joints[name] for name in robot.joint_names])
        self._fingers = robot.finger_values(
            np.array([joints[name] for name in robot.moving_joints])
        )
        self._world.set(self._q, {}, self._fingers)

    def move_box(self, name: str, box_pose: Array) -> None:
        self._world.set(self._q, {name: box_pose}, self._fingers)


def write_film(
    trajectory: Trajectory, scene: Scene, path: Path, speed: float = 4.0, width: int = 480
) -> None:
    """Write an animated GIF of a motion; the same motion gives the same bytes.

    Args:
        trajectory: the motion of a plan.
        scene: the scene it starts in.
        path: the GIF file; its folder is made.
        speed: how much faster than the robot the film is.
        width: of the picture, in pixels.

    Raises:
        InputError: the file cannot be written.
    """
    camera = Camera(view=34.0, width=width, height=width * 5 // 8)
    pictures, due = [], 0.0
    with World(scene) as world:
        for wait in play(_Stage(scene, world), frames(scene, trajectory)):
            due -= wait / speed
            if due < 0.0:
                pictures.append(Image.fromarray(world.render(camera)))
                due += 1.0 / _FRAMES_PER_S
        pictures.append(Image.fromarray(world.render(camera)))
    palette = pictures[0].quantize(_COLOURS)
    drawn = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    step = round(1000 / _FRAMES_PER_S)
    with written_whole(path) as file:
        drawn[0].save(
            file,
            "GIF",
            save_all=True,
            append_images=drawn[1:],
            duration=[step] * (len(drawn) - 1) + [2000],
            loop=0,
        )
