"""Which earlier action is changed when one cannot be carried out."""

import pytest
from motions import scene

from guided_lgp.bounds.coarse import CoarseBound
from guided_lgp.bounds.goals import NO_TERMS
from guided_lgp.bounds.path.motions import Mover
from guided_lgp.bounds.path.sampler import OutcomeSampler
from guided_lgp.bounds.path.task import Culprits, FurthestFailure, Task
from guided_lgp.logic import parse_skeleton

SCENE = scene(
    red=(0.47, 0.2, 0.65, 0.2, "tab1"),
    green=(0.6, 0.4, 0.65, -0.4, "tab1"),
    blue=(0.5, -0.3, 0.65, 0.1, "tab2"),
)
SKELETON = parse_skeleton(
    "(grasp pr2L red) (place pr2L red tab1) (grasp pr2R blue) (place pr2R blue red) "
    "(grasp pr2L green) (place pr2L green blue)"
)
GRASP_GREEN, PLACE_GREEN = 4, 5


@pytest.fixture(scope="module")
def task() -> Task:
    coarse = CoarseBound(SCENE, 9).solve(SKELETON)
    return Task(
        SCENE, Mover(SCENE, 1), {}, SKELETON, coarse.at_switch, FurthestFailure(), 0, NO_TERMS
    )


@pytest.mark.parametrize(
    ("action", "symbols", "expected"),
    [
        pytest.param(GRASP_GREEN, set(), -1, id="a body that nobody has moved"),
        pytest.param(GRASP_GREEN, {"tab1"}, -1, id="what never moves"),
        pytest.param(GRASP_GREEN, {"red"}, 1, id="a body that was put there"),
        pytest.param(GRASP_GREEN, {"red", "pr2R"}, 3, id="another arm, later"),
        pytest.param(GRASP_GREEN, {"blue"}, 3, id="a body on another"),
        pytest.param(PLACE_GREEN, set(), 4, id="the grip"),
    ],
)
def test_the_last_action_that_decided_on_what_is_in_the_way(
    task: Task, action: int, symbols: set[str], expected: int
) -> None:
    task.culprits = Culprits(symbols)
    assert OutcomeSampler(task).backjump_target(action, task.start, begun=False) == expected


def test_the_last_action_where_no_motion_was_found(task: Task) -> None:
    task.culprits = Culprits(anything=True)
    assert OutcomeSampler(task).backjump_target(GRASP_GREEN, task.start, begun=False) == 3


def test_how_a_body_is_held_where_later_actions_fail(task: Task) -> None:
    task.culprits = Culprits({"red"})
    sampler = OutcomeSampler(task)
    assert sampler.backjump_target(PLACE_GREEN, task.start, begun=True) == 4
    assert sampler.backjump_target(GRASP_GREEN, task.start, begun=True) == 3
