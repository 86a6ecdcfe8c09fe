"""A scene, or the motion of a plan, live in the browser."""

from collections.abc import Callable
from contextlib import suppress
from threading import Event

from guided_lgp.bounds.results import Trajectory
from guided_lgp.scene.model import Scene
from guided_lgp.view.replay import play
from guided_lgp.view.viewer import Viewer

_PAUSE_S = 2.0
"""Between two rounds of a motion (s)."""


def view(
    scene: Scene,
    trajectory: Trajectory | None = None,
    port: int = 8080,
    announce: Callable[[str], None] = print,
    stop: Event | None = None,
) -> None:
    """Serve a scene on the loopback interface until interrupted (Ctrl-C).

    Args:
        scene: the scene to show, both arms at their side.
        trajectory: a motion that starts in the scene; it is played over and over.
        port: TCP port on 127.0.0.1; the next free one is taken if it is in use.
        announce: is given the address to open.
        stop: ends the service when set.
    """
    stop = stop or Event()
    with Viewer(scene, port) as viewer, suppress(KeyboardInterrupt):
        announce(f"http://127.0.0.1:{viewer.server.get_port()}")
        while not stop.wait(_PAUSE_S):
            if trajectory is not None:
                for wait in play(viewer, trajectory):
                    if stop.wait(wait):
                        return
