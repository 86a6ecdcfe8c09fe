"""Plans in which all arms move: shorter, verified as one motion, and within every limit."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from motions import reach

from guided_lgp import plan
from guided_lgp.bounds.checks import box_sizes
from guided_lgp.bounds.collision import PADDING
from guided_lgp.bounds.coordination import Coordinator, coordinate
from guided_lgp.bounds.coordination.itinerary import Itinerary, Stop, itinerary
from guided_lgp.bounds.coordination.law import TICK, jerk_limited, ramp
from guided_lgp.bounds.coordination.moments import Moments
from guided_lgp.bounds.coordination.roads import Edge, Road
from guided_lgp.bounds.coordination.schedule import schedule
from guided_lgp.bounds.coordination.timetable import Timetable
from guided_lgp.bounds.coordination.turns import best_turns
from guided_lgp.bounds.deadline import NEVER
from guided_lgp.bounds.execution import execute
from guided_lgp.bounds.path.motions import Mover
from guided_lgp.bounds.path.situation import situation_at_start
from guided_lgp.bounds.results import PathResult, Trajectory
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.bounds.verify import PathReport, Violation, verify_path
from guided_lgp.bounds.verify.attachments import switches_of
from guided_lgp.bounds.verify.joints import rows_outside_limits
from guided_lgp.clearance import CLEARANCE, clearance_of
from guided_lgp.explanation import users_bounds
from guided_lgp.logic import format_skeleton, parse_skeleton
from guided_lgp.params import load_planning
from guided_lgp.poses import pose
from guided_lgp.robots import PlacedArm, load_robot
from guided_lgp.scene import Scene, load_scene
from guided_lgp.scene.generate import generate
from guided_lgp.scene.world import world_of

PR2 = load_robot("pr2")
EXAMPLE = Path(__file__).parents[2] / "examples" / "three_boxes.json"
APART = "(grasp pr2L red) (place pr2L red tab1) (grasp pr2R green) (place pr2R green tab2)"
LOADED = "(grasp pr2L green) (place pr2L green red) (grasp pr2L red) (place pr2L red tab2)"
BROUGHT = (
    "(grasp pr2L green) (place pr2L green red) (grasp pr2L red) (place pr2L red tab2) "
    "(grasp pr2L blue) (grasp pr2R green)"
)
ROOMY = "(grasp pr2R green) (grasp pr2L blue) (place pr2L blue tab2) (place pr2R green tab1)"
NARROW = (
    "(grasp pr2L green) (place pr2L green red) (grasp pr2L red) (place pr2L red tab2) "
    "(grasp pr2R red) (grasp pr2L green)"
)
IN_THE_MIDDLE = pose((0.6, 0.0, 0.9))
ON_HELD = "(grasp pr2R green) (grasp pr2L red) (place pr2L red green)"


def sequential(actions: str) -> tuple[Scene, PathResult]:
    scene = load_scene(EXAMPLE)
    return scene, SceneBounds(scene, load_planning().bounds).path(parse_skeleton(actions))


@pytest.fixture(scope="module")
def apart() -> tuple[Scene, PathResult]:
    """Two arms that have nothing to do with each other."""
    return sequential(APART)


@pytest.fixture(scope="module")
def together(apart: tuple[Scene, PathResult]) -> PathResult:
    scene, result = apart
    return Coordinator(scene).shorten(result)


def motion(result: PathResult) -> Trajectory:
    assert result.trajectory is not None
    return result.trajectory


def outside(scene: Scene, result: PathResult) -> dict[str, int]:
    trajectory = motion(result)
    switches = switches_of(scene, result.skeleton, trajectory)
    assert isinstance(switches, list)
    q = trajectory.joints(PR2.moving_joints)
    return rows_outside_limits(scene, result.skeleton, switches, q, trajectory.times)


def plan_of(scene: Scene, result: PathResult, in_order: bool = False) -> Itinerary:
    base, fixed = scene.robot.base_pose, scene.robot.fixed_values
    arms = {gripper: PlacedArm(PR2, gripper, base, fixed) for gripper in PR2.grippers}
    start = situation_at_start(scene)
    return itinerary(start, result.skeleton, result.steps, arms, in_order)


def test_both_arms_need_half_the_time(
    apart: tuple[Scene, PathResult], together: PathResult
) -> None:
    assert motion(together).times[-1] < 0.6 * motion(apart[1]).times[-1]
    assert sorted(map(str, together.skeleton)) == sorted(map(str, apart[1].skeleton))
    assert len(together.at_switch) == len(together.skeleton)


def test_no_row_is_outside_any_limit(apart: tuple[Scene, PathResult], together: PathResult) -> None:
    found = outside(apart[0], together)
    assert "jerk" in found
    assert set(found.values()) == {0}


def test_arms_move_at_once(together: PathResult) -> None:
    moving = [
        np.any(np.diff(motion(together).q[:, arm.slice], axis=0), axis=1)
        for arm in PR2.arms.values()
    ]
    assert np.mean(moving[0] & moving[1]) > 0.5


def test_the_hand_rests_while_its_fingers_are_near_the_body(
    apart: tuple[Scene, PathResult], together: PathResult
) -> None:
    q, sizes = motion(together).q, box_sizes(apart[0])
    for attachment in motion(together).attachments:
        arm = PR2.arms[attachment.gripper]
        values = q[:, arm.fingers.slice][:, 0]
        opening = np.array([arm.fingers.opening(value) for value in values])
        width = opening[attachment.start]
        assert width == pytest.approx(sizes[attachment.box][1], abs=0.003)
        clear = np.flatnonzero(opening > width + 0.008)
        closing = clear[clear < attachment.start][-1]
        opened = clear[clear > attachment.end][0]
        assert not np.ptp(q[closing : attachment.start + 1, arm.slice], axis=0).any()
        assert not np.ptp(q[attachment.end : opened + 1, arm.slice], axis=0).any()
        assert np.ptp(q[closing - 2 : closing + 1, arm.slice], axis=0).any()
        assert np.ptp(q[opened : opened + 3, arm.slice], axis=0).any()


def test_the_hand_comes_with_fingers_that_are_open() -> None:
    """They open from the start on; not yet wide, one of them would push the box by 17 mm."""
    (scene,) = generate("a", 1, 30_006, "execution-006").scenes
    bounds = users_bounds(scene, load_planning().bounds, NEVER, (), coordinate=True)
    skeleton = parse_skeleton("(grasp pr2R red) (place pr2R red green)")
    report = execute(scene, (), skeleton, motion(bounds.path(skeleton)))
    assert report.success, report.fault
    assert report.drift < 0.002


def coordinated(
    setup: str, number: int, actions: str, clearance: float = CLEARANCE
) -> tuple[Scene, PathResult]:
    (scene,) = generate(setup, 1, 30_000 + number, f"execution-{number:03d}").scenes
    params = load_planning().bounds
    bounds = users_bounds(scene, params, NEVER, (), coordinate=True, clearance=clearance)
    return scene, bounds.path(parse_skeleton(actions))


@pytest.mark.parametrize(
    ("number", "actions"),
    [
        (42, "(grasp pr2L blue) (place pr2L blue tab2) (grasp pr2R blue) (grasp pr2L green)"),
        (6, "(grasp pr2R red) (place pr2R red green) (grasp pr2R blue) (place pr2R blue tab2)"),
        (16, BROUGHT),
        (48, "(grasp pr2L green) (grasp pr2R red) (place pr2L green tab2) (place pr2R red tab1)"),
    ],
    ids=[
        "through what the other hand takes",
        "with fingers that are not yet open",
        "while another hand still brings it",
        "as another hand passes with it, between rows",
    ],
)
def test_a_hand_does_not_pass_through_the_body_of_a_contact(number: int, actions: str) -> None:
    """It has to be looked at beyond the straight ways: what verification refuses has no motion."""
    scene, result = coordinated("a", number, actions)
    trajectory = motion(result)
    assert not np.any(np.diff(trajectory.times) - TICK > 1e-9)  # all arms at once
    assert clearance_of(scene, result.skeleton, trajectory).distance > 0.001


def test_arms_that_pass_each_other_between_rows_have_met(apart: tuple[Scene, PathResult]) -> None:
    scene, result = apart
    plan, mover = plan_of(scene, result), Mover(scene, 150)
    roads = {gripper: Road(mover, gripper, stops, True) for gripper, stops in plan.stops.items()}
    moments = Moments(scene, roads, plan)
    found = schedule(roads, moments)
    assert found is not None
    rows = Timetable(scene, roads, plan, found).rows
    assert moments.met(found, rows) == (PADDING, None)
    both = next(row for row, at in enumerate(found) if all(isinstance(on, Edge) for on, _ in at))
    for gripper, arm in PR2.arms.items():
        middle = reach(scene, gripper, IN_THE_MIDDLE, arm.home)
        for row, aside in ((both - 1, -0.1), (both, 0.1)):
            rows[row, arm.slice] = middle + aside * np.eye(len(middle))[0]
    distance, met = moments.met(found, rows)
    assert distance < 0
    assert met is found[both]


@pytest.mark.parametrize(("distance", "accepted"), [(0.0015, True), (0.0005, False)])
def test_arms_pass_each_other_no_nearer_than_a_millimetre(
    apart: tuple[Scene, PathResult],
    monkeypatch: pytest.MonkeyPatch,
    distance: float,
    accepted: bool,
) -> None:
    """If nothing better is found, one moves at a time."""
    scene, result = apart
    monkeypatch.setattr(Moments, "met", lambda _, found, rows: (distance, found[len(found) // 2]))
    assert (Coordinator(scene).shorten(result) is not result) == accepted


@pytest.mark.parametrize(
    ("number", "actions", "least"),
    [(9, ROOMY, 0.009), (1, NARROW, 0.001)],
    ids=["where there is room", "where there is none"],
)
def test_plans_keep_the_wished_distance_where_there_is_room(
    number: int, actions: str, least: float
) -> None:
    near, far = (
        clearance_of(scene, result.skeleton, motion(result)).distance
        for scene, result in (coordinated("a", number, actions, wish) for wish in (PADDING, 0.01))
    )
    assert near < 0.009
    assert far > max(near, least) - 1e-4


def test_the_same_plan_twice(apart: tuple[Scene, PathResult], together: PathResult) -> None:
    again = Coordinator(apart[0]).shorten(apart[1])
    assert again.skeleton == together.skeleton
    assert np.array_equal(motion(again).q, motion(together).q)


def test_a_given_order_is_kept(apart: tuple[Scene, PathResult]) -> None:
    scene, result = apart
    kept = Coordinator(scene, in_order=True).shorten(result)
    assert format_skeleton(kept.skeleton) == APART
    assert motion(kept).times[-1] < motion(result).times[-1]


def test_a_hand_waits_for_what_happens_on_what_it_holds() -> None:
    scene, result = sequential(ON_HELD)
    stops = plan_of(scene, result).stops
    (number, placing), *_ = [
        (i, stop) for i, stop in enumerate(stops["pr2L"]) if stop.acts and stop.contact == 2
    ]
    assert set(placing.way_in_after) == {"pr2R"}
    waiting = stops["pr2R"][placing.way_in_after["pr2R"]]
    assert waiting.leave_after == {"pr2L": number + 1}
    assert placing.after["pr2R"] == 1
    shorter = Coordinator(scene).shorten(result)
    assert motion(shorter).times[-1] < motion(result).times[-1]
    assert verify_path(world_of(scene), shorter.skeleton, motion(shorter)).violation is None


def test_actions_apart_may_change_places(apart: tuple[Scene, PathResult]) -> None:
    plan = plan_of(*apart)
    assert not any(stop.after for stops in plan.stops.values() for stop in stops)
    ordered = plan_of(*apart, in_order=True)
    assert [stop.after for stop in ordered.stops["pr2R"] if stop.acts] == 2 * [{"pr2L": 2}]


def test_what_cannot_be_shortened_stays(apart: tuple[Scene, PathResult]) -> None:
    scene, result = apart
    nothing = replace(result, skeleton=())
    assert Coordinator(scene).shorten(nothing) is nothing


def test_no_other_manner_is_tried_where_a_contact_is_refused(
    apart: tuple[Scene, PathResult],
) -> None:
    scene, result = apart
    reports = iter([PathReport(Violation("balanced red green", 0.01, 1, 2.0))])

    def once(*_: object) -> PathReport:
        return next(reports)

    assert Coordinator(scene, verify=once).shorten(result) is result


@pytest.mark.parametrize("slower", [1.0, 3.0])
def test_the_time_law_keeps_velocity_acceleration_and_jerk(slower: float) -> None:
    arm = PR2.arms["pr2L"]
    path = np.linspace(arm.home, arm.home + 0.4, 30)
    path[:, 1] += 0.1 * np.sin(np.linspace(0, np.pi, 30))
    rows = jerk_limited(path, arm, slower)
    assert np.array_equal(rows[[0, -1]], path[[0, -1]])
    rates = np.diff(np.pad(rows, ((3, 3), (0, 0)), mode="edge"), axis=0) / TICK
    for order, limit in enumerate(
        (arm.velocity_limits, arm.acceleration_limits, arm.jerk_limits), start=0
    ):
        assert np.all(np.abs(np.diff(rates, order, axis=0)) / TICK**order <= limit)
    assert len(rows) > len(jerk_limited(path, arm)) - 1


def test_joints_come_by_the_turns_that_cost_least_in_all() -> None:
    robot = load_scene(EXAMPLE).robot
    arm = PlacedArm(PR2, "pr2L", robot.base_pose, robot.fixed_values)
    wrist, home = 6, arm.arm.home
    stops = [
        Stop((), None, None, home + turned * np.eye(7)[wrist], fingers=0.0, slower=1.0)
        for turned in (0.0, 2.0, 5.0, 0.0)
    ]
    free = best_turns(arm, stops, kept=())
    assert [turns[wrist] for turns in free] == pytest.approx([0.0, 0.0, -2 * np.pi, 0.0])
    assert not np.delete(free, wrist, axis=1).any()
    assert not np.any(best_turns(arm, stops, kept=(1, 2)))


def test_fingers_start_and_stop_gently() -> None:
    fingers = PR2.arms["pr2L"].fingers
    values = ramp(fingers, 0.1, 0.3)
    steps = np.diff(values) / TICK
    assert (values[0], values[-1]) == (0.1, 0.3)
    assert np.all(steps <= fingers.velocity)
    assert steps[0] < 0.75 * steps.max()
    assert ramp(fingers, 0.2, 0.2).tolist() == [0.2]


@pytest.mark.parametrize("actions", [APART, ON_HELD, LOADED])
def test_a_plan_in_turns_keeps_every_limit(actions: str) -> None:
    scene = load_scene(EXAMPLE)
    bounds = users_bounds(scene, load_planning().bounds, NEVER, ())
    assert set(outside(scene, bounds.path(parse_skeleton(actions))).values()) == {0}
    assert outside(*sequential(actions))["jerk"] > 0


def test_a_plan_without_a_motion_of_all_arms_keeps_every_limit(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(coordinate, "MANNERS", ())
    scene = load_scene(EXAMPLE)
    bounds = users_bounds(scene, load_planning().bounds, NEVER, (), coordinate=True)
    result = bounds.path(parse_skeleton(APART))
    assert len(result.skeleton) == 4
    assert set(outside(scene, result).values()) == {0}


def test_an_arm_that_a_goal_wants_elsewhere_keeps_every_limit() -> None:
    scene = load_scene(EXAMPLE)
    joints = PR2.arms["pr2R"].home + 0.3 * np.array([1.0, 0.0, 1.0, -1.0, 1.0, 0.0, 1.0])
    result = plan(scene, f"(posture pr2R {' '.join(map(str, joints))})").path
    assert result is not None
    assert np.ptp(motion(result).q, axis=0).max() > 0.2
    assert set(outside(scene, result).values()) == {0}
