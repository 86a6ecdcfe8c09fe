"""A plan as a self-contained 3D page: viser's recording, played back in a browser."""

import html
from pathlib import Path
from string import Template

from guided_lgp.bounds.results import Trajectory
from guided_lgp.documents import write_text
from guided_lgp.logic import Objective, Skeleton, format_objective
from guided_lgp.scene.model import Scene
from guided_lgp.view.motion import Step, frames, play, steps
from guided_lgp.view.viewer import FIELD_OF_VIEW, Viewer

_STILL_S = 1.0
"""How long the first and the last frame stay (s)."""


def replay_html(
    trajectory: Trajectory,
    scene: Scene,
    path: Path,
    skeleton: Skeleton = (),
    objective: Objective = (),
) -> None:
    """Write a page that plays a motion: one file, no network.

    Args:
        trajectory: the motion of a plan.
        scene: the scene it starts in.
        path: the HTML file to write; its folder is made.
        skeleton: the plan's actions, shown as a list that follows the motion and moves it.
        objective: the goals, shown above the list.

    Raises:
        InputError: the file cannot be written.
    """
    with Viewer(scene) as viewer:
        # A serializer of viser records until it is asked for its page, once.
        recording = viewer.server.get_scene_serializer()
        recording.insert_sleep(_STILL_S)
        for wait in play(viewer, frames(scene, trajectory)):
            recording.insert_sleep(wait)
        recording.insert_sleep(_STILL_S)
        page = recording.as_html()
    title = f"<title>Replay: {html.escape(scene.name)}</title>"
    page = page.replace("<title>Viser</title>", title, 1)
    panel = _panel(steps(scene, skeleton, trajectory), objective) if skeleton else ""
    head, _, tail = page.rpartition("</body>")
    write_text(path, f"{head}{panel}</body>{tail}")


def _panel(shown: list[Step], objective: Objective) -> str:
    items = "".join(
        f'<li><button data-time="{_STILL_S + step.time:.1f}" data-end="{_STILL_S + step.end:.1f}">'
        f"{html.escape(str(step.action))}</button></li>"
        for step in shown
    )
    template = Path(__file__).with_name("panel.html").read_text(encoding="utf-8")
    goals = html.escape(format_objective(objective))
    return Template(template).substitute(goals=goals, steps=items, fov=FIELD_OF_VIEW)
