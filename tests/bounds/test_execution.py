"""Plans carried out under gravity: goals are read from the settled world, nothing is teleported."""

from dataclasses import replace

import numpy as np
import pytest
from motions import CLOSED, PALM_FRONT, PR2, Motion, from_above, grasp, place, reach, scene, shifted

from grasp_poses import grasp_poses
from guided_lgp.bounds.execution import Execution, execute
from guided_lgp.bounds.results import Trajectory
from guided_lgp.bounds.verify import verify_path
from guided_lgp.logic import parse_objective, parse_skeleton
from guided_lgp.poses import compose, pose
from guided_lgp.scene import Scene
from guided_lgp.scene.world import world_of

STACK = parse_skeleton("(grasp pr2L red) (place pr2L red green)")
STACKED = parse_objective(["(on red green)", "(on green tab1)"])
PERIOD = 0.05


@pytest.fixture(scope="module")
def neighbours() -> Scene:
    return scene(red=(0.52, 0.30, 0.65, 0.2, "tab1"), green=(0.50, 0.44, 0.65, 0.1, "tab1"))


@pytest.fixture(scope="module")
def stacking(neighbours: Scene) -> Trajectory:
    motion = Motion(neighbours)
    grip = grasp(motion, "pr2L", "red")
    place(motion, "pr2L", "red", grip, pose((0.50, 0.44, 0.75), 0.1))
    return motion.trajectory(PERIOD)


def test_box_is_stacked(neighbours: Scene, stacking: Trajectory) -> None:
    report = execute(neighbours, STACKED, STACK, stacking)
    assert report.success
    assert report.goals == {"(on red green)": True, "(on green tab1)": True}
    assert report.drift < 0.002


def test_box_is_held(neighbours: Scene) -> None:
    motion = Motion(neighbours)
    grasp(motion, "pr2L", "red")
    motion.move("pr2L", PR2.arms["pr2L"].home)
    objective = parse_objective(["(held red)", "(on green tab1)", "(on red tab1)"])
    report = execute(neighbours, objective, STACK[:1], motion.trajectory(PERIOD))
    assert report.goals == {"(held red)": True, "(on green tab1)": True, "(on red tab1)": False}
    assert not report.success


def test_a_box_let_go_too_high_is_refused_by_name(neighbours: Scene, stacking: Trajectory) -> None:
    """The attachment ends where the box is still high above the table."""
    (attachment,) = stacking.attachments
    early = (replace(attachment, end=attachment.start + 45),)
    report = execute(neighbours, STACKED, STACK, replace(stacking, attachments=early))
    assert not report.success
    assert report.fault == "stand red green"


def test_a_hand_that_knocks_what_it_takes_is_refused_by_name(neighbours: Scene) -> None:
    """Open fingers around the box move aside before they close: they push it by 15 mm."""
    tool = from_above(neighbours.boxes[0], "pr2L")
    at = reach(neighbours, "pr2L", tool)
    above = reach(neighbours, "pr2L", shifted(tool, z=0.10), at)
    aside = reach(neighbours, "pr2L", shifted(tool, y=0.025), at)
    motion = Motion(neighbours).move("pr2L", above).move("pr2L", at).move("pr2L", aside)
    motion.hand("pr2L", CLOSED).attach("red", "pr2L").move("pr2L", above)
    objective = parse_objective(["(held red)"])
    trajectory = motion.trajectory(PERIOD)
    report = execute(neighbours, objective, STACK[:1], trajectory)
    assert not report.success
    assert report.fault == "knock pr2L red"
    violation = verify_path(world_of(neighbours), STACK[:1], trajectory).violation
    assert violation is not None
    assert violation.constraint == "clear l_gripper_r_finger_tip_link red"


def test_a_tower_of_eight_stands() -> None:
    """Turned against each other and not quite above each other, for 5 s."""
    boxes = {
        f"b{i}": (
            0.54 + 0.01 * (i % 2),
            0.30,
            0.65 + 0.1 * i,
            0.1 * i,
            f"b{i - 1}" if i else "tab1",
        )
        for i in range(8)
    }
    tower = scene(**boxes)
    start = Motion(tower).trajectory()
    still = replace(start, times=np.array([0.0, 3.0]), q=np.tile(start.q, (2, 1)))
    objective = parse_objective([f"(on b{i + 1} b{i})" for i in range(7)])
    report = execute(tower, objective, (), still)
    assert report.success
    assert report.drift < 0.001


def test_a_box_that_is_not_where_it_was_left_is_no_success(neighbours: Scene) -> None:
    """All goals hold, but the plan says that it was put down 2 cm farther."""
    with Execution(neighbours) as execution:
        planned = execution.boxes()
        planned["red"] = compose(planned["red"], pose((0.02, 0.0, 0.0)))
        report = execution.report(parse_objective(["(on red tab1)"]), planned)
    assert not report.success
    assert report.fault == "drift red"


def test_gripper_that_is_not_at_the_box_grasps_nothing(neighbours: Scene) -> None:
    above = shifted(from_above(neighbours.boxes[0], "pr2L"), z=0.10)
    motion = Motion(neighbours).move("pr2L", reach(neighbours, "pr2L", above))
    motion.hand("pr2L", CLOSED).attach("red", "pr2L").move("pr2L", PR2.arms["pr2L"].home)
    objective = parse_objective(["(held red)"])
    report = execute(neighbours, objective, STACK[:1], motion.trajectory(PERIOD))
    assert not report.success
    assert report.fault == "pads pr2L red"


def test_box_in_the_way_is_pushed(neighbours: Scene) -> None:
    """Nothing keeps a hand that sweeps over the table from moving what stands there."""
    beside = shifted(from_above(neighbours.boxes[0], "pr2L"), y=-0.14)
    motion = Motion(neighbours).move("pr2L", reach(neighbours, "pr2L", shifted(beside, z=0.15)))
    motion.move("pr2L", reach(neighbours, "pr2L", beside, motion.q[:7]))
    swept = shifted(beside, y=0.12)
    motion.move("pr2L", reach(neighbours, "pr2L", swept, motion.q[:7]))
    report = execute(neighbours, (), (), motion.trajectory(PERIOD))
    assert report.drift > 0.02


def test_plan_that_is_not_of_the_skeleton_is_not_executed(
    neighbours: Scene, stacking: Trajectory
) -> None:
    report = execute(neighbours, STACKED, STACK, replace(stacking, attachments=()))
    assert not report.success
    assert report.fault == "attachments"


@pytest.mark.parametrize(("period", "stays"), [(0.08, True), (0.006, False)])
def test_box_on_a_held_box_rides_by_friction_alone(period: float, stays: bool) -> None:
    """Carried gently it stays where it is, jerked away it falls."""
    stacked = scene(red=(0.47, 0.35, 0.65, 0.0, "tab1"), green=(0.47, 0.35, 0.75, 1.57, "red"))
    box = stacked.boxes[0]
    tool = next(
        t for t in grasp_poses(box, PALM_FRONT) if compose(t, pose((1, 0, 0)))[2] - t[2] > -0.01
    )
    back = compose(tool, pose((-0.10, 0, 0)))
    at = reach(stacked, "pr2L", tool)
    away = reach(stacked, "pr2L", back, at)
    above = reach(stacked, "pr2L", shifted(back, z=0.10), away)
    lifted = reach(stacked, "pr2L", shifted(tool, z=0.10), at)
    aside = reach(stacked, "pr2L", shifted(tool, y=0.20, z=0.10), lifted)
    motion = Motion(stacked).move("pr2L", above).move("pr2L", away).move("pr2L", at)
    motion.hand("pr2L", CLOSED).attach("red", "pr2L").attach("green", "pr2L")
    motion.move("pr2L", lifted)
    slow = motion.trajectory(0.05)
    motion.move("pr2L", aside).move("pr2L", lifted).move("pr2L", aside)
    path = motion.trajectory(period)
    rows = len(slow.times)
    times = np.r_[slow.times, slow.times[-1] + path.times[1 : len(path.times) - rows + 1]]
    objective = parse_objective(["(held red)", "(on green red)"])
    skeleton = parse_skeleton("(grasp pr2L red)")
    report = execute(stacked, objective, skeleton, replace(path, times=times))
    assert report.goals["(on green red)"] is stays
