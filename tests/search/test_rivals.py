"""Breadth-first with duplicate detection, and A*: shortest plans first, complete when some fail."""

from collections.abc import Callable

import pytest
from scripted import ScriptedBounds, make_scene

from guided_lgp.logic import (
    Objective,
    Skeleton,
    least_actions,
    parse_objective,
    progress,
    satisfied,
    two_goal_objectives,
)
from guided_lgp.logic.strips import facts, goal_facts, relaxed_operators
from guided_lgp.params import SearchLimits
from guided_lgp.scene.model import Scene
from guided_lgp.search import best_first, graph
from guided_lgp.search.landmark_cut import LandmarkCut
from guided_lgp.search.problem import Problem
from guided_lgp.search.result import SearchResult
from guided_lgp.search.tree import StateSpace, distances

LIMITS = SearchLimits(
    max_depth=12, reattempts=0, max_tree_size=400_000, max_paths=1000, max_sequences=1000
)
TOWER = parse_objective(["(on red green)", "(on green blue)"])
RIVALS = [graph.plan, best_first.plan_shortest]
Planner = Callable[..., SearchResult]


@pytest.mark.parametrize("plan", RIVALS)
def test_shortest_plan_first(plan: Planner, scene: Scene) -> None:
    bounds = ScriptedBounds(scene)
    result = plan(Problem(scene, TOWER, LIMITS, bounds))
    assert result.skeleton is not None
    assert len(result.skeleton) == 4
    assert satisfied(progress(scene.state, result.skeleton), TOWER)
    assert bounds.path_asked == [result.skeleton]


@pytest.mark.parametrize("plan", RIVALS)
def test_next_sequence_when_the_first_fails(plan: Planner, scene: Scene) -> None:
    """Only the right hand reaches, and only sequences of six actions have a path."""
    bounds = ScriptedBounds(
        scene,
        coarse=lambda skeleton: skeleton[-1].symbols[0] == "pr2R",
        path=lambda skeleton: len(skeleton) == 6,
    )
    result = plan(Problem(scene, TOWER, LIMITS, bounds))
    assert result.skeleton is not None
    assert len(result.skeleton) == 6
    assert {action.symbols[0] for action in result.skeleton} == {"pr2R"}
    lengths = [len(skeleton) for skeleton in bounds.path_asked]
    assert lengths == sorted(lengths)
    assert len(set(bounds.path_asked)) == len(lengths)


@pytest.mark.parametrize("plan", RIVALS)
def test_gives_up_with_a_reason(plan: Planner, scene: Scene) -> None:
    bounds = ScriptedBounds(scene, coarse=lambda skeleton: len(skeleton) < 3)
    deep = LIMITS.model_copy(update={"max_depth": 5})
    result = plan(Problem(scene, TOWER, deep, bounds))
    assert result.reason == "exhausted"
    small = LIMITS.model_copy(update={"max_tree_size": 50})
    result = plan(Problem(scene, TOWER, small, ScriptedBounds(scene, lambda _: False)))
    assert result.reason in {"max_tree_size", "exhausted"}
    assert not result.solved


def test_exclusion_saves_verdicts(scene: Scene) -> None:
    def rule(skeleton: Skeleton) -> bool:
        return str(skeleton[0]) == "(grasp pr2R green)"

    bounds = ScriptedBounds(scene, coarse=rule)
    result = best_first.plan_shortest(Problem(scene, TOWER, LIMITS, bounds))
    assert result.skeleton is not None
    first_actions = {skeleton[0] for skeleton in bounds.coarse_asked if not rule(skeleton)}
    asked = [skeleton for skeleton in bounds.coarse_asked if not rule(skeleton)]
    assert len(asked) == len(first_actions)


def test_landmark_cut_is_admissible_and_informed() -> None:
    scene = make_scene(3, tray=False)
    symbols = scene.symbols
    space = StateSpace(symbols, scene.state)
    space.explore()
    objectives: list[Objective] = [TOWER, *two_goal_objectives(symbols)[::7]]
    informed = 0
    for objective in objectives:
        exact = distances(space, objective)
        landmark_cut = LandmarkCut(goal_facts(objective, symbols), relaxed_operators(symbols))
        for number in range(len(space)):
            state = space.state(number)
            bound = landmark_cut(facts(state, symbols))
            assert least_actions(state, objective, symbols) <= exact[number]
            assert bound <= exact[number]
            assert (bound == 0) == (exact[number] == 0)
            informed += bound == exact[number]
    assert informed > 0.8 * len(objectives) * len(space)


def test_a_layer_ends_at_the_limit_of_the_size() -> None:
    """The layers of five boxes grow to tens of thousands of states."""
    scene = make_scene(5, tray=True)
    objective = parse_objective([f"(on {box} tray)" for box in scene.symbols.boxes])
    limits = LIMITS.model_copy(update={"max_tree_size": 2000})
    result = graph.plan(Problem(scene, objective, limits, ScriptedBounds(scene)))
    assert result.reason == "max_tree_size"
    assert 2000 <= result.tree_size < 2100
