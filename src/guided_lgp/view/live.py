"""A scene, or the motion of a plan, live in the browser."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from threading import Event
from typing import Any

import numpy as np

from guided_lgp.bounds.results import Trajectory
from guided_lgp.logic import Objective, Skeleton, format_objective
from guided_lgp.scene.model import Scene
from guided_lgp.scene.world import initial_poses
from guided_lgp.view.motion import FRAME_RATE, Frame, Step, frames, show, steps
from guided_lgp.view.viewer import FIELD_OF_VIEW, Viewer

_SPEEDS = ("0.5", "1", "2", "4")


def view(
    scene: Scene,
    trajectory: Trajectory | None = None,
    port: int = 8080,
    announce: Callable[[str], None] = print,
    stop: Event | None = None,
    *,
    skeleton: Skeleton = (),
    objective: Objective = (),
) -> None:
    """Serve a scene on the loopback interface until interrupted (Ctrl-C).

    Args:
        scene: the scene to show, as it is at the start.
        trajectory: a motion that starts in the scene; it is played over and over, with controls.
        port: TCP port on 127.0.0.1; the next free one is taken if it is in use.
        announce: is given the address to open.
        stop: ends the service when set.
        skeleton: the actions of the motion, shown as buttons that lead to them.
        objective: what the motion achieves, for its heading.
    """
    stop = stop or Event()
    with Viewer(scene, port) as viewer, suppress(KeyboardInterrupt):
        viewer.server.on_client_connect(_show_whole_robot)
        for name, placement in initial_poses(scene).items():  # also of what is in a hand
            viewer.move_box(name, placement)
        player = None
        if trajectory is not None:
            listed = steps(scene, skeleton, trajectory) if skeleton else []
            player = _Player(viewer, frames(scene, trajectory), listed, objective)
        announce(f"http://127.0.0.1:{viewer.server.get_port()}")
        while not stop.wait(1.0 / FRAME_RATE):
            if player is not None:
                player.tick(1.0 / FRAME_RATE)


def _show_whole_robot(client: Any) -> None:
    """On a screen higher than wide the angle of view grows until the arms are in the picture."""
    camera = client.camera
    if camera.aspect < 1.0:
        camera.fov = 2.0 * float(np.arctan(np.tan(FIELD_OF_VIEW / 2.0) / camera.aspect))


class _Player:
    """A motion with its controls: play and pause, time, speed, and a button per action."""

    def __init__(
        self, viewer: Viewer, shown: Sequence[Frame], listed: Sequence[Step], objective: Objective
    ) -> None:
        self._viewer = viewer
        self._frames = shown
        self._times = np.array([frame.time for frame in shown])
        self._steps = listed
        gui = viewer.server.gui
        gui.add_markdown(f"**{format_objective(objective)}**")
        self._current = gui.add_markdown("")
        self._playing = gui.add_checkbox("play", initial_value=True)
        end = max(round(float(self._times[-1]), 2), 0.1)
        self._time: Any = gui.add_slider("time (s)", 0.0, end, 0.01, 0.0)
        self._speed = gui.add_dropdown("speed", _SPEEDS, initial_value="1")
        for step in listed:
            gui.add_button(str(step.action)).on_click(partial(self._go, step.time))
        self._shown = -1.0

    def _go(self, time: float, _: object) -> None:
        self._time.value = time

    def tick(self, elapsed: float) -> None:
        """Show what the controls ask for, ``elapsed`` seconds after the last time."""
        now = float(self._time.value)
        if self._playing.value and now == self._shown:
            now = round(now + elapsed * float(self._speed.value), 2)
            now = now if now <= self._times[-1] else 0.0
            self._time.value = now
        if now != self._shown:
            self._shown = now
            row = int(np.searchsorted(self._times, now, side="right")) - 1
            show(self._viewer, self._frames[max(row, 0)])
            self._current.content = self._actions(now)

    def _actions(self, now: float) -> str:
        """What the hands are at."""
        return " ".join(
            f"{number} `{step.action}`"
            for number, step in enumerate(self._steps, 1)
            if step.time <= now < step.end
        )
