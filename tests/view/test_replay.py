import re
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from threading import Event, Thread
from types import SimpleNamespace
from urllib.request import urlopen

import numpy as np
import outputs
import pytest

from guided_lgp.bounds.results import Trajectory
from guided_lgp.errors import InputError
from guided_lgp.logic import Action, Goal
from guided_lgp.poses import compose, inverse, pose
from guided_lgp.scene import Scene, generate
from guided_lgp.scene.bodies import COLOURS
from guided_lgp.view import motion
from guided_lgp.view.bodies import box_colours
from guided_lgp.view.live import _show_whole_robot, view
from guided_lgp.view.motion import frames, play, steps
from guided_lgp.view.replay import replay_html
from guided_lgp.view.viewer import Viewer
from stand_ins import full_disk


@pytest.fixture(scope="module")
def scene() -> Scene:
    return generate("a", 1, 0, "<b>scene").scenes[0]


def test_an_attached_box_follows_the_tool_and_stays_where_it_is_left(scene: Scene) -> None:
    name = scene.boxes[0].name
    trajectory = outputs.motion(name)
    (carried,) = trajectory.attachments
    start = pose(scene.boxes[0].position, scene.boxes[0].yaw)
    grasp = compose(inverse(scene.robot.tool_pose(trajectory.q[carried.start], "pr2L")), start)
    end = compose(scene.robot.tool_pose(trajectory.q[carried.end], "pr2L"), grasp)
    assert np.linalg.norm(end[:3] - start[:3]) > 0.1
    with Viewer(scene) as viewer:
        total = sum(play(viewer, frames(scene, trajectory)))
        shown = viewer.server.scene.get_handle_by_name(f"/boxes/{name}")
        assert shown is not None
        assert np.allclose(shown.position, end[:3], atol=1e-4)
    assert total == pytest.approx(trajectory.times[-1])


def test_page_is_self_contained_deterministic_and_escaped(scene: Scene, tmp_path: Path) -> None:
    trajectory = outputs.motion(scene.boxes[0].name)
    pages = [tmp_path / "deep" / name for name in ("one.html", "two.html")]
    for page in pages:
        replay_html(trajectory, scene, page)
    text = pages[0].read_text(encoding="utf-8")
    assert pages[1].read_text(encoding="utf-8") == text
    assert len(text) < 2_000_000
    assert "<title>Replay: &lt;b&gt;scene" in text
    head = re.sub(r'"[A-Za-z0-9+/=]{1000,}"', "", text)
    assert not re.search(r"<(script|link|img)[^>]+(src|href)=[\"']?(https?:|//)", head)


def test_pages_are_the_same_whatever_the_processor(scene: Scene, tmp_path: Path) -> None:
    """Others round the last bits of a motion differently."""
    trajectory, rng = outputs.motion(scene.boxes[0].name), np.random.default_rng(1)
    other = replace(
        trajectory,
        times=trajectory.times + rng.normal(0, 1e-14, trajectory.times.shape),
        q=trajectory.q + rng.normal(0, 1e-14, trajectory.q.shape),
    )
    for name, shown in (("one", trajectory), ("two", other)):
        replay_html(shown, scene, tmp_path / name)
    assert (tmp_path / "one").read_bytes() == (tmp_path / "two").read_bytes()


def test_a_full_disk_leaves_no_page(scene: Scene, tmp_path: Path) -> None:
    with full_disk(), pytest.raises(InputError, match="File too large"):
        replay_html(outputs.motion(scene.boxes[0].name), scene, tmp_path / "page.html")
    assert list(tmp_path.iterdir()) == []


def named(scene: Scene, *names: str) -> Scene:
    """The scene with copies of its first box under these names."""
    boxes = tuple(scene.boxes[0].model_copy(update={"name": name}) for name in names)
    return scene.model_copy(update={"boxes": boxes})


def test_boxes_are_told_apart_by_colour(scene: Scene) -> None:
    mug, red, jar = box_colours(named(scene, "mug", "red", "jar"))
    assert red == COLOURS["red"]
    assert box_colours(named(scene, "mug", "blue", "tin")) == [mug, COLOURS["blue"], jar]
    ten = box_colours(named(scene, *(f"box{number}" for number in range(10))))
    assert ten[:2] == [mug, jar]
    assert min(np.linalg.norm(np.subtract(a, b)) for a, b in combinations(ten, 2)) > 0.1


def test_live_view_serves_the_loopback_interface_until_stopped(scene: Scene) -> None:
    stop, ready, addresses = Event(), Event(), []

    def announce(address: str) -> None:
        addresses.append(address)
        ready.set()

    thread = Thread(target=view, args=(scene, outputs.motion("red"), 8150, announce, stop))
    thread.start()
    try:
        assert ready.wait(30)
        (address,) = addresses
        assert address.startswith("http://127.0.0.1:")
        with urlopen(address, timeout=10) as answer:
            assert answer.status == 200
    finally:
        stop.set()
        thread.join(30)
    assert not thread.is_alive()


def moved(scene: Scene, rows: int, *moving: tuple[str, int, int]) -> Trajectory:
    """A motion in steps of 0.1 s; the first joint of an arm turns from a row to another one."""
    robot = scene.robot.description
    q = np.zeros((rows, len(robot.moving_joints)))
    for hand, first, last in moving:
        column = robot.moving_joints.index(robot.arms[hand].joints[0])
        q[first + 1 : last + 1, column] = 0.01
        q[:, column] = np.cumsum(q[:, column])
    return Trajectory(robot.moving_joints, 0.1 * np.arange(rows), q, ())


def spans(scene: Scene, trajectory: Trajectory, *hands: str) -> list[tuple[float, float]]:
    skeleton = tuple(Action("grasp", (hand, "red")) for hand in hands)
    listed = steps(scene, skeleton, trajectory)
    assert tuple(step.action for step in listed) == skeleton
    return [(round(step.time, 3), round(step.end, 3)) for step in listed]


@pytest.mark.parametrize(("aspect", "fov"), [(1.6, 0.75), (1.0, 0.75), (0.5, 1.33)])
def test_a_telephone_shows_the_whole_robot(aspect: float, fov: float) -> None:
    camera = SimpleNamespace(aspect=aspect, fov=0.75)
    _show_whole_robot(SimpleNamespace(camera=camera))
    assert camera.fov == pytest.approx(fov, abs=0.01)


def test_steps_follow_each_other_or_overlap(scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(motion, "switches_of", lambda *_: [10, 14, 20])
    alone = moved(scene, 31, ("pr2L", 0, 30))  # without a rest: from switch to switch
    assert spans(scene, alone, "pr2L", "pr2L", "pr2L") == [(0, 1), (1, 1.4), (1.4, 3)]
    both = moved(scene, 31, ("pr2L", 0, 30), ("pr2R", 5, 17))
    assert spans(scene, both, "pr2L", "pr2R", "pr2L") == [(0, 1), (0.5, 1.7), (1, 3)]
    turns = moved(scene, 31, ("pr2L", 0, 12), ("pr2R", 12, 30))  # one after the other
    assert spans(scene, turns, "pr2L", "pr2R", "pr2R") == [(0, 1.2), (1.2, 1.4), (1.4, 3)]


def test_steps_are_listed_and_lead_the_player(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trajectory = outputs.with_fingers(outputs.motion(scene.boxes[0].name))
    skeleton = (Action("grasp", ("pr2L", "red")), Action("place", ("pr2L", "red", "green")))
    assert steps(scene, skeleton[::-1], trajectory) == []
    monkeypatch.setattr(motion, "switches_of", lambda *_: [5, 9])
    page = tmp_path / "page.html"
    replay_html(trajectory, scene, page, skeleton, (Goal("on", ("red", "green")),))
    text = page.read_text(encoding="utf-8")
    turn, end = (f"{1 + trajectory.times[row]:.1f}" for row in (5, -1))
    assert f'<button data-time="1.0" data-end="{turn}">(grasp pr2L red)</button>' in text
    assert f'<button data-time="{turn}" data-end="{end}">(place pr2L red green)</button>' in text
    assert "<strong>(on red green)</strong>" in text
