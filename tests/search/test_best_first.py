"""Guided LGP, best-first: complete with any policy, prunes, deterministic."""

from scripted import UNIFORM, Scorer, ScriptedBounds

from guided_lgp.logic import Skeleton, parse_objective, parse_skeleton, progress, satisfied
from guided_lgp.params import SearchLimits
from guided_lgp.scene.model import Scene
from guided_lgp.search import best_first, breadth_first
from guided_lgp.search.problem import Problem

TOWER = parse_objective(["(on red green)", "(on green blue)"])


def left_hand_fails(skeleton: Skeleton) -> bool:
    return skeleton[-1].symbols[0] == "pr2R"


def test_a_uniform_policy_solves_four_actions(scene: Scene) -> None:
    limits = SearchLimits(
        max_depth=4, reattempts=0, max_tree_size=20_000, max_paths=1000, max_sequences=1000
    )
    bounds = ScriptedBounds(scene)
    result = best_first.plan(Problem(scene, TOWER, limits, bounds, UNIFORM))
    assert result.skeleton is not None
    assert len(result.skeleton) == 4
    assert satisfied(progress(scene.state, result.skeleton), TOWER)


def test_finds_what_breadth_first_finds(scene: Scene, limits: SearchLimits) -> None:
    misled = Scorer(lambda objective, state, action: -5.0 * (action.symbols[0] == "pr2R"))
    objective = parse_objective(["(on red tab2)", "(held blue)"])
    limits = limits.model_copy(update={"max_depth": 3})
    plans = [
        breadth_first.plan(
            Problem(scene, objective, limits, ScriptedBounds(scene, left_hand_fails))
        ),
        best_first.plan(
            Problem(scene, objective, limits, ScriptedBounds(scene, left_hand_fails), misled)
        ),
    ]
    assert all(plan.solved for plan in plans)
    assert plans[0].skeleton == plans[1].skeleton


def test_what_begins_with_an_infeasible_step_is_pruned(scene: Scene, limits: SearchLimits) -> None:
    bounds = ScriptedBounds(scene, left_hand_fails)
    best_first.plan(Problem(scene, TOWER, limits, bounds, UNIFORM))
    assert all(left_hand_fails(skeleton[:-1]) for skeleton in bounds.coarse_asked if skeleton[:-1])


def test_nothing_feasible_is_exhausted_not_endless(scene: Scene, limits: SearchLimits) -> None:
    bounds = ScriptedBounds(scene, path=lambda skeleton: False)
    limits = limits.model_copy(update={"max_depth": 2})
    result = best_first.plan(
        Problem(scene, parse_objective(["(held red)"]), limits, bounds, UNIFORM)
    )
    assert result.reason == "exhausted"
    assert parse_skeleton("(grasp pr2L red)") in bounds.path_asked


def test_same_search_twice(scene: Scene, limits: SearchLimits) -> None:
    first, second = (
        best_first.plan(Problem(scene, TOWER, limits, ScriptedBounds(scene), UNIFORM))
        for _ in range(2)
    )
    assert (first.skeleton, first.tree_size) == (second.skeleton, second.tree_size)
    assert (first.expansions, first.coarse_calls) == (second.expansions, second.coarse_calls)


def test_a_policy_that_goes_in_circles(scene: Scene) -> None:
    """It loves to move green to and fro; the search still turns to red soon."""
    circles = Scorer(lambda objective, state, action: 6.0 * (action.symbols[1] == "green"))
    limits = SearchLimits(
        max_depth=20, reattempts=0, max_tree_size=400_000, max_paths=1000, max_sequences=1000
    )
    result = best_first.plan(
        Problem(scene, parse_objective(["(on red tab2)"]), limits, ScriptedBounds(scene), circles)
    )
    assert result.solved
    assert result.tree_size < 500


def test_no_action_more_than_needed(scene: Scene, limits: SearchLimits) -> None:
    """The policy prefers to move red in two steps and to hold blue late; three actions do."""
    advice = parse_skeleton(
        "(grasp pr2L red) (place pr2L red tab2) (grasp pr2L red) (place pr2L red green)"
    )
    detour = {progress(scene.state, advice[:k]): action for k, action in enumerate(advice)}
    policy = Scorer(lambda objective, state, action: 3.0 * (action == detour.get(state)))
    objective = parse_objective(["(on red green)", "(held blue)"])
    result = best_first.plan(Problem(scene, objective, limits, ScriptedBounds(scene), policy))
    assert result.skeleton is not None
    assert len(result.skeleton) == 3


def test_takes_the_detour_that_geometry_asks_for(scene: Scene, limits: SearchLimits) -> None:
    """The left hand cannot place red on green, and the right one does not reach tab1."""

    def reaches(skeleton: Skeleton) -> bool:
        action = skeleton[-1]
        if action.symbols[0] == "pr2L":
            return action.symbols[2:] != ("green",)
        moved = any(before.symbols[2:] == ("tab2",) for before in skeleton[:-1])
        return action.instruction == "place" or moved

    bounds = ScriptedBounds(scene, reaches)
    objective = parse_objective(["(on red green)"])
    result = best_first.plan(Problem(scene, objective, limits, bounds, UNIFORM))
    assert result.skeleton == parse_skeleton(
        "(grasp pr2L red) (place pr2L red tab2) (grasp pr2R red) (place pr2R red green)"
    )


def test_ends_after_so_many_sequences_without_a_path(scene: Scene, limits: SearchLimits) -> None:
    bounds = ScriptedBounds(scene, path=lambda skeleton: False)
    limits = limits.model_copy(update={"max_paths": 5})
    result = best_first.plan(
        Problem(scene, parse_objective(["(held red)"]), limits, bounds, UNIFORM)
    )
    assert (result.reason, result.path_calls) == ("max_paths", 5)
    assert result.failed_candidates == 5
    assert "limit of sequences without a path" in result.explanation


def test_ends_after_so_many_coarse_bounds(scene: Scene, limits: SearchLimits) -> None:
    bounds = ScriptedBounds(scene, coarse=lambda skeleton: len(skeleton) < 4)
    limits = limits.model_copy(update={"max_sequences": 70})
    result = best_first.plan(Problem(scene, TOWER, limits, bounds, UNIFORM))
    assert (result.reason, result.coarse_calls) == ("max_sequences", 70)
    assert "limit of sequences for the coarse bound" in result.explanation
