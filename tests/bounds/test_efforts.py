"""Efforts of the arms' motors, and rows outside the limits."""

from dataclasses import replace

import numpy as np
import pinocchio
import pytest
from motions import PR2, Motion, grasp, scene

from guided_lgp.bounds.checks import volumes
from guided_lgp.bounds.results import Array, Attachment, Trajectory
from guided_lgp.bounds.verify import efforts, verify_path
from guided_lgp.bounds.verify.attachments import switches_of
from guided_lgp.bounds.verify.efforts import (
    Carried,
    Load,
    carried_boxes,
    derivatives,
    joint_efforts,
    overloads,
)
from guided_lgp.bounds.verify.joints import rows_outside_limits
from guided_lgp.logic import parse_skeleton
from guided_lgp.poses import compose
from guided_lgp.scene import PlacedRobot, Scene
from guided_lgp.scene.world import BOX_DENSITY, World

SKELETON = parse_skeleton("(grasp pr2L red)")


@pytest.fixture(scope="module")
def start() -> Scene:
    return scene(red=(0.52, 0.30, 0.65, 0.2, "tab1"))


@pytest.fixture(scope="module")
def lifting(start: Scene) -> Trajectory:
    motion = Motion(start)
    grasp(motion, "pr2L", "red")
    return motion.trajectory(0.05)


def _switches(scene: Scene, trajectory: Trajectory) -> list[int]:
    switches = switches_of(scene, SKELETON, trajectory)
    assert isinstance(switches, list)
    return switches


def test_efforts_are_those_of_pinocchio_with_the_box_in_the_hand(
    start: Scene, lifting: Trajectory
) -> None:
    """The box as a body of pinocchio's model; what the springs carry is the bare arm's weight."""
    q = lifting.q
    (load,) = carried_boxes(start, SKELETON, _switches(start, lifting), q)
    found = joint_efforts(start, q[:, :14], lifting.times, [load])
    kinematics, arm = PR2.kinematics, PR2.arms["pr2L"]
    bare, loaded = kinematics.model, pinocchio.Model(kinematics.model)
    tool = loaded.frames[loaded.getFrameId(arm.tool_link)]
    centre = tool.placement.act(compose(arm.tool_in_link, load.grip)[:3])
    mass = BOX_DENSITY * volumes(start)["red"]
    point = pinocchio.Inertia(mass, np.zeros(3), np.zeros((3, 3)))
    loaded.appendBodyToJoint(tool.parentJoint, point, pinocchio.SE3(np.eye(3), centre))
    rates, changes = derivatives(q[:, :14], lifting.times)
    row = load.span.start + 20
    full = kinematics.rows(q[row : row + 1, :14], start.robot.fixed_values)[0]
    columns = [joint.velocity for joint in kinematics.joints]
    velocity, acceleration = np.zeros((2, bare.nv))
    velocity[columns], acceleration[columns] = rates[row - 1], changes[row - 1]
    expected = pinocchio.rnea(loaded, loaded.createData(), full, velocity, acceleration)
    expected -= pinocchio.computeGeneralizedGravity(bare, bare.createData(), full)
    assert np.abs(expected[columns]).max() > 1.0
    np.testing.assert_allclose(found[row - 1], expected[columns], atol=0.02)


def test_what_a_motor_cannot_hold_at_rest_is_named(start: Scene) -> None:
    """Baxter's stretched arm with a box in its hand, against a motion in which nothing moves."""
    baxter = start.model_copy(update={"robot": PlacedRobot(model="baxter"), "boxes": start.boxes})
    robot, q = baxter.robot.description, np.zeros(14)
    grip = np.array([0.02, 0.01, 0.0, 0.0, 0.0, 0.0, 1.0])
    still = Carried(Attachment("red", "left", 0, 2), grip)
    torques = joint_efforts(baxter, np.tile(q, (3, 1)), np.array([0.0, 0.1, 0.2]), [still])[0]
    excess = np.abs(torques) / robot.effort_limits - 1
    rows, loads = np.stack([robot.home, q]), [Load("left", "red", grip[:3])]
    assert not overloads(baxter, rows[:1], loads)
    found = overloads(baxter, rows, loads)
    assert [fault.constraint for fault in found] == ["effort left_s1", "effort right_s1"]
    left, right = (fault.amount for fault in found)
    assert left == pytest.approx(excess[1])
    assert left > right == pytest.approx(excess[8])
    assert not overloads(start, PR2.home[None], [])


def _fault(scene: Scene, trajectory: Trajectory) -> str:
    with World(scene) as world:
        report = verify_path(world, SKELETON, trajectory)
    return "" if report.violation is None else report.violation.constraint


def test_a_load_that_a_motor_cannot_carry_is_refused_by_name(
    start: Scene, lifting: Trajectory, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert not _fault(start, lifting)
    monkeypatch.setattr(efforts, "BOX_DENSITY", 20_000.0)  # kg/m³: as heavy as gold
    assert _fault(start, lifting).startswith("effort l_")


def test_a_plan_at_double_speed_is_refused_by_name(start: Scene, lifting: Trajectory) -> None:
    fast = _fastest(start, lifting)
    assert not _fault(start, fast)
    kind, joint = _fault(start, replace(fast, times=0.5 * fast.times)).split()
    assert kind in ("velocity", "acceleration")
    assert joint in PR2.joint_names


def _fastest(scene: Scene, trajectory: Trajectory) -> Trajectory:
    """The same motion, as fast as the limits allow."""
    motion = (scene, SKELETON, _switches(scene, trajectory), trajectory.q)
    for factor in np.arange(0.05, 1.0, 0.05):
        outside = rows_outside_limits(*motion, factor * trajectory.times)
        if not sum(outside[kind] for kind in ("velocity", "acceleration", "effort")):
            return replace(trajectory, times=factor * trajectory.times)
    raise AssertionError("the motion is too fast")


def test_rows_outside_limits_are_counted_by_kind(start: Scene, lifting: Trajectory) -> None:
    motion = start, SKELETON, _switches(start, lifting)
    slow = rows_outside_limits(*motion, lifting.q, 4 * lifting.times)
    assert slow == dict.fromkeys(("joint limit", "velocity", "acceleration", "jerk", "effort"), 0)
    kicked: Array = lifting.q.copy()
    kicked[90, 3] += 0.006  # rad, within 50 ms, while the arm rests
    outside = rows_outside_limits(*motion, kicked, lifting.times)
    assert outside == dict.fromkeys(outside, 0) | {"jerk": outside["jerk"]}
    assert outside["jerk"] > 0
