"""A Rerun recording, read back: everything is where the plan has it, at the plan's times."""

import sys
from pathlib import Path

import numpy as np
import outputs
import pyarrow as pa
import pytest
from rerun.chunk import RrdReader

from guided_lgp.errors import InputError
from guided_lgp.logic import Action, Goal
from guided_lgp.scene import Scene, generate
from guided_lgp.view import motion
from guided_lgp.view.motion import frames
from guided_lgp.view.recording import PLAN, TIMELINE, write_recording

SKELETON = (Action("grasp", ("pr2L", "red")), Action("place", ("pr2L", "red", "green")))


@pytest.fixture(scope="module")
def scene() -> Scene:
    return generate("a", 1, 0, "scene").scenes[0]


def moving(file: Path, entity: str) -> pa.Table:
    """What a recording has of an entity at times of the plan."""
    batches = [
        chunk.to_record_batch()
        for chunk in RrdReader(file).stream()
        if chunk.entity_path == entity and TIMELINE in chunk.timeline_names
    ]
    return pa.Table.from_batches(batches)


def test_bodies_and_joints_are_where_the_plan_has_them(scene: Scene, tmp_path: Path) -> None:
    trajectory = outputs.motion("red")
    write_recording(trajectory, scene, tmp_path / "plan.rrd")  # of no actions, as it were
    shown = frames(scene, trajectory)
    table = moving(tmp_path / "plan.rrd", "/boxes/red").sort_by(TIMELINE)
    nanoseconds = np.array(table[TIMELINE].cast(pa.int64()))
    assert np.allclose(nanoseconds, [1e9 * frame.time for frame in shown], atol=1)
    positions = [row[0] for row in table["Transform3D:translation"].to_pylist()]
    assert np.allclose(positions, [frame.boxes["red"][:3] for frame in shown], atol=1e-6)
    chunks = list(RrdReader(tmp_path / "plan.rrd").stream())
    still = {chunk.entity_path for chunk in chunks if chunk.is_static}
    turning = {chunk.entity_path for chunk in chunks if TIMELINE in chunk.timeline_names}
    assert {"/tables/tab1", "/boxes/blue", "/pr2"} <= still
    assert any(path.endswith("/l_shoulder_pan_joint") for path in turning - still)


def test_the_actions_are_logged_where_they_begin(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    trajectory = outputs.with_fingers(outputs.motion("red"))
    monkeypatch.setattr(motion, "switches_of", lambda *_: [5, 9])
    file = tmp_path / "plan.rrd"
    write_recording(trajectory, scene, file, SKELETON, (Goal("on", ("red", "green")),))
    table = moving(file, f"{PLAN}/pr2L").sort_by(TIMELINE)
    texts = [row[0] for row in table["TextLog:text"].to_pylist()]
    assert texts == ["(grasp pr2L red)", "(place pr2L red green)"]
    seconds = np.array(table[TIMELINE].cast(pa.int64())) / 1e9
    assert np.allclose(seconds, [0.0, trajectory.times[5]])


def test_without_the_package_the_extra_is_named(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(InputError, match=r"pip install 'guided-lgp\[rerun\]'"):
        write_recording(outputs.motion("red"), scene, tmp_path / "plan.rrd")
    assert not list(tmp_path.iterdir())
