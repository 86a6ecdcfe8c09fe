import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from motions import scene

from guided_lgp.bounds.coarse import CoarseBound
from guided_lgp.bounds.path import PathBound
from guided_lgp.bounds.plan_file import read_plan, write_plan
from guided_lgp.bounds.results import PathResult
from guided_lgp.bounds.verify import verify_path
from guided_lgp.errors import InputError
from guided_lgp.logic import parse_objective, parse_skeleton
from guided_lgp.scene.world import World
from stand_ins import full_disk

SCENE = scene(red=(0.5, 0.3, 0.65, 0.3, "tab1"), green=(0.5, -0.3, 0.65, 0.0, "tab2"))
OBJECTIVE = parse_objective(["(held red)"])
SKELETON = parse_skeleton("(grasp pr2L red)")
STATISTICS = {"tree_size": 7, "attempts": 1, "time_s": {"coarse": 0.1}}


@pytest.fixture(scope="module")
def result() -> PathResult:
    coarse = CoarseBound(SCENE, 9)
    return PathBound(SCENE, coarse, 4).solve(coarse.solve(SKELETON))


@pytest.fixture
def file(result: PathResult, tmp_path: Path) -> Path:
    path = tmp_path / "plan.json"
    write_plan(path, SCENE, OBJECTIVE, result, STATISTICS, {"success": True})
    return path


def test_a_plan_that_is_read_back_passes_verification(file: Path, result: PathResult) -> None:
    plan = read_plan(file)
    assert plan.scene == SCENE
    assert plan.goals == OBJECTIVE
    assert plan.skeleton == SKELETON
    assert plan.statistics == STATISTICS
    assert plan.physics == {"success": True}
    assert result.trajectory is not None
    assert plan.trajectory.q == pytest.approx(result.trajectory.q, abs=1e-6)
    assert plan.trajectory.attachments == result.trajectory.attachments
    with World(plan.scene) as world:
        assert verify_path(world, plan.skeleton, plan.trajectory).violation is None


def test_keyframes_are_rows_of_the_path(file: Path, result: PathResult) -> None:
    plan = read_plan(file)
    (keyframe,) = plan.keyframes
    (attachment,) = plan.path.attachments
    assert keyframe.q == plan.path.q[attachment.start]
    assert keyframe.q[:14] == pytest.approx(result.at_switch[0].q, abs=1e-6)
    red = keyframe.boxes["red"]
    assert red.position == pytest.approx((0.5, 0.3, 0.65), abs=1e-6)
    assert red.yaw == pytest.approx(0.3, abs=1e-6)
    assert np.linalg.norm(red.quaternion) == pytest.approx(1, abs=1e-5)
    assert plan.fixed_joints == {"torso_lift_joint": 0.28}


def test_a_grip_has_its_force_and_how_far_the_fingers_close(file: Path) -> None:
    plan = read_plan(file)
    (grip,) = plan.grips
    (attachment,) = plan.path.attachments
    assert (grip.box, grip.gripper, grip.start) == ("red", "pr2L", attachment.start)
    assert grip.width == 0.07
    fingers = SCENE.robot.description.arms["pr2L"].fingers
    assert 0.06 < fingers.opening(grip.closing) < grip.width
    assert 40.0 <= grip.force <= fingers.force
    assert 0.0 < grip.ratio <= 0.5


def test_a_plan_without_grips_is_read(file: Path) -> None:
    """As older versions have written them."""
    document = json.loads(file.read_text())
    del document["grips"]
    file.write_text(json.dumps(document))
    assert read_plan(file).grips == ()


def test_writing_twice_gives_the_same_bytes_and_leaves_nothing_else(
    file: Path, result: PathResult
) -> None:
    before = file.read_bytes()
    write_plan(file, SCENE, OBJECTIVE, result, STATISTICS, {"success": True})
    assert file.read_bytes() == before
    assert [path.name for path in file.parent.iterdir()] == ["plan.json"]


def _drop_row(plan: dict[str, Any]) -> None:
    plan["path"]["q"].pop()


def _shorten_row(plan: dict[str, Any]) -> None:
    plan["path"]["q"][3].pop()


def _go_back(plan: dict[str, Any]) -> None:
    plan["path"]["times"][5] = plan["path"]["times"][2]


def _attach_beyond(plan: dict[str, Any]) -> None:
    plan["path"]["attachments"][0]["end"] = 10**6


def _attach_unknown(plan: dict[str, Any]) -> None:
    plan["path"]["attachments"][0]["box"] = "yellow"


def _garble_action(plan: dict[str, Any]) -> None:
    plan["actions"] = ["(throw pr2L red)"]


def _text_for_number(plan: dict[str, Any]) -> None:
    plan["path"]["times"][0] = "soon"


def _unknown_joint(plan: dict[str, Any]) -> None:
    plan["joint_names"][3] = "nose"


def _repeat_joint(plan: dict[str, Any]) -> None:
    plan["joint_names"][3] = plan["joint_names"][4]


def _last_for_ever(plan: dict[str, Any]) -> None:
    plan["path"]["times"][-1] = 1e300


def _drop_scene(plan: dict[str, Any]) -> None:
    del plan["scene"]


def _drop_keyframes(plan: dict[str, Any]) -> None:
    plan["keyframes"] = []


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (_drop_row, "rows for"),
        (_shorten_row, "joint_names"),
        (_go_back, "times do not increase"),
        (_attach_beyond, "lies outside"),
        (_attach_unknown, "unknown box"),
        (_garble_action, "throw"),
        (_text_for_number, "path.times.0"),
        (_unknown_joint, "joint_names"),
        (_repeat_joint, "joint_names"),
        (_last_for_ever, r"path.times.\d+: .* is more than"),
        (_drop_scene, "scene"),
        (_drop_keyframes, "0 keyframes"),
    ],
)
def test_a_spoilt_file_gets_one_clear_line(file: Path, spoil: Any, message: str) -> None:
    plan = json.loads(file.read_text())
    spoil(plan)
    file.write_text(json.dumps(plan))
    with pytest.raises(InputError, match=message) as caught:
        read_plan(file)
    assert str(file) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_and_truncated_files(file: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        read_plan(file.with_name("none.json"))
    file.write_text(file.read_text()[:500])
    with pytest.raises(InputError, match="is not JSON"):
        read_plan(file)


def test_nested_too_deeply(tmp_path: Path) -> None:
    file = tmp_path / "deep.json"
    file.write_text("[" * 100_000)
    with pytest.raises(InputError, match="nested too deeply"):
        read_plan(file)


def test_a_full_disk_leaves_what_was_there(file: Path, result: PathResult) -> None:
    before = file.read_bytes()
    with full_disk(), pytest.raises(InputError, match="cannot be written: File too large"):
        write_plan(file, SCENE, OBJECTIVE, result, {})
    assert file.read_bytes() == before
    assert [path.name for path in file.parent.iterdir()] == ["plan.json"]
