"""Every term's kernel against its check, which shares no code with it, on random configurations."""

from functools import partial

import numpy as np
import pytest

from guided_lgp.bounds.checks import GRAVITY, Top
from guided_lgp.bounds.coarse.solver import default_solver
from guided_lgp.bounds.program.geometry import GraspSide
from guided_lgp.bounds.program.grasp import PALM_GAP, tool_targets
from guided_lgp.bounds.program.inverse import start_ik
from guided_lgp.bounds.program.kernels import SCALE
from guided_lgp.bounds.program.kinematics import kinematics_of
from guided_lgp.bounds.program.slots import HeldBox
from guided_lgp.bounds.results import Array
from guided_lgp.bounds.terms import (
    at,
    balanced,
    carried,
    hold,
    kernel_table,
    pads,
    stand,
    steady,
    within,
)
from guided_lgp.poses import compose, pose, quaternion
from guided_lgp.scene import Box, PlacedRobot, Scene, Table
from guided_lgp.scene.footprints import footprint, gap
from guided_lgp.scene.shapes import Convex
from guided_lgp.scene.tolerances import BALANCE_INSET
from guided_lgp.scene.world import BOX_DENSITY, World

PLACED = PlacedRobot(base=(0.0, 0.0, 0.0))
ROBOT = PLACED.description
FIXED = tuple(PLACED.fixed_values.values())
TABLE = kernel_table(kinematics_of(ROBOT))
SQRT = np.sqrt(0.5)
SIZE = (0.15, 0.07, 0.10)
HALF_LENGTH, HALF_HEIGHT = 0.075, 0.05


def residual(kernel: str, x: Array, p: Array) -> Array:
    """Rows of a kernel, in m or rad."""
    found = TABLE[TABLE.number[kernel]]
    rows = np.array(found.residual(x, p)).ravel()
    return np.concatenate([rows[: found.lengths] / SCALE, rows[found.lengths :]])


def both_verdicts(verdicts: list[bool]) -> None:
    """Neither is rare."""
    assert 0.1 < np.mean(verdicts) < 0.9


def held(gripper: str = "pr2L") -> HeldBox:
    return HeldBox(
        gripper,
        "red",
        0,
        1,
        2,
        GraspSide(0.0, HALF_LENGTH, SIZE[1], (HALF_LENGTH, HALF_HEIGHT)),
        HALF_HEIGHT,
        0.0,
    )


@pytest.mark.parametrize("gripper", ROBOT.grippers)
def test_hold(gripper: str) -> None:
    rng, verdicts = np.random.default_rng(0), []
    arm = kinematics_of(ROBOT).arms[gripper]
    widest = arm.arm.fingers.grasp_width
    ik = start_ik(kinematics_of(ROBOT), FIXED, default_solver(ROBOT))[gripper]
    for _ in range(80):
        place = np.array([0.55, 0.2 * arm.side, rng.uniform(-1.5, 1.5), rng.uniform(0.5, 0.8)])
        pitch, offset = rng.uniform(0.4, 2.7), rng.uniform(-0.04, 0.04)
        depth = rng.uniform(PALM_GAP, 0.04)
        (q,) = ik.hold(
            held(gripper),
            (offset, depth),
            place[None],
            np.array([pitch]),
            np.zeros((1, 2)),
            np.zeros,
        )
        q[rng.integers(7)] += rng.choice([0.0, 0.2])
        grasp = (HALF_LENGTH, HALF_HEIGHT, 0.0, 0.0)
        x = np.array([*q, pitch, offset, depth, *place])
        rows = residual("hold_0", x, np.array([arm.side, *FIXED, 0.0, 0.0, *grasp]))
        whole = ROBOT.home.copy()
        whole[arm.arm.slice] = arm.arm.signs * q
        tool = PLACED.tool_pose(whole, gripper).tolist()
        box = pose((place[0], place[1], place[3]), place[2]).tolist()
        excess = hold.check(SIZE, box, tool, arm.chain.palm_front, widest)
        if np.abs(rows).max() < 1e-4:
            assert excess < 0
        if excess < 0:
            assert np.abs(rows[3:6]).max() < 0.05  # any pitch is a grasp to the check
        verdicts.append(excess < 0)
    both_verdicts(verdicts)


def test_pads() -> None:
    rng, verdicts = np.random.default_rng(1), []
    palm_front = ROBOT.arms["pr2L"].palm_front
    for _ in range(200):
        pitch, offset = rng.uniform(0.0, np.pi), rng.uniform(-0.09, 0.09)
        depth = rng.uniform(PALM_GAP, 0.04)
        sides = np.array(2 * [HALF_LENGTH, HALF_HEIGHT])
        rows = residual("pads_0", np.array([pitch, offset, depth]), sides)
        hand, pitches = (offset, depth), np.array([pitch])
        rotation, position = tool_targets(
            held(), hand, np.zeros((1, 4)), pitches, np.zeros((1, 2)), palm_front
        )
        tool = [*position[0, 0, 0], *quaternion(rotation[0, 0, 0])]
        excess = pads.check(
            Convex("box", (HALF_LENGTH, SIZE[1] / 2, HALF_HEIGHT)),
            pose((0.0, 0.0, 0.0)).tolist(),
            tool,
        )
        assert excess == pytest.approx(-rows.min() - pads.TOLERANCE, abs=1e-5)
        verdicts.append(excess < 0)
    both_verdicts(verdicts)


def test_pads_of_a_cylinder_are_at_its_axis() -> None:
    """From above, a hand beside the axis would have its fingers where the cylinder is narrower."""
    can, tool = (
        Convex("cylinder", (0.033, 0.033, 0.05)),
        np.array([0.0, 0.0, 0.04, 0, SQRT, 0, SQRT]),
    )
    excess = [pads.check(can, pose((x, 0, 0)).tolist(), tool.tolist()) for x in (0.0, 0.005, 0.02)]
    assert excess[0] < 0
    assert excess[1] < 0
    assert excess[2] > 0.01


def test_steady() -> None:
    """With a box and two others on it, where no pad reaches over an edge."""
    rng, verdicts = np.random.default_rng(2), []
    fingers, palm_front = ROBOT.arms["pr2L"].fingers, ROBOT.arms["pr2L"].palm_front
    body, volumes = Convex("box", (HALF_LENGTH, SIZE[1] / 2, HALF_HEIGHT)), (1e-3, 8e-4, 1.2e-3)
    weight = BOX_DENSITY * sum(volumes) * GRAVITY
    bound = 2 * steady.FRICTION * fingers.force * fingers.pad / weight
    shares = [volume / sum(volumes) for volume in volumes[1:]] + 6 * [0.0]
    least = weight / (2 * steady.FRICTION * fingers.force)
    for _ in range(200):
        grip = np.array([rng.uniform(0.0, np.pi), rng.uniform(-0.04, 0.04), 0.04])
        place = np.array([*rng.uniform(-1, 1, 2), rng.uniform(-np.pi, np.pi)])
        points = place[:2] + rng.uniform(-0.3, 0.3, (2, 2))
        x = np.concatenate([grip, place, points.ravel(), np.zeros(12)])
        rows = residual("steady_0", x, np.array([HALF_LENGTH, HALF_HEIGHT, 0.0, bound, *shares]))
        there, pitches = np.array([[*place, 0.7]]), grip[:1]
        rotation, position = tool_targets(
            held(), (grip[1], grip[2]), there, pitches, np.zeros((1, 2)), palm_front
        )
        tool = [*position[0, 0, 0], *quaternion(rotation[0, 0, 0])]
        placement = pose((*place[:2], 0.7), place[2]).tolist()
        if pads.check(body, placement, tool) < -0.008:
            centres = [(*place[:2], 0.7), *((*point, 0.8) for point in points)]
            loads = list(zip(volumes, centres, strict=True))
            share = steady.check(body, placement, tool, fingers, loads)
            assert share == pytest.approx(max(least, 1 - rows.min() / bound), abs=1e-4)
            verdicts.append(rows.min() > 0)
    both_verdicts(verdicts)


def test_pads_over_an_edge_carry_less() -> None:
    body = Convex("box", (HALF_LENGTH, SIZE[1] / 2, HALF_HEIGHT))
    shares = [steady.on_box(body, (x, 0.0, 0.0), 1, 0.0106) for x in (0.0, 0.06, 0.075, 0.09)]
    assert shares == pytest.approx([1.0, 1.0, 0.5, 0.1])


@pytest.mark.parametrize("name", balanced.SUMS)
def test_balanced(name: str) -> None:
    rng, verdicts = np.random.default_rng(2), []
    sizes = {"red": SIZE, "green": (0.1, 0.06, 0.05), "blue": (0.05, 0.2, 0.2)}
    masses = np.array([np.prod(size) for size in sizes.values()])
    half = np.array([0.08, 0.12])
    for _ in range(100):
        support = np.array([*rng.uniform(-0.5, 0.5, 2), rng.uniform(-3, 3)])
        points = support[:2] + rng.uniform(-0.12, 0.12, (3, 2))
        unused = balanced.SUMS[name] - len(sizes)
        x = np.array([*support, *points.ravel(), *np.zeros(2 * unused)])
        shares = [*(masses / masses.sum()), *np.zeros(unused)]
        rows = residual(name, x, np.array([*(half - BALANCE_INSET), *shares]))
        boxes = {n: pose((*p, 0.7)).tolist() for n, p in zip(sizes, points, strict=True)}
        on = {"red": "tab", "green": "red", "blue": "red"}
        top = Top(pose((*support[:2], 0.6), support[2]).tolist(), half, 0.6)
        excess = balanced.check("red", boxes, dict(zip(sizes, masses, strict=True)), on, top)
        assert excess == pytest.approx(-rows.min(), abs=1e-9)
        verdicts.append(excess < 0)
    both_verdicts(verdicts)


@pytest.mark.parametrize(("middle", "inset"), [(0.1, 0.005), (0.25, 0.005), (0.5, 0.01)])
def test_a_high_stack_keeps_farther_from_the_edge(middle: float, inset: float) -> None:
    """As far as its middle goes to the side where it leans by 0.02; found there, it may stay."""
    top = Top(pose((0.0, 0.0, 0.6)).tolist(), (0.1, 0.2), 0.6)
    boxes = {"red": pose((0.1, 0.0, 0.6 + middle)).tolist()}
    stack = partial(balanced.check, "red", boxes, {"red": 1.0}, {"red": "tab"}, top)
    assert stack() == pytest.approx(inset)
    assert stack(placed=False) == pytest.approx(0.0)


def test_carried() -> None:
    rng, verdicts = np.random.default_rng(3), []
    for _ in range(100):
        below, above, moved = rng.uniform(-1, 1, (3, 3))
        turn = moved[2] - below[2]
        cosine, sine = np.cos(turn), np.sin(turn)
        x, y = above[:2] - below[:2]
        after = np.array(
            [moved[0] + cosine * x - sine * y, moved[1] + sine * x + cosine * y, above[2] + turn]
        )
        after += rng.choice([0.0, 0.02]) * rng.normal(size=3)
        rows = residual("carried", np.concatenate([below, above, moved, after]), np.zeros(0))
        frames = [pose((*p[:2], 0.0), p[2]).tolist() for p in (below, above, moved, after)]
        excess = carried.check(
            carried.relative(frames[1], frames[0]), carried.relative(frames[3], frames[2])
        )
        allowed = max(
            np.hypot(*rows[:2]) - carried.RIGID_POSITION, abs(rows[2]) - carried.RIGID_ANGLE
        )
        assert excess == pytest.approx(allowed, abs=1e-6)
        verdicts.append(excess < 0)
    both_verdicts(verdicts)


def test_stand() -> None:
    rng, verdicts = np.random.default_rng(4), []
    top = Top(pose((0.0, 0.0, 0.6), 0.3).tolist(), (0.2, 0.2), 0.6)
    for _ in range(100):
        raised, tilted = rng.choice([0.0, 0.02]), rng.choice([0.0, 0.1])
        level = pose((0.1, 0.0, 0.6 + HALF_HEIGHT + raised), rng.uniform(-3, 3))
        lean = np.array([0.0, 0.0, 0.0, np.sin(tilted / 2), 0.0, 0.0, np.cos(tilted / 2)])
        excess = stand.check(SIZE, compose(level, lean).tolist(), top)
        assert (excess < 0) == (raised == tilted == 0.0)
        verdicts.append(excess < 0)
    both_verdicts(verdicts)


def test_beside() -> None:
    """The best of all separating lines is the distance of the footprints where they overlap."""
    rng, verdicts = np.random.default_rng(5), []
    angles = np.linspace(0.0, 2 * np.pi, 721)
    halves = (0.075, 0.035, 0.06, 0.05)
    kernel = TABLE[TABLE.number["beside"]].residual.map(len(angles))
    for _ in range(60):
        first, second = (np.array([*rng.uniform(-0.1, 0.1, 2), rng.uniform(-3, 3)]) for _ in "12")
        x = np.column_stack([np.tile([*first, *second], (len(angles), 1)), angles])
        best = float(np.max(np.array(kernel(x.T, np.array([*halves, 0.0])))) / SCALE)
        boxes = [
            Box(name="b", size=(2 * hx, 2 * hy, 0.1), position=(*p[:2], 0.0), yaw=p[2], on="t")
            for p, (hx, hy) in ((first, halves[:2]), (second, halves[2:]))
        ]
        distance = gap(*map(footprint, boxes))
        if abs(distance) > 1e-3:
            assert (best > 0) == (distance > 0)
        verdicts.append(distance > 0)
    both_verdicts(verdicts)


@pytest.mark.parametrize("opening", [0.09, 0.04])
def test_clear_and_apart(opening: float) -> None:
    """A few spheres stand for the hulls: they agree as a rule, as they only guide the solver."""
    rng = np.random.default_rng(6)
    verdicts: dict[str, list[tuple[bool, bool]]] = {"clear_0": [], "apart_0_0": []}
    box = Box(name="red", size=(0.4, 0.4, 0.4), position=(0.6, 0.1, 0.9), on="tab")
    table = Table(name="tab", position=(0.6, 0.1, 0.7), half_extents=(0.2, 0.2))
    left, right = kinematics_of(ROBOT).arms.values()
    hand = left.arm.fingers
    closed = (hand.widest - opening) / 2
    fingers = dict.fromkeys(ROBOT.grippers, hand.value(opening))
    mine = {*left.arm.links, *left.arm.hand_links}
    others = {*right.arm.links, *right.arm.hand_links}
    with World(Scene(tables=(table,), boxes=(box,))) as world:
        for _ in range(300):
            one, two = (rng.uniform(*np.array(arm.limits).T) for arm in (left, right))
            q = np.concatenate([one, right.arm.signs * two])
            world.set(q, {"red": pose(box.position)}, fingers)
            x = np.array([*one, *box.position[:2], 0.0, box.position[2]])
            clear = residual("clear_0", x, np.array([1.0, *FIXED, closed, 0.0, 0.2, 0.2, 0.2, 0.0]))
            both = np.concatenate([one, two])
            apart = residual("apart_0_0", both, np.array([1.0, -1.0, closed, closed, 0.0, *FIXED]))
            touching = [overlap.bodies for overlap in world.penetrations()]
            for kernel, rows, other in (("clear_0", clear, {"red"}), ("apart_0_0", apart, others)):
                touch = any(bodies & mine and bodies & other for bodies in touching)
                verdicts[kernel].append((rows.min() < 0, touch))
    for kernel, seen in (("clear_0", 0.9), ("apart_0_0", 0.5)):  # between arms the spheres are few
        spheres, hulls = np.array(verdicts[kernel]).T
        assert np.mean(spheres[hulls]) > seen
        assert np.mean(spheres[~hulls]) < 0.05
        assert 0.1 < np.mean(hulls) < 0.9


def test_at() -> None:
    rng, verdicts = np.random.default_rng(5), []
    goal = {"x": 0.5, "y": 0.2, "z": 0.65, "yaw": 3.0}
    for _ in range(200):
        x, y = rng.normal((0.5, 0.2), 0.01)
        yaw = 3.0 + rng.normal(0.0, 0.08) + 2 * np.pi * rng.integers(-1, 2)
        target = np.array([goal["x"], goal["y"], goal["yaw"], 0.02, 0.1])
        rows = residual("at", np.array([x, y, yaw]), target)
        placement = pose((x, y, 0.65), yaw).tolist()
        top = Top(pose((0.54, 0.33, 0.6), 0.0).tolist(), (0.17, 0.2), 0.6)
        excess = at.TERM.check(SIZE, placement, top, **goal, tolerance=0.02, turn=0.1)
        assert (rows.min() >= 0) == (excess <= 0)
        verdicts.append(excess <= 0)
    both_verdicts(verdicts)


def test_within() -> None:
    rng, verdicts = np.random.default_rng(6), []
    region = {"x0": -0.12, "y0": -0.1, "x1": 0.1, "y1": 0.15}
    for _ in range(300):
        support, local = (0.5, 0.1, rng.uniform(-3, 3)), rng.uniform(-0.1, 0.1, 2)
        cosine, sine = np.cos(support[2]), np.sin(support[2])
        x = support[0] + cosine * local[0] - sine * local[1]
        y = support[1] + sine * local[0] + cosine * local[1]
        yaw = support[2] + rng.choice([0.0, np.pi / 2]) + rng.normal(0.0, 0.2)
        values = np.array([*support, x, y, yaw])
        rows = residual("within", values, np.array([*region.values(), *np.array(SIZE[:2]) / 2]))
        top = Top(pose((*support[:2], 0.6), support[2]).tolist(), (0.3, 0.3), 0.6)
        excess = within.TERM.check(SIZE, pose((x, y, 0.65), yaw).tolist(), top, **region)
        if rows.min() > 0:
            assert excess < 0  # the kernel keeps a margin
        if rows.min() < -0.004:
            assert excess > 0
        verdicts.append(excess <= 0)
    both_verdicts(verdicts)
