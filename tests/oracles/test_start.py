"""Plans that begin elsewhere than with all arms at their side."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from plan_checker import check

from guided_lgp.bounds.plan_file import write_plan
from guided_lgp.bounds.results import PathResult, Trajectory
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.bounds.verify import verify_path
from guided_lgp.errors import InputError
from guided_lgp.logic import Skeleton, parse_objective, parse_skeleton
from guided_lgp.params import load_params
from guided_lgp.paths import SOURCES
from guided_lgp.scene import Scene, load_scene
from guided_lgp.scene.validate import validate_scene
from guided_lgp.scene.world import World

EXAMPLES = Path(__file__).parents[2] / "examples"
JOINTS = {
    "l_shoulder_pan_joint": 0.4,
    "l_shoulder_lift_joint": 0.3,
    "l_elbow_flex_joint": -1.2,
    "r_shoulder_pan_joint": -0.5,
    "r_elbow_flex_joint": -1.0,
}
SKELETON: Skeleton = parse_skeleton("(grasp pr2L red) (place pr2L red tab2)")


def raised(**joints: float) -> Scene:
    scene = load_scene(EXAMPLES / "three_boxes.json")
    document = scene.model_dump(mode="json")
    return Scene.model_validate(document | {"robot": document["robot"] | {"joints": joints}})


@pytest.fixture(scope="module")
def found() -> PathResult:
    bounds = SceneBounds(raised(**JOINTS), load_params(SOURCES / "params.yaml").bounds)
    result = bounds.path(SKELETON)
    assert result.feasible, result.failure
    return result


def test_the_motion_begins_where_the_scene_says(found: PathResult, tmp_path: Path) -> None:
    scene, trajectory = raised(**JOINTS), found.trajectory
    assert trajectory is not None
    first = dict(zip(trajectory.joint_names, trajectory.q[0], strict=True))
    assert {joint: first[joint] for joint in JOINTS} == pytest.approx(JOINTS)
    write_plan(tmp_path / "plan.json", scene, parse_objective(["(on red tab2)"]), found, {})
    plan: dict[str, Any] = json.loads((tmp_path / "plan.json").read_text())
    assert check(plan) == []
    plan["scene"]["robot"]["joints"]["l_elbow_flex_joint"] = -1.1
    assert {fault.kind for fault in check(plan)} == {"start"}


def test_another_start_is_no_plan(found: PathResult) -> None:
    trajectory = found.trajectory
    assert trajectory is not None
    home = load_scene(EXAMPLES / "three_boxes.json")
    for scene, fault in ((raised(**JOINTS), None), (home, "start")):
        with World(scene) as world:
            violation = verify_path(world, SKELETON, trajectory).violation
        assert (violation and violation.constraint) == fault


def test_verification_asks_for_the_joints_that_are_not_named(found: PathResult) -> None:
    trajectory = found.trajectory
    assert trajectory is not None
    q = trajectory.q.copy()
    q[
        : np.argmax(trajectory.times > 0.2), trajectory.joint_names.index("l_forearm_roll_joint")
    ] += 1
    moved = Trajectory(trajectory.joint_names, trajectory.times, q, trajectory.attachments)
    with World(raised(**JOINTS)) as world:
        assert verify_path(world, SKELETON, moved).violation is not None


@pytest.mark.parametrize(
    ("joints", "fault"),
    [
        ({"l_elbow": -1.0}, r"no arm has a joint 'l_elbow' \(l_elbow_flex_joint, "),
        ({"l_elbow_flex_joint": 0.3}, r"robot\.joints\.l_elbow_flex_joint: 0\.3 is out of range"),
        ({"l_elbow_flex_joint": -90.0}, r"-90\.0 is too large: angles are in rad"),
        (
            {"r_shoulder_pan_joint": 0.3, "l_shoulder_pan_joint": -0.3, "r_elbow_flex_joint": -0.2},
            r"robot\.joints: .* overlap by",
        ),
    ],
)
def test_a_start_that_cannot_be_is_told(joints: dict[str, float], fault: str) -> None:
    with pytest.raises((InputError, ValueError), match=fault):
        validate_scene(raised(**joints))


def test_the_start_is_written_if_there_is_one() -> None:
    assert (
        "joints" not in load_scene(EXAMPLES / "three_boxes.json").model_dump(mode="json")["robot"]
    )
    scene = raised(**JOINTS)
    assert Scene.model_validate(scene.model_dump(mode="json")) == scene
    assert scene.robot.start[0] == JOINTS["l_shoulder_pan_joint"]
