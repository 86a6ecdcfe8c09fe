"""Exported motions, read back without the code that wrote them: same plan, limits kept, checked."""

import copy
import csv
import json
import subprocess
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from plan_checker import check
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore
from scipy.interpolate import BPoly

from guided_lgp import cli
from guided_lgp.bounds.plan_file import read_plan
from guided_lgp.errors import InputError
from guided_lgp.export import export_plan
from guided_lgp.export.messages import trajectory_document
from guided_lgp.export.motion import Motion, motion_of

EXAMPLES = Path(__file__).parents[2] / "examples"
ALONE = ("--goal", "(on red green)", "--goal", "(held blue)")
BOTH = ("--goal", "(on red tab2)", "--goal", "(held blue)", "--goal", "(on green tab1)")
TASKS = {"one arm": ALONE, "both at once": BOTH, "in turns": (*BOTH, "--no-coordinate")}
FINER = 6
"""Rows in place of one, to check a controller's interpolation."""


@pytest.fixture(scope="module", params=TASKS.values(), ids=TASKS)
def plan_file(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("plan") / "plan.json"
    command = [sys.executable, "-m", "guided_lgp.cli", "plan", str(EXAMPLES / "three_boxes.json")]
    command += [*request.param, "--out", str(out)]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    return out


@pytest.fixture(scope="module")
def motion(plan_file: Path) -> Motion:
    return motion_of(read_plan(plan_file))


def read_bag(folder: Path) -> dict[str, list[Any]]:
    """The messages of a bag by topic."""
    store = get_typestore(Stores.ROS2_JAZZY)
    found: dict[str, list[Any]] = {}
    with Reader(folder) as bag:
        for connection, _, data in bag.messages():
            message = store.deserialize_cdr(data, connection.msgtype)
            found.setdefault(connection.topic, []).append(message)
    return found


def nanoseconds(time: Any) -> int:
    return int(time.sec) * 10**9 + int(time.nanosec)


def joined(messages: list[Any]) -> tuple[list[int], np.ndarray, np.ndarray]:
    """Times (ns), positions and velocities over all segments of a controller."""
    times, positions, velocities = [], [], []
    for message in messages:
        for point in message.points:
            times.append(nanoseconds(message.header.stamp) + nanoseconds(point.time_from_start))
            positions.append(point.positions)
            velocities.append(point.velocities)
    return times, np.array(positions), np.array(velocities)


def with_rows(plan: dict[str, Any], times: Any, q: Any, factor: int = 1) -> dict[str, Any]:
    """The plan with other rows; each old one is one of the new."""
    changed = copy.deepcopy(plan)
    changed["path"]["times"] = np.asarray(times).tolist()
    changed["path"]["q"] = np.asarray(q).tolist()
    for attachment in changed["path"]["attachments"]:
        attachment["start"] *= factor
        attachment["end"] *= factor
    return changed


def test_a_bag_read_back_is_the_plan(plan_file: Path, tmp_path: Path) -> None:
    plan = json.loads(plan_file.read_text())
    export_plan(read_plan(plan_file), tmp_path / "bag")
    topics = read_bag(tmp_path / "bag")
    q = np.full_like(np.array(plan["path"]["q"]), np.nan)
    for topic, messages in topics.items():
        if topic == "/joint_states":
            continue
        assert 1 < len(messages) <= len(plan["actions"])
        times, positions, _ = joined(messages)
        assert len(times) == len(q)
        q[:, [plan["joint_names"].index(name) for name in messages[0].joint_names]] = positions
    np.testing.assert_array_equal(q, plan["path"]["q"])
    assert check(with_rows(plan, np.array(times) / 1e9, q)) == []
    states = topics["/joint_states"]
    assert [nanoseconds(state.header.stamp) for state in states] == times
    assert states[0].name == plan["joint_names"]


def test_segments_are_what_controllers_accept(plan_file: Path, tmp_path: Path) -> None:
    plan = json.loads(plan_file.read_text())
    export_plan(read_plan(plan_file), tmp_path / "bag")
    for topic, messages in read_bag(tmp_path / "bag").items():
        if topic == "/joint_states":
            continue
        times, positions, _ = joined(messages)
        assert all(later > earlier for earlier, later in pairwise(times))
        assert np.abs(np.diff(positions, axis=0)).max() < np.pi
        start = [
            plan["path"]["q"][0][plan["joint_names"].index(n)] for n in messages[0].joint_names
        ]
        assert positions[0].tolist() == start
        for message in messages:  # a robot that rests: controllers refuse any other end
            assert not message.points[-1].velocities.any()
            for point in message.points:
                widths = {len(point.positions), len(point.velocities), len(point.accelerations)}
                assert widths == {len(message.joint_names)}


@pytest.mark.parametrize("derivatives", [2, 3], ids=["cubic", "quintic"])
def test_interpolation_keeps_the_path_and_the_limits(
    plan_file: Path, motion: Motion, derivatives: int
) -> None:
    plan = json.loads(plan_file.read_text())
    figures = [motion.positions, motion.velocities, motion.accelerations][:derivatives]
    curve = BPoly.from_derivatives(motion.times, np.stack(figures, axis=1))
    shares = np.linspace(0.0, 1.0, FINER, endpoint=False)
    places = (motion.times[:-1, None] + np.diff(motion.times)[:, None] * shares).ravel()
    places = np.append(places, motion.times[-1])
    fine = with_rows(plan, places, curve(places), FINER)
    # between rows of the plan, its own times no longer tell which keyframe is meant
    assert {fault.kind for fault in check(fine)} <= {"keyframe"}
    robot = motion.robot
    arms = [motion.joint_names.index(name) for name in robot.joint_names]
    assert np.all(np.abs(curve(places, 1)[:, arms]) <= robot.velocity_limits * 1.001)
    assert np.all(np.abs(curve(places, 2)[:, arms]) <= robot.acceleration_limits * 1.001)
    straight = np.concatenate(
        [
            np.linspace(a, b, 30, endpoint=False)
            for a, b in zip(motion.positions[:-1], motion.positions[1:], strict=True)
        ]
    )
    scene = read_plan(plan_file).scene
    for arm in robot.arms.values():
        columns = [motion.joint_names.index(name) for name in robot.joint_names]
        tool = scene.robot.tool_poses(straight[:, columns])[arm.gripper][:, :3]
        followed = scene.robot.tool_poses(curve(places)[:, columns])[arm.gripper][:, :3]
        rows = np.minimum(np.arange(len(places)) // FINER, len(motion.times) - 2)
        near = [
            np.linalg.norm(tool[max(0, (r - 1) * 30) : (r + 2) * 30] - point, axis=1).min()
            for r, point in zip(rows, followed, strict=True)
        ]
        assert max(near) < 1e-3


def test_half_the_speed_takes_twice_the_time(plan_file: Path, motion: Motion) -> None:
    slow = motion_of(read_plan(plan_file), 0.5)
    np.testing.assert_allclose(slow.times, 2 * motion.times)
    np.testing.assert_allclose(slow.velocities, motion.velocities / 2, atol=1e-12)
    np.testing.assert_allclose(slow.accelerations, motion.accelerations / 4, atol=1e-12)
    for speed in (0.0, 1.5, float("nan")):
        with pytest.raises(InputError, match="speed"):
            motion_of(read_plan(plan_file), speed)


def test_grippers_are_told_to_open_and_to_close(motion: Motion) -> None:
    told: dict[str, list[float]] = {}
    for part in trajectory_document(motion)["segments"]:
        for command in part["gripper_commands"]:
            told.setdefault(command["gripper"], []).append(command["position"])
    acting = [segment.action.split()[1] for segment in motion.segments]
    assert set(told) == set(acting)
    for gripper, widths in told.items():
        assert len(widths) >= acting.count(gripper)
        assert all(a - b > 0.01 for a, b in zip(widths[::2], widths[1::2], strict=False))
        assert all(b - a > 0.01 for a, b in zip(widths[1::2], widths[2::2], strict=False))
        assert 0.0 < min(widths) <= max(widths) < 0.1


def test_the_table_has_a_row_per_point(
    plan_file: Path, motion: Motion, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        cli.main(["export", str(plan_file), str(tmp_path / "motion.csv"), "--speed", "1"])
    assert ended.value.code in (0, None)
    assert "motion.csv" in capsys.readouterr().out
    with (tmp_path / "motion.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [int(row["time_ns"]) for row in rows] == motion.nanoseconds
    assert list(dict.fromkeys(row["action"] for row in rows)) == [s.action for s in motion.segments]


def test_a_plan_of_no_actions_moves_nothing(plan_file: Path) -> None:
    nothing = read_plan(plan_file).model_copy(update={"actions": ()})
    with pytest.raises(InputError, match="its goals hold at the start"):
        motion_of(nothing)


def test_what_cannot_be_written_is_one_line(plan_file: Path, tmp_path: Path) -> None:
    plan = read_plan(plan_file)
    with pytest.raises(InputError, match="suffix"):
        export_plan(plan, tmp_path / "motion.xml")
    with pytest.raises(InputError, match="exists"):
        export_plan(plan, tmp_path)
    with pytest.raises(InputError, match="cannot be written: File exists"):
        export_plan(plan, plan_file / "bag")
