"""The same actions by other hands: which there are, in what order; the fastest is taken."""

import numpy as np
import pytest
from scripted import UNIFORM, ScriptedBounds

from guided_lgp.bounds.results import PathResult, Trajectory
from guided_lgp.hands import faster_at_other_places, faster_by_other_hands, with_other_hands
from guided_lgp.logic import Skeleton, format_skeleton, parse_objective, parse_skeleton
from guided_lgp.params import SearchLimits
from guided_lgp.scene.model import Scene
from guided_lgp.search import best_first
from guided_lgp.search.problem import Problem

OBJECTIVE = parse_objective(["(on red tab2)", "(on green tab2)"])
LEFT = "(grasp pr2L red) (place pr2L red tab2) (grasp pr2L green) (place pr2L green tab2)"
TURNS = "(grasp pr2L red) (place pr2L red tab2) (grasp pr2R green) (place pr2R green tab2)"


class SoonerByTurns(ScriptedBounds):
    """Paths that take as many seconds as the busiest hand has actions."""

    def path(self, skeleton: Skeleton) -> PathResult:
        hands = [action.symbols[0] for action in skeleton]
        busiest = float(max(hands.count(hand) for hand in hands))
        moment = Trajectory((), np.array([0.0, busiest]), np.zeros((2, 0)), ())
        return PathResult(skeleton, feasible=True, trajectory=moment)


def others(actions: str, scene: Scene) -> list[str]:
    return list(
        map(format_skeleton, with_other_hands(parse_skeleton(actions), scene.state, scene.symbols))
    )


def test_hands_that_take_turns_come_first(scene: Scene) -> None:
    assert others(LEFT, scene) == [
        TURNS,
        TURNS.replace("2L", "2X").replace("2R", "2L").replace("2X", "2R"),
        LEFT.replace("2L", "2R"),
    ]


def test_two_bodies_at_once_need_two_hands(scene: Scene) -> None:
    swapped = "(grasp pr2R red) (grasp pr2L green) (place pr2R red green)"
    assert others("(grasp pr2L red) (grasp pr2R green) (place pr2L red green)", scene) == [swapped]


@pytest.mark.parametrize(("count", "duration"), [(0, 4.0), (1, 2.0), (5, 2.0)])
def test_the_fastest_is_taken(
    count: int, duration: float, scene: Scene, limits: SearchLimits
) -> None:
    problem = Problem(scene, OBJECTIVE, limits, SoonerByTurns(scene), UNIFORM)
    found = best_first.plan(problem)
    assert found.path is not None
    best = faster_by_other_hands(problem, found, count)
    assert best.path is not None
    assert best.path.trajectory is not None
    assert best.path.trajectory.times[-1] == duration
    assert best.coarse_calls > found.coarse_calls


def test_the_fastest_motion_at_other_places_is_taken(scene: Scene, limits: SearchLimits) -> None:
    bounds = SoonerByTurns(scene)
    found = best_first.plan(Problem(scene, OBJECTIVE, limits, bounds, UNIFORM))
    slower, sooner = (bounds.path(parse_skeleton(actions)) for actions in (LEFT, TURNS))
    assert faster_at_other_places(found, iter([slower])).path is found.path
    assert faster_at_other_places(found, iter([slower, sooner])).path is sooner
