"""A box handed from gripper to gripper: the motion is verified, spoilt ones are refused."""

from dataclasses import replace

import numpy as np
import pytest

from guided_lgp.bounds.results import Trajectory
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.bounds.verify import PathReport, verify_path
from guided_lgp.logic import parse_skeleton
from guided_lgp.params import load_params
from guided_lgp.paths import SOURCES
from guided_lgp.scene import Scene, generate
from guided_lgp.scene.world import world_of

SCENE: Scene = generate("a", 1, 77, "handover").scenes[0].model_copy(update={"domain": "handover"})
SKELETON = parse_skeleton("(grasp pr2L green) (take pr2R pr2L green) (place pr2R green blue)")
ROBOT = SCENE.robot.description


@pytest.fixture(scope="module")
def good() -> Trajectory:
    result = SceneBounds(SCENE, load_params(SOURCES / "params.yaml").bounds).path(SKELETON)
    assert result.trajectory is not None, result.failure
    return result.trajectory


def verified(trajectory: Trajectory) -> PathReport:
    return verify_path(world_of(SCENE), SKELETON, trajectory)


def constraint(trajectory: Trajectory) -> str:
    violation = verified(trajectory).violation
    return "" if violation is None else violation.constraint


def shifted_end(trajectory: Trajectory, rows: int) -> Trajectory:
    """The giver keeps the box for some rows more."""
    given, *others = sorted(trajectory.attachments, key=lambda attachment: attachment.start)
    return replace(trajectory, attachments=(replace(given, end=given.end + rows), *others))


def with_fingers(trajectory: Trajectory, gripper: str, rows: slice, value: float) -> Trajectory:
    """The fingers of a gripper stay at a value for some rows."""
    q = trajectory.q.copy()
    for joint in ROBOT.arms[gripper].fingers.joints:
        q[rows, trajectory.joint_names.index(joint)] = value
    return replace(trajectory, q=q)


def test_the_motion_is_good(good: Trajectory) -> None:
    assert verified(good).violation is None
    given, taken = sorted(good.attachments, key=lambda attachment: attachment.start)
    assert (given.gripper, taken.gripper) == ("pr2L", "pr2R")
    assert given.end == taken.start


@pytest.mark.parametrize("rows", [-3, 3])
def test_a_box_in_no_hand_or_in_two_is_refused(good: Trajectory, rows: int) -> None:
    assert constraint(shifted_end(good, rows)) == "attachments"


def test_a_taker_that_carries_with_open_fingers_is_refused(good: Trajectory) -> None:
    taken = max(good.attachments, key=lambda attachment: attachment.start)
    opened = ROBOT.arms["pr2R"].fingers.opened
    spoilt = with_fingers(good, "pr2R", slice(taken.start, taken.end + 1), opened)
    # slowly enough that the jump of the fingers is not what is told
    assert constraint(replace(spoilt, times=100 * good.times)) == "fingers pr2R"


def test_a_take_in_the_air_is_refused(good: Trajectory) -> None:
    """The taker's arm stays at its side all the time."""
    q = good.q.copy()
    for joint, value in zip(ROBOT.arms["pr2R"].joints, ROBOT.arms["pr2R"].home, strict=True):
        q[:, good.joint_names.index(joint)] = value
    assert constraint(replace(good, q=q)).startswith(("hold pr2R", "grasp"))


def test_a_giver_whose_arm_passes_through_the_taker_is_refused(good: Trajectory) -> None:
    """The giver stays where it gave the box; the taker's hand, which is around it, goes home."""
    given = min(good.attachments, key=lambda attachment: attachment.start)
    q = good.q.copy()
    columns = [good.joint_names.index(joint) for joint in ROBOT.arms["pr2L"].joints]
    q[given.end :, columns] = q[given.end, columns]
    report = verified(replace(good, q=q))
    assert report.violation is not None
    assert np.isfinite(report.violation.time)
