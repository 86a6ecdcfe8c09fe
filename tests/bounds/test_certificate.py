"""Configurations that are certified as free, against coal with its padding and against PyBullet."""

import numpy as np
import pytest
from motions import SIZE, scene

from guided_lgp.bounds.coarse import CoarseBound
from guided_lgp.bounds.collision import CollisionChecker, PlanningScene
from guided_lgp.bounds.collision import certificate as module
from guided_lgp.bounds.path import PathBound
from guided_lgp.bounds.results import Array
from guided_lgp.logic import parse_skeleton
from guided_lgp.poses import pose
from guided_lgp.robots import load_robot
from guided_lgp.scene import Box, PlacedRobot, Scene, Table
from guided_lgp.scene.world import World, initial_poses

SCENE = scene(
    red=(0.5, 0.3, 0.65, 0.4, "tab1"),
    green=(0.5, -0.3, 0.65, 0.0, "tab2"),
    blue=(0.6, 0.45, 0.65, -0.6, "tab1"),
)
ROBOT = SCENE.robot.description
HELD = pose((0.04, 0.0, 0.0))


@pytest.fixture(scope="module")
def checker() -> CollisionChecker:
    return CollisionChecker(SCENE)


@pytest.fixture(scope="module")
def recorded() -> Array:
    """Rows (m, joints) along the motion of a plan, and a little beside it."""
    coarse = CoarseBound(SCENE, 12)
    start = coarse.solve(
        parse_skeleton("(grasp pr2L red) (grasp pr2R green) (place pr2L red tab1)")
    )
    trajectory = PathBound(SCENE, coarse, 8).solve(start).trajectory
    assert trajectory is not None
    rows = trajectory.q[np.random.default_rng(1).integers(len(trajectory.q), size=4000)]
    rows[2000:, :14] += np.random.default_rng(2).normal(scale=0.05, size=(2000, 14))
    return rows


def random_rows(count: int) -> Array:
    """Rows (count, joints) anywhere within the limits of the arms, fingers closed to open."""
    rng = np.random.default_rng(3)
    low, high = ROBOT.position_limits.T
    arms = rng.uniform(low, high, (count, len(low)))
    hands = [rng.uniform(0, arm.fingers.opened, (count, 1)) for arm in ROBOT.arms.values()]
    ratios = [arm.fingers.ratios for arm in ROBOT.arms.values()]
    fingers = [hand * ratio for hand, ratio in zip(hands, ratios, strict=True)]
    return np.hstack([arms, *fingers])


def blocked(checker: CollisionChecker, row: Array) -> bool:
    """Whether coal finds a collision with its padding."""
    q = row[None, : len(ROBOT.joint_names)]
    return checker.first_collision(q, ROBOT.finger_values(row)) is not None


def planning_scenes() -> list[PlanningScene]:
    standing = initial_poses(SCENE)
    rest = {name: where for name, where in standing.items() if name != "red"}
    touching = frozenset({frozenset({"pr2L", "red"})})
    return [
        PlanningScene("pr2L", standing, also=frozenset({"pr2R"})),
        PlanningScene("pr2L", rest, {"red": ("pr2L", HELD)}, touching, frozenset({"pr2R"})),
    ]


def test_nothing_is_certified_that_coal_with_its_padding_blocks(
    checker: CollisionChecker, recorded: Array
) -> None:
    certified = free = 0
    rows = np.concatenate([recorded, random_rows(2000)])
    assert len(rows) * len(planning_scenes()) >= 10_000
    for planning in planning_scenes():
        checker.enter(planning)
        sure = checker.certified(rows)
        judged = np.array([not blocked(checker, row) for row in rows])
        assert not np.any(sure & ~judged)
        certified += int(sure.sum())
        free += int(judged.sum())
    assert certified >= 0.85 * free  # or the certificate saves little


def test_pybullet_finds_nothing_where_it_is_certified(
    checker: CollisionChecker, recorded: Array
) -> None:
    checker.enter(planning_scenes()[0])
    rows = np.concatenate([recorded[::5], random_rows(1200)])
    sure = rows[checker.certified(rows)]
    assert len(sure) > 200
    with World(SCENE) as world:
        for row in sure:
            world.set(row[: len(ROBOT.joint_names)], {}, ROBOT.finger_values(row))
            assert not world.penetrations(0.0)


@pytest.mark.parametrize("model", ["panda", "ur5", "baxter"])
def test_any_robot(model: str) -> None:
    robot = load_robot(model)
    table = Table(name="tab1", position=(0.5, 0.0, 0.2), half_extents=(0.2, 0.2))
    box = Box(name="red", size=SIZE, position=(0.5, 0.0, 0.25), yaw=0.0, on="tab1")
    placed = Scene(tables=(table,), boxes=(box,), robot=PlacedRobot(model=model))
    checker = CollisionChecker(placed)
    gripper, *others = robot.grippers
    checker.enter(PlanningScene(gripper, initial_poses(placed), also=frozenset(others)))
    low, high = robot.position_limits.T
    q = np.random.default_rng(4).uniform(low, high, (600, len(low)))
    moving = checker.moving_joints(q, {})
    sure = checker.certified(moving)
    assert sure.any()
    assert all(checker.first_collision(row[None], {}) is None for row in q[sure])
    assert checker.free(moving)[sure].all()


def test_without_a_compiler_coal_decides_everything(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_library", lambda lanes: None)
    checker = CollisionChecker(SCENE)
    checker.enter(planning_scenes()[0])
    assert not checker.certified(random_rows(5)).any()
    assert checker.first_collision(np.tile(ROBOT.home, (20, 1)), {}) is None
