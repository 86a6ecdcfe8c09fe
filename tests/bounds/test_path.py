from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from motions import scene

from guided_lgp.bounds.coarse import CoarseBound
from guided_lgp.bounds.path import PathBound
from guided_lgp.bounds.results import CoarseResult, Keyframe, PathResult
from guided_lgp.bounds.verify import verify_path
from guided_lgp.logic import Goal, Skeleton, parse_skeleton, progress
from guided_lgp.poses import pose, tilt
from guided_lgp.scene.world import World

SCENE = scene(
    red=(0.47, 0.2, 0.65, 0.2, "tab1"),
    green=(0.6, 0.4, 0.65, -0.4, "tab1"),
    blue=(0.5, -0.3, 0.65, 0.1, "tab2"),
)
SKELETONS = {
    "hold": "(grasp pr2L red)",
    "place": "(grasp pr2R blue) (place pr2R blue tab2)",
    "both hands": "(grasp pr2L green) (grasp pr2R blue) (place pr2L green tab1)",
    "tower": "(grasp pr2L green) (place pr2L green red) (grasp pr2R blue) (place pr2R blue green)",
    "carry a stack": "(grasp pr2L green) (place pr2L green red) (grasp pr2L red) "
    "(place pr2L red tab1)",
    "place on a held box": "(grasp pr2L red) (grasp pr2R blue) (place pr2R blue red)",
}


@pytest.fixture(scope="module")
def coarse() -> CoarseBound:
    return CoarseBound(SCENE, 9)


@pytest.fixture(scope="module")
def bound(coarse: CoarseBound) -> PathBound:
    return PathBound(SCENE, coarse, 8)


def _solve(bound: PathBound, coarse: CoarseBound, text: str) -> PathResult:
    start = coarse.solve(parse_skeleton(text))
    assert start.feasible, start.failure
    result = bound.solve(start)
    assert result.feasible, result.failure
    return result


@pytest.mark.parametrize("text", SKELETONS.values(), ids=SKELETONS)
def test_motion_passes_verification(bound: PathBound, coarse: CoarseBound, text: str) -> None:
    result = _solve(bound, coarse, text)
    assert result.trajectory is not None
    assert len(result.at_switch) == len(result.skeleton)
    with World(SCENE) as world:
        report = verify_path(world, result.skeleton, result.trajectory)
    assert report.violation is None
    assert report.configurations > 100


def test_arms_return_home_and_fingers_open_and_close(bound: PathBound, coarse: CoarseBound) -> None:
    trajectory = _solve(bound, coarse, SKELETONS["place"]).trajectory
    assert trajectory is not None
    for row in (trajectory.q[0], trajectory.q[-1]):
        assert row[:14] == pytest.approx(SCENE.robot.description.home)
    (attachment,) = trajectory.attachments
    finger = trajectory.joints(["r_gripper_l_finger_joint"])[:, 0]
    assert finger[: attachment.start].max() > finger[attachment.start]
    assert finger[attachment.end :].max() > finger[attachment.end]
    assert np.ptp(finger[attachment.start : attachment.end + 1]) == 0.0


def test_a_carried_stack_stays_level(bound: PathBound, coarse: CoarseBound) -> None:
    result = _solve(bound, coarse, SKELETONS["carry a stack"])
    trajectory = result.trajectory
    assert trajectory is not None
    stack = [a for a in trajectory.attachments if a.start == trajectory.attachments[-1].start]
    assert {attachment.box for attachment in stack} == {"red", "green"}
    tools = SCENE.robot.tool_poses(trajectory.q[:, :14])["pr2L"]
    rows = slice(stack[0].start, stack[0].end + 1)
    tilts = tilt(tools[rows])
    assert np.ptp(tilts) < 0.02


def test_same_result_whatever_was_asked_before(bound: PathBound, coarse: CoarseBound) -> None:
    text = SKELETONS["tower"]
    later = _solve(bound, coarse, text).trajectory
    fresh = CoarseBound(SCENE, 9)
    first = _solve(PathBound(SCENE, fresh, 8), fresh, text).trajectory
    assert later is not None
    assert first is not None
    assert np.array_equal(later.times, first.times)
    assert np.array_equal(later.q, first.q)
    assert later.attachments == first.attachments


class _Only(CoarseBound):
    """Knows no further coarse solutions."""

    def solutions(self, skeleton: Skeleton, count: int) -> Iterator[CoarseResult]:
        return iter(())


def _moved(
    result: CoarseResult, action: int, box: str, where: tuple[float, float, float]
) -> CoarseResult:
    at_switch = list(result.at_switch)
    boxes = {**at_switch[action].boxes, box: pose(where)}
    at_switch[action] = Keyframe(at_switch[action].q, boxes)
    return replace(result, at_switch=tuple(at_switch))


def test_a_place_in_the_way_is_chosen_anew() -> None:
    coarse = _Only(SCENE, 9)
    start = coarse.solve(parse_skeleton("(grasp pr2L red) (place pr2L red tab1)"))
    on_green = _moved(start, 1, "red", (0.6, 0.4, 0.65))
    result = PathBound(SCENE, coarse, 1).solve(on_green)
    assert result.feasible, result.failure
    placed = result.at_switch[1].boxes["red"]
    assert np.linalg.norm(placed[:2] - [0.6, 0.4]) > 0.07
    final = progress(SCENE.state, result.skeleton)
    assert final.satisfies(Goal("on", ("red", "tab1")))


def test_failure_names_the_action_and_what_was_tried() -> None:
    coarse = _Only(SCENE, 9)
    start = coarse.solve(parse_skeleton("(grasp pr2L red) (grasp pr2R blue) (place pr2R blue red)"))
    far = _moved(start, 2, "red", (3.0, 0.3, 0.9))
    result = PathBound(SCENE, coarse, 1).solve(_moved(far, 2, "blue", (3.0, 0.3, 1.0)))
    assert not result.feasible
    assert result.trajectory is None
    assert result.failure is not None
    assert result.failure.action == 2
    assert "no inverse kinematics" in result.failure.constraint
    assert "1 coarse solution" in str(result.failure)
