"""The baseline: order, tree size, infeasible sequences, limits."""

import pytest
from scripted import ScriptedBounds

from guided_lgp.errors import InputError
from guided_lgp.logic import format_skeleton, parse_objective, progress, satisfied
from guided_lgp.params import SearchLimits
from guided_lgp.scene.model import Scene
from guided_lgp.search import breadth_first
from guided_lgp.search.problem import Problem

LIMITS = SearchLimits(
    max_depth=20, reattempts=3, max_tree_size=400_000, max_paths=1000, max_sequences=1000
)
TOWER = parse_objective(["(on red green)", "(on green blue)"])


def test_first_feasible_sequence_in_order(scene: Scene) -> None:
    objective = parse_objective(["(on red tab2)"])
    result = breadth_first.plan(Problem(scene, objective, LIMITS, ScriptedBounds(scene)))
    assert result.skeleton is not None
    assert format_skeleton(result.skeleton) == "(grasp pr2L red) (place pr2L red tab2)"
    assert result.tree_size == 1 + 6 + 6
    assert result.expansions == 2


def test_infeasible_sequences_are_passed_over(scene: Scene) -> None:
    bounds = ScriptedBounds(
        scene,
        coarse=lambda skeleton: skeleton[-1].symbols[0] == "pr2R",
        path=lambda skeleton: len(skeleton) > 2,
    )
    objective = parse_objective(["(on red tab2)"])
    result = breadth_first.plan(Problem(scene, objective, LIMITS, bounds))
    assert result.skeleton is not None
    assert len(result.skeleton) == 3  # the tree goes on below a rejected sequence
    assert {action.symbols[0] for action in result.skeleton} == {"pr2R"}


def test_tower_is_found_in_the_fourth_level(scene: Scene) -> None:
    result = breadth_first.plan(Problem(scene, TOWER, LIMITS, ScriptedBounds(scene)))
    assert result.skeleton is not None
    assert len(result.skeleton) == 4
    assert satisfied(progress(scene.state, result.skeleton), TOWER)
    assert 1 + 6 + 36 + 240 < result.tree_size <= 1 + 6 + 36 + 240 + 1392


def test_stops_at_the_limit_and_says_why(scene: Scene) -> None:
    bounds = ScriptedBounds(scene, coarse=lambda skeleton: False)
    limits = SearchLimits(
        max_depth=20, reattempts=3, max_tree_size=2_000, max_paths=1000, max_sequences=1000
    )
    result = breadth_first.plan(Problem(scene, TOWER, limits, bounds))
    assert not result.solved
    assert result.reason == "max_tree_size"
    assert 2_000 <= result.tree_size < 2_020
    assert "stopped at the limit" in result.explanation
    assert "reach violated" in result.explanation
    assert result.failed_candidates > result.infeasible_calls == 4  # of one action


def test_times_of_known_verdicts_count(scene: Scene) -> None:
    objective = parse_objective(["(on red tab2)"])
    result = breadth_first.plan(Problem(scene, objective, LIMITS, ScriptedBounds(scene)))
    assert result.times.coarse == pytest.approx(2 * 0.25)
    assert result.times.path == pytest.approx(1.5)
    assert result.times.policy == 0
    assert 0 < result.times.symbolic < 0.5


def test_bad_objectives_are_answered_at_once(scene: Scene) -> None:
    bounds = ScriptedBounds(scene)
    contradiction = parse_objective(["(on red green)", "(on green red)"])
    with pytest.raises(InputError, match="cycle"):
        breadth_first.plan(Problem(scene, contradiction, LIMITS, bounds))
    assert not bounds.coarse_asked
