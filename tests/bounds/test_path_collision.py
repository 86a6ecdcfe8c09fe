import numpy as np
import pytest
from motions import scene

from guided_lgp.bounds.collision import CollisionChecker, PlanningScene
from guided_lgp.poses import compose, inverse, pose
from guided_lgp.scene.world import World, initial_poses

SCENE = scene(
    red=(0.5, 0.3, 0.65, 0.4, "tab1"),
    green=(0.5, -0.3, 0.65, 0.0, "tab2"),
    blue=(0.6, 0.45, 0.65, -0.6, "tab1"),
)
ROBOT = SCENE.robot.description
GRIPPERS = ROBOT.grippers
OPEN = {gripper: arm.fingers.opened for gripper, arm in ROBOT.arms.items()}


@pytest.fixture(scope="module")
def checker() -> CollisionChecker:
    return CollisionChecker(SCENE)


def test_home_is_free(checker: CollisionChecker) -> None:
    checker.enter(PlanningScene("pr2L", initial_poses(SCENE)))
    assert checker.first_collision(ROBOT.home[None], OPEN) is None


@pytest.mark.parametrize("gripper", GRIPPERS)
def test_never_more_optimistic_than_pybullet(checker: CollisionChecker, gripper: str) -> None:
    arm, limits = ROBOT.arms[gripper].slice, ROBOT.arms[gripper].limits
    rng = np.random.default_rng(2)
    checker.enter(PlanningScene(gripper, initial_poses(SCENE)))
    agreed, free = 0, 0
    with World(SCENE) as world:
        for _ in range(300):
            q = ROBOT.home.copy()
            q[arm] = rng.uniform(limits[:, 0], limits[:, 1])
            world.set(q, {}, OPEN)
            ours = checker.first_collision(q[None], OPEN) is None
            judge = not world.penetrations()
            assert judge or not ours
            agreed += ours == judge
            free += judge
    assert 0 < free < 300
    assert agreed >= 0.95 * 300


def test_distances_and_their_gradients(checker: CollisionChecker) -> None:
    rng = np.random.default_rng(3)
    checker.enter(PlanningScene("pr2L", initial_poses(SCENE)))
    low = np.array([0.3, 0.5, 0.9, -1.2, 0.6, -0.9, 0.4])  # above tab1 and its boxes
    for _ in range(10):
        q = ROBOT.home.copy()
        q[:7] = low + rng.uniform(-0.25, 0.25, 7)
        (distances,), (gradients,) = checker.distances(q[None], OPEN, 3)
        assert np.all(np.diff(distances) >= 0)
        assert (distances[0] < 0.003) == (checker.first_collision(q[None], OPEN) is not None)
        steps = 1e-5 * np.eye(14)
        ahead, behind = (checker.distances(q + d, OPEN, 1)[0][:, 0] for d in (steps, -steps))
        assert gradients[0] == pytest.approx((ahead - behind) / 2e-5, abs=0.02)


def test_carried_box_moves_with_the_hand(checker: CollisionChecker) -> None:
    standing = initial_poses(SCENE)
    tool = SCENE.robot.tool_pose(ROBOT.home, "pr2L")
    at_the_other_arm = compose(inverse(tool), SCENE.robot.tool_pose(ROBOT.home, "pr2R"))
    held = pose((0.04, 0.0, 0.0))
    del standing["red"]
    for grasp, hit in ((held, False), (at_the_other_arm, True)):
        touching = frozenset({frozenset({"pr2L", "red"})})
        checker.enter(PlanningScene("pr2L", standing, {"red": ("pr2L", grasp)}, touching))
        pair = checker.first_collision(ROBOT.home[None], OPEN)
        assert (pair is not None and "red" in pair) == hit


def test_boxes_collide_with_boxes_and_tables_unless_declared(checker: CollisionChecker) -> None:
    standing = initial_poses(SCENE)
    tool = SCENE.robot.tool_pose(ROBOT.home, "pr2L")
    for target, where in (("tab1", (0.5, 0.2, 0.64)), ("green", (0.5, -0.3, 0.7))):
        rest = {name: p for name, p in standing.items() if name != "red"}
        carried = {"red": ("pr2L", compose(inverse(tool), pose(where)))}
        checker.enter(PlanningScene("pr2L", rest, carried))
        pair = checker.first_collision(ROBOT.home[None], OPEN)
        assert pair is not None
        assert {target, "red"} == set(pair)
        declared = frozenset({frozenset({target, "red"})})
        checker.enter(PlanningScene("pr2L", rest, carried, declared))
        assert checker.first_collision(ROBOT.home[None], OPEN) is None
