from itertools import pairwise

import numpy as np
import pytest
from motions import scene

from guided_lgp.bounds.collision import PlanningScene
from guided_lgp.bounds.path.motions import Motion, Mover, Surroundings, Tool, Transit
from guided_lgp.bounds.path.optimise import LEVEL, optimise
from guided_lgp.bounds.path.situation import Fingers
from guided_lgp.bounds.results import Array
from guided_lgp.poses import pose
from guided_lgp.robots import load_robot
from guided_lgp.scene.world import initial_poses

SCENE = scene(red=(0.47, 0.2, 0.65, 0.2, "tab1"), green=(0.6, 0.4, 0.65, -0.4, "tab1"))
ROBOT = load_robot("pr2")
GRIPPERS = ROBOT.grippers
LEFT = ROBOT.arms["pr2L"]
FINGERS = {gripper: arm.fingers.opened for gripper, arm in ROBOT.arms.items()}
AHEAD = np.array([0.2, 0.3, 0.9, -1.6, 0.4, -1.0, 0.3])
ASIDE = np.array([1.2, -0.2, 1.4, -1.9, 0.9, -1.5, -0.8])


@pytest.fixture(scope="module")
def mover() -> Mover:
    return Mover(SCENE, 150)


def around(gripper: str = "pr2L", **boxes: Array) -> Surroundings:
    return Surroundings(PlanningScene(gripper, initial_poses(SCENE) | boxes), ROBOT.home, FINGERS)


def straight(*corners: Array) -> Array:
    parts = [np.linspace(a, b, 40)[1:] for a, b in pairwise(corners)]
    return np.concatenate([corners[0][None], *parts])


def length(path: Array) -> float:
    return float(np.linalg.norm(np.diff(path, axis=0) / LEFT.velocity_limits, axis=1).sum())


def duration(*motions: Motion) -> float:
    return float(sum(motion.timed[0][-1] for motion in motions))


def free_motion(path: Array, surroundings: Surroundings, level: bool = False) -> Motion:
    return Motion(ROBOT.arms[surroundings.scene.gripper], path, Transit(surroundings, level))


@pytest.mark.parametrize("gripper", GRIPPERS)
def test_detour_becomes_short_and_smooth(mover: Mover, gripper: str) -> None:
    mirror = ROBOT.arms[gripper].signs
    detour = straight(ROBOT.arms[gripper].home, mirror * ASIDE, mirror * AHEAD)
    slow = free_motion(detour, around(gripper))
    (fast,) = optimise(mover, [slow])
    assert isinstance(fast, Motion)
    assert np.array_equal(fast.path[[0, -1]], detour[[0, -1]])
    assert mover.collision(around(gripper), fast.path) is None
    assert length(fast.path) < 1.05 * length(detour[[0, -1]])
    assert duration(fast) < 0.8 * duration(slow)


def test_keeps_clear_of_what_is_in_the_way(mover: Mover) -> None:
    """A box hangs where the hand would pass on the direct way: the detour is only shortened."""
    _, middle = mover.arms["pr2L"].forward((LEFT.home + AHEAD) / 2)
    surroundings = around(green=pose(tuple(middle)))
    assert mover.collision(surroundings, straight(LEFT.home, AHEAD)) is not None
    found = mover.transit(surroundings, LEFT.home, AHEAD, np.random.default_rng(0))
    assert found is not None
    slow = [free_motion(path, surroundings) for path in found]
    (fast,) = optimise(mover, slow)
    assert isinstance(fast, Motion)
    assert mover.collision(surroundings, fast.path) is None
    assert duration(fast) < 0.9 * duration(*slow)


def test_goes_on_into_a_straight_line_without_a_rest(mover: Mover) -> None:
    tool = mover.tool("pr2L", AHEAD)
    path = mover.line(around(), tool, 0.09 * tool.rotation[:, 0])
    assert isinstance(path, np.ndarray), path
    line = Motion(LEFT, path)
    come = free_motion(straight(LEFT.home, AHEAD), around())
    (joined,) = optimise(mover, [come, line])
    assert isinstance(joined, Motion)
    assert joined.transit is None
    assert np.array_equal(joined.path[1 - len(path) :], line.path[1:])
    steps = np.diff(joined.path, axis=0)
    directions = steps / np.linalg.norm(steps, axis=1, keepdims=True)
    assert np.sum(directions[1:] * directions[:-1], axis=1).min() > 0.97  # no corner
    assert duration(joined) < duration(come, line)


def test_lines_with_turns_are_those_of_each_turn_alone(mover: Mover) -> None:
    tool, turns = mover.tool("pr2L", AHEAD), (0.0, 0.25, -0.25, 1.5)
    free = 0
    for direction in (0.09 * tool.rotation[:, 0], np.array([0.0, 0.0, -0.4])):
        found = list(mover.lines(around(), tool, direction, turns))
        for turn, line in zip(turns, found, strict=True):
            (alone,) = mover.lines(around(), tool, direction, (turn,))
            if isinstance(line, np.ndarray):
                free += 1
                assert np.array_equal(line, np.asarray(alone))
                assert line[-1, 0] == pytest.approx(tool.redundancy + turn)
            else:
                assert line == alone
    assert 0 < free < 2 * len(turns)


def test_other_steps_stay_where_they_are(mover: Mover) -> None:
    come = free_motion(straight(LEFT.home, ASIDE), around())
    go = free_motion(straight(ASIDE, LEFT.home), around())
    close = Fingers("pr2L", 0.1)
    first, second, third = optimise(mover, [come, close, go])
    assert second is close
    assert isinstance(first, Motion)
    assert isinstance(third, Motion)
    assert np.array_equal(first.path[-1], ASIDE)
    assert np.array_equal(third.path[0], ASIDE)


def test_level_motion_stays_level(mover: Mover) -> None:
    arm = mover.arms["pr2L"]
    rotation, position = arm.forward(AHEAD)
    ways = position + np.array([[0, 0, 0], [0.0, 0.2, 0.1], [-0.1, 0.1, 0.1]])
    _, valid = arm.inverse(rotation, ways, np.full(3, AHEAD[0]))
    branch = arm.branch(AHEAD)
    assert valid[:, branch].all()
    legs = [
        mover.line(around(), Tool(rotation, a, AHEAD[0], branch), b - a) for a, b in pairwise(ways)
    ]
    slow = [free_motion(np.asarray(leg), around(), level=True) for leg in legs]
    (fast,) = optimise(mover, slow)
    assert isinstance(fast, Motion)
    assert duration(fast) < duration(*slow)
    vertical = arm.forward(fast.path)[0][:, 2]
    assert np.abs(vertical - rotation[2]).max() < LEVEL


def test_stays_as_it_is_where_nothing_is_gained(mover: Mover) -> None:
    direct = free_motion(straight(LEFT.home, ASIDE), around())
    again = optimise(mover, optimise(mover, [direct]))
    (best,) = again
    assert isinstance(best, Motion)
    assert duration(best) <= duration(direct)
    inside = free_motion(direct.path, around(red=pose(tuple(mover.arms["pr2L"].forward(ASIDE)[1]))))
    assert optimise(mover, [inside]) == [inside]
