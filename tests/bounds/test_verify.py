"""Known-bad keyframes and paths are rejected for the right reason; good ones pass."""

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pytest
from motions import (
    CLOSED,
    HAND,
    OPEN,
    PALM_FRONT,
    PR2,
    Motion,
    from_above,
    grasp,
    keyframe,
    place,
    reach,
    scene,
    shifted,
    with_arm,
)

from grasp_poses import grasp_poses
from guided_lgp.bounds.results import Array, Keyframe, Trajectory
from guided_lgp.bounds.verify import verify_keyframe, verify_keyframes, verify_path
from guided_lgp.bounds.verify.phase import STEP, resample
from guided_lgp.domains import load_domain
from guided_lgp.logic import Action, State, parse_skeleton
from guided_lgp.poses import apply, compose, inverse, multiply, pose
from guided_lgp.scene import Scene
from guided_lgp.scene.world import World

HOME = PR2.home
GRASP_RED = Action.parse("(grasp pr2L red)")
GRASP_AND_PLACE = parse_skeleton("(grasp pr2L red) (place pr2L red tab1)")
RIGHT_FROM_ABOVE = np.array([0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)])
HOLDS_RED = load_domain().state({"green": "tab2"}, {"red": "pr2L"})


@pytest.fixture(scope="module")
def two_boxes() -> Scene:
    return scene(red=(0.52, 0.30, 0.65, 0.2, "tab1"), green=(0.52, -0.30, 0.65, -0.2, "tab2"))


@pytest.fixture
def world(two_boxes: Scene) -> Iterator[World]:
    with World(two_boxes) as world:
        yield world


@pytest.fixture(scope="module")
def at_red(two_boxes: Scene) -> Array:
    """The left gripper at the red box."""
    return with_arm(HOME, "pr2L", reach(two_boxes, "pr2L", from_above(two_boxes.boxes[0], "pr2L")))


def constraints(world: World, frame: Keyframe, state: State, action: Action | None = None) -> str:
    return "; ".join(v.constraint for v in verify_keyframe(world, frame, state, action))


# Keyframes


def test_arms_at_their_side_are_good(world: World) -> None:
    assert verify_keyframe(world, keyframe(world, HOME), world.scene.state) == []


def test_gripper_at_the_box_is_good(world: World, at_red: Array) -> None:
    assert constraints(world, keyframe(world, at_red), world.scene.state, GRASP_RED) == ""


def test_held_box_lifted_is_good(world: World, two_boxes: Scene) -> None:
    tool = from_above(two_boxes.boxes[0], "pr2L")
    q = with_arm(HOME, "pr2L", reach(two_boxes, "pr2L", shifted(tool, z=0.1)))
    box = shifted(pose(two_boxes.boxes[0].position, 0.2), z=0.1)
    assert constraints(world, keyframe(world, q, red=box), HOLDS_RED) == ""


def test_joint_beyond_its_limit(world: World) -> None:
    q = HOME.copy()
    q[3] = 0.1
    assert (
        constraints(world, keyframe(world, q), world.scene.state)
        == "joint limit l_elbow_flex_joint"
    )


@pytest.mark.parametrize("where", ["joint", "box"])
def test_not_a_number(world: World, where: str) -> None:
    frame = keyframe(world, HOME)
    bad = Keyframe(HOME * np.nan, frame.boxes)
    if where == "box":
        bad = keyframe(world, HOME, red=np.full(7, np.nan))
    assert verify_keyframe(world, bad, world.scene.state)


def test_link_through_a_table(world: World, two_boxes: Scene) -> None:
    tool = shifted(from_above(two_boxes.boxes[0], "pr2L"), y=0.14, z=-0.15)
    q = with_arm(HOME, "pr2L", reach(two_boxes, "pr2L", tool))
    reasons = constraints(world, keyframe(world, q), world.scene.state).split("; ")
    assert all(r.startswith("clear l_gripper") and r.endswith(" tab1") for r in reasons)


def test_box_through_a_box(world: World) -> None:
    frame = keyframe(world, HOME, green=pose((0.55, 0.33, 0.65), 0.2))
    state = load_domain().state({"red": "tab1", "green": "tab1"})
    assert constraints(world, frame, state) == "beside green red"


def test_carried_box_through_the_other_arm(world: World, two_boxes: Scene) -> None:
    tool = from_above(two_boxes.boxes[0], "pr2L")
    grip = compose(inverse(tool), pose((0.52, 0.3, 0.65), 0.2))
    inwards = shifted(tool, y=-0.20, z=0.15)
    q = with_arm(HOME, "pr2L", reach(two_boxes, "pr2L", inwards))
    q = with_arm(q, "pr2R", reach(two_boxes, "pr2R", into_the_end_of(inwards)))
    reasons = constraints(world, keyframe(world, q, red=compose(inwards, grip)), HOLDS_RED)
    assert any(r.startswith("clear r_") and r.endswith(" red") for r in reasons.split("; "))


def into_the_end_of(tool: Array) -> Array:
    """A pose of the right hand from above, its fingers in the far end of what the left holds."""
    return np.concatenate([shifted(tool, 0.085, -0.04, -0.08)[:3], RIGHT_FROM_ABOVE])


@pytest.mark.parametrize(
    ("top", "reason"),
    [
        (pose((0.52, 0.30, 0.75), 0.2), ""),
        (pose((0.52, 0.30, 0.75), 1.2), ""),
        (pose((0.52, 0.30, 0.76), 0.2), "stand green red"),
        (pose((0.62, 0.30, 0.75), 0.2), "balanced green red"),
        (
            compose(pose((0.52, 0.30, 0.755), 0.2), np.array([0, 0, 0, 0.04, 0, 0, 0.9992])),
            "stand green red",
        ),
    ],
    ids=["square", "across", "floating", "overhanging", "tilted"],
)
def test_tower_of_two(world: World, top: Array, reason: str) -> None:
    state = load_domain().state({"red": "tab1", "green": "red"})
    assert constraints(world, keyframe(world, HOME, green=top), state) == reason


def test_tilted_tower(world: World) -> None:
    tip = np.array([0.05, 0, 0, 0.99875])
    lean = np.array([0.52, 0.30, 0.65, *multiply(pose((0, 0, 0), 0.2)[3:], tip)])
    top = compose(lean, pose((0, 0, 0.10)))
    state = load_domain().state({"red": "tab1", "green": "red"})
    reasons = constraints(world, keyframe(world, HOME, red=lean, green=top), state)
    assert {"stand red tab1", "stand green red"} <= set(reasons.split("; "))


def test_cumulative_centre_of_mass() -> None:
    """Every box is over the next one, but the two upper ones together are not over the third."""
    leaning = scene(
        red=(0.50, 0.30, 0.65, 0.0, "tab1"),
        green=(0.55, 0.30, 0.75, 0.0, "red"),
        blue=(0.61, 0.30, 0.85, 0.0, "green"),
    )
    with World(leaning) as world:
        assert constraints(world, keyframe(world, HOME), leaning.state) == "balanced green red"


def test_box_half_over_the_edge_of_its_table(world: World) -> None:
    frame = keyframe(world, HOME, red=pose((0.52, 0.54, 0.65)))
    assert constraints(world, frame, world.scene.state) == "balanced red tab1"


@pytest.mark.parametrize(
    "offset",
    [(0, 0, 0.06), (0.08, 0, 0), (0, 0.02, 0)],
    ids=["too high", "beside its end", "off the middle"],
)
def test_gripper_not_at_the_box(
    world: World, two_boxes: Scene, offset: tuple[float, float, float]
) -> None:
    tool = from_above(two_boxes.boxes[0], "pr2L")
    tool[:3] += compose(pose((0, 0, 0), 0.2), pose(offset))[:3]
    q = with_arm(HOME, "pr2L", reach(two_boxes, "pr2L", tool))
    reasons = constraints(world, keyframe(world, q), world.scene.state, GRASP_RED)
    assert {"hold pr2L red", "pads pr2L red"} & set(reasons.split("; "))


def test_fingers_across_the_long_side(world: World, two_boxes: Scene) -> None:
    tool = compose(
        from_above(two_boxes.boxes[0], "pr2L"),
        np.array([0, 0, 0, np.sin(np.pi / 4), 0, 0, np.cos(np.pi / 4)]),
    )
    q = with_arm(HOME, "pr2L", reach(two_boxes, "pr2L", tool))
    reasons = constraints(world, keyframe(world, q), world.scene.state, GRASP_RED)
    assert {"hold pr2L red", "pads pr2L red"} & set(reasons.split("; "))


def test_verdict_does_not_depend_on_what_was_checked_before(world: World, at_red: Array) -> None:
    rng = np.random.default_rng(0)
    frames = [
        keyframe(world, rng.uniform(*PR2.position_limits.T), red=pose(rng.uniform(0.4, 0.7, 3)))
        for _ in range(20)
    ]
    forward = [verify_keyframe(world, frame, world.scene.state) for frame in frames]
    backward = [verify_keyframe(world, frame, world.scene.state) for frame in frames[::-1]]
    assert forward == backward[::-1]


# Sequences of keyframes


@pytest.fixture(scope="module")
def frames(two_boxes: Scene, at_red: Array) -> tuple[list[Keyframe], list[Keyframe]]:
    """Contacts and retreats of grasping the red box and placing it 10 cm further left."""
    boxes = {b.name: pose(b.position, b.yaw) for b in two_boxes.boxes}
    tool = two_boxes.robot.tool_pose(at_red, "pr2L")
    grip = compose(inverse(tool), boxes["red"])
    carried = boxes | {"red": compose(two_boxes.robot.tool_pose(HOME, "pr2L"), grip)}
    moved = boxes | {"red": shifted(boxes["red"], y=0.1)}
    placing = reach(two_boxes, "pr2L", shifted(tool, y=0.1))
    at_switch = [Keyframe(at_red, boxes), Keyframe(with_arm(HOME, "pr2L", placing), moved)]
    return at_switch, [Keyframe(HOME, carried), Keyframe(HOME, moved)]


def test_good_keyframes(world: World, frames: tuple[list[Keyframe], list[Keyframe]]) -> None:
    assert verify_keyframes(world, GRASP_AND_PLACE, *frames) is None


def test_box_that_slips_in_the_hand(
    world: World, frames: tuple[list[Keyframe], list[Keyframe]]
) -> None:
    at_switch, (carried, moved) = frames
    slipped = carried.boxes | {"red": compose(carried.boxes["red"], pose((0.004, 0, 0)))}
    found = verify_keyframes(world, GRASP_AND_PLACE, at_switch, [Keyframe(HOME, slipped), moved])
    assert found is not None
    assert (found.constraint, found.action) == ("carried red pr2L", 0)


def test_keyframes_verified_before_are_only_where_the_others_start(
    world: World, frames: tuple[list[Keyframe], list[Keyframe]]
) -> None:
    at_switch, (carried, moved) = frames
    nowhere = Keyframe(HOME + 10, at_switch[0].boxes)
    assert verify_keyframes(world, GRASP_AND_PLACE, at_switch, [carried, moved], 1) is None
    assert verify_keyframes(world, GRASP_AND_PLACE, [nowhere, at_switch[1]], [carried, moved]) != (
        verify_keyframes(world, GRASP_AND_PLACE, [nowhere, at_switch[1]], [carried, moved], 1)
    )
    slipped = carried.boxes | {"red": compose(carried.boxes["red"], pose((0.004, 0, 0)))}
    before = [Keyframe(HOME, slipped), moved]
    found = verify_keyframes(world, GRASP_AND_PLACE, at_switch, before, 1)
    assert found is not None
    assert (found.constraint, found.action) == ("carried red pr2L", 1)


def test_box_that_moves_by_itself(
    world: World, frames: tuple[list[Keyframe], list[Keyframe]]
) -> None:
    at_switch, (carried, moved) = frames
    crept = moved.boxes | {"green": shifted(moved.boxes["green"], y=0.01)}
    found = verify_keyframes(world, GRASP_AND_PLACE, at_switch, [carried, Keyframe(HOME, crept)])
    assert found is not None
    assert (found.constraint, found.action) == ("carried green tab2", 1)


# Paths


@pytest.fixture(scope="module")
def good(two_boxes: Scene) -> Trajectory:
    motion = Motion(two_boxes)
    grip = grasp(motion, "pr2L", "red")
    place(motion, "pr2L", "red", grip, pose((0.50, 0.42, 0.65), 0.1))
    return motion.trajectory()


def test_good_path(world: World, good: Trajectory) -> None:
    report = verify_path(world, GRASP_AND_PLACE, good)
    assert report.violation is None
    assert report.configurations > 100
    assert report.deepest_penetration <= 0.005


def test_no_point_goes_farther_than_a_step_between_two_checks(
    two_boxes: Scene, good: Trajectory
) -> None:
    rng = np.random.default_rng(4)
    low, high = np.r_[PR2.position_limits, np.tile((HAND.lower, HAND.upper), (8, 1))].T
    corners = np.clip(rng.uniform(low, high, (12, 22)), -3.0, 3.0)
    times = np.arange(12.0)
    fine = np.linspace(0.0, 11.0, 600)
    anywhere = np.stack([np.interp(fine, times, column) for column in corners.T], axis=1)
    sides = rng.normal(size=(2, 60, 3))
    reach = {"pr2L": 0.12, "pr2R": 0.2}
    for q in (good.q, anywhere):
        samples, _ = resample(two_boxes, q, np.arange(float(len(q))), reach)
        levers = 0.0
        farthest = np.zeros(len(samples) - 1)
        for gripper, beyond, rays in zip(PR2.arms, reach.values(), sides, strict=True):
            ball = beyond * rays / np.linalg.norm(rays, axis=1, keepdims=True)
            tools = two_boxes.robot.tool_poses(samples[:, :14])[gripper]
            points = [apply(tools[:, None], ball)]
            arm = PR2.arms[gripper].links
            for link, ahead in ((arm[3], 0.4), (arm[6], 0.3)):  # upper arm and forearm
                body = np.vstack([np.zeros(3), [ahead, 0, 0], [ahead / 2, 0.08, 0.0]])
                points.append(apply(two_boxes.robot.link_poses(samples[:, :14], [link]), body))
            moved = np.linalg.norm(np.diff(np.concatenate(points, axis=1), axis=0), axis=-1)
            farthest = np.maximum(farthest, moved.max(axis=1))
            turns = np.abs(np.diff(q[:, PR2.arms[gripper].slice], axis=0)).sum(axis=0)
            levers = max(levers, float(turns @ (PR2.arms[gripper].lever_arms + beyond)))
        assert farthest.max() <= 1.01 * STEP
        assert len(samples) < 0.75 * levers / STEP


def jump(path: Trajectory) -> Trajectory:
    q = path.q.copy()
    q[100:, 7] += 0.6
    return replace(path, q=q)


def hurry(path: Trajectory) -> Trajectory:
    return replace(path, times=path.times / 5)


def jerk(path: Trajectory) -> Trajectory:
    q = path.q.copy()
    q[20, 13] += 0.05
    return replace(path, q=q)


def start_elsewhere(path: Trajectory) -> Trajectory:
    q = path.q.copy()
    q[:, 7] += 0.1
    return replace(path, q=q)


def bend(path: Trajectory) -> Trajectory:
    q = path.q.copy()
    q[:, 5] += 0.3
    return replace(path, q=q)


def fingers_wide(path: Trajectory) -> Trajectory:
    q = path.q.copy()
    q[:, 14:18] = OPEN
    return replace(path, q=q)


def fingers_askew(path: Trajectory) -> Trajectory:
    q = path.q.copy()
    q[:, 15] -= 0.1
    return replace(path, q=q)


def attach_early(path: Trajectory) -> Trajectory:
    attachment = path.attachments[0]
    return replace(path, attachments=(replace(attachment, start=30),))


def let_go_in_the_air(path: Trajectory) -> Trajectory:
    attachment = path.attachments[0]
    return replace(path, attachments=(replace(attachment, end=attachment.start + 30),))


def other_gripper(path: Trajectory) -> Trajectory:
    return replace(path, attachments=(replace(path.attachments[0], gripper="pr2R"),))


def never_attached(path: Trajectory) -> Trajectory:
    return replace(path, attachments=())


def still_held(path: Trajectory) -> Trajectory:
    extra = replace(path.attachments[0], box="green", gripper="pr2R")
    return replace(path, attachments=(*path.attachments, extra))


def backwards(path: Trajectory) -> Trajectory:
    return replace(path, times=path.times[::-1])


def without_fingers(path: Trajectory) -> Trajectory:
    return replace(path, joint_names=path.joint_names[:14], q=path.q[:, :14])


def never_ends(path: Trajectory) -> Trajectory:
    return replace(path, times=np.r_[path.times[:-1], np.inf])


def a_joint_twice(path: Trajectory) -> Trajectory:
    names = (*path.joint_names, path.joint_names[0])
    return replace(path, joint_names=names, q=np.c_[path.q, path.q[:, 0]])


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (jump, "jump r_shoulder_pan_joint"),
        (hurry, "velocity l_"),
        (jerk, "acceleration r_wrist_roll_joint"),
        (start_elsewhere, "start"),
        (fingers_wide, "fingers pr2L"),
        (fingers_askew, "fingers pr2L"),
        (attach_early, "fingers pr2L"),
        (let_go_in_the_air, "stand red tab1"),
        (other_gripper, "attachments"),
        (never_attached, "attachments"),
        (still_held, "attachments"),
        (backwards, "samples"),
        (never_ends, "samples"),
        (without_fingers, "joint names"),
        (a_joint_twice, "joint names"),
    ],
)
def test_spoilt_path(
    world: World, good: Trajectory, change: Callable[[Trajectory], Trajectory], reason: str
) -> None:
    violation = verify_path(world, GRASP_AND_PLACE, change(good)).violation
    assert violation is not None
    assert violation.constraint.startswith(reason)


@pytest.mark.parametrize(
    ("skeleton", "action"),
    [
        ("(place pr2L red tab1)", 0),
        ("(grasp pr2L pink) (place pr2L pink tab1)", 0),
        ("(grasp pr2L red) (place pr2L red shelf)", 1),
        ("(grasp pr2L red) (grasp pr2L green)", 1),
    ],
)
def test_skeleton_that_cannot_be(
    world: World, good: Trajectory, skeleton: str, action: int
) -> None:
    violation = verify_path(world, parse_skeleton(skeleton), good).violation
    assert violation is not None
    assert (violation.constraint, violation.action) == ("skeleton", action)


def test_jump_is_found_where_it_is(world: World, good: Trajectory) -> None:
    violation = verify_path(world, GRASP_AND_PLACE, jump(good)).violation
    assert violation is not None
    assert violation.time == pytest.approx(good.times[99])
    assert violation.action == sum(good.times[s] < good.times[99] for s in switches(good))


def switches(path: Trajectory) -> list[int]:
    return [index for a in path.attachments for index in (a.start, a.end)]


def test_link_sweeps_through_a_table(world: World, two_boxes: Scene, good: Trajectory) -> None:
    """The arm goes down beside the table's edge and would have to pass through it."""
    low = shifted(from_above(two_boxes.boxes[0], "pr2L"), y=0.14, z=-0.15)
    motion = Motion(two_boxes).move("pr2L", reach(two_boxes, "pr2L", shifted(low, z=0.25)))
    motion.move("pr2L", reach(two_boxes, "pr2L", low)).move("pr2L", PR2.arms["pr2L"].home)
    violation = verify_path(world, (), motion.trajectory()).violation
    assert violation is not None
    assert violation.constraint.startswith("clear l_gripper")
    assert violation.constraint.endswith(" tab1")


def test_thin_passage_between_two_samples_is_seen(world: World, two_boxes: Scene) -> None:
    """Two samples, both free, on either side of a box: what lies between is checked."""
    tool = shifted(from_above(two_boxes.boxes[0], "pr2L"), z=0.02)
    left, right = (shifted(tool, y=dy) for dy in (0.17, -0.17))
    motion = Motion(two_boxes)
    near = reach(two_boxes, "pr2L", shifted(left, z=0.15))
    motion.move("pr2L", near).move("pr2L", reach(two_boxes, "pr2L", left, near))
    first = motion.q
    motion.q = with_arm(first, "pr2L", reach(two_boxes, "pr2L", right, first[:7]))
    motion.rows.append(np.r_[motion.q, motion.rows[-1][14:]])
    violation = verify_path(world, (), motion.trajectory(period=4.0)).violation
    assert violation is not None
    assert "clear" in violation.constraint
    assert violation.constraint.endswith(" red")


def test_carried_box_through_a_standing_one() -> None:
    crowded = scene(red=(0.48, 0.30, 0.65, 0.0, "tab1"), green=(0.65, 0.30, 0.65, 0.0, "tab1"))
    motion = Motion(crowded)
    grasp(motion, "pr2L", "red")
    tool = shifted(from_above(crowded.boxes[0], "pr2L"), z=0.05)
    at = reach(crowded, "pr2L", tool, motion.q[:7])
    motion.move("pr2L", at).move("pr2L", reach(crowded, "pr2L", shifted(tool, x=0.15), at))
    with World(crowded) as world:
        skeleton = parse_skeleton("(grasp pr2L red)")
        violation = verify_path(world, skeleton, motion.trajectory()).violation
    assert violation is not None
    assert violation.constraint == "beside green red"


def test_carried_box_through_the_other_arm_on_the_way(world: World, two_boxes: Scene) -> None:
    motion = Motion(two_boxes)
    grasp(motion, "pr2L", "red")
    inwards = shifted(from_above(two_boxes.boxes[0], "pr2L"), y=-0.20, z=0.15)
    motion.move("pr2L", reach(two_boxes, "pr2L", inwards, motion.q[:7]))
    target = into_the_end_of(inwards)
    beside = reach(two_boxes, "pr2R", shifted(target, y=-0.15))
    motion.move("pr2R", beside).move("pr2R", reach(two_boxes, "pr2R", target, beside))
    path = motion.trajectory()
    violation = verify_path(world, parse_skeleton("(grasp pr2L red)"), path).violation
    assert violation is not None
    assert violation.constraint.startswith("clear r_gripper")
    assert violation.constraint.endswith(" red")


def test_grasp_from_afar(world: World, two_boxes: Scene) -> None:
    tool = shifted(from_above(two_boxes.boxes[0], "pr2L"), z=0.10)
    motion = Motion(two_boxes).move("pr2L", reach(two_boxes, "pr2L", tool))
    motion.hand("pr2L", CLOSED).attach("red", "pr2L").move("pr2L", PR2.arms["pr2L"].home)
    skeleton = parse_skeleton("(grasp pr2L red)")
    violation = verify_path(world, skeleton, motion.trajectory()).violation
    assert violation is not None
    assert violation.constraint == "pads pr2L red"


def test_stack_tipped_while_it_is_carried() -> None:
    """The hand grasps the lower box of two from its end and goes home, which tips it."""
    stacked = scene(red=(0.55, 0.35, 0.65, 0.0, "tab1"), green=(0.55, 0.35, 0.75, 1.57, "red"))
    box = stacked.boxes[0]
    tool = next(
        t for t in grasp_poses(box, PALM_FRONT) if compose(t, pose((1, 0, 0)))[2] - t[2] > -0.01
    )
    at = reach(stacked, "pr2L", tool)
    back = compose(tool, pose((-0.10, 0, 0)))
    away = reach(stacked, "pr2L", back, at)
    above = reach(stacked, "pr2L", shifted(back, z=0.20), away)
    lifted = reach(stacked, "pr2L", shifted(tool, z=0.15), at)
    motion = (
        Motion(stacked).move("pr2L", above).move("pr2L", away).move("pr2L", at).hand("pr2L", CLOSED)
    )
    motion.attach("red", "pr2L").attach("green", "pr2L")
    motion.move("pr2L", lifted).move("pr2L", PR2.arms["pr2L"].home)
    with World(stacked) as world:
        skeleton = parse_skeleton("(grasp pr2L red)")
        violation = verify_path(world, skeleton, motion.trajectory()).violation
    assert violation is not None
    assert violation.constraint == "level red"
