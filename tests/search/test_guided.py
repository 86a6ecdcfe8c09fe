"""Guided LGP: greedy steps, reattempts by cause, adaptation, tree size (paper, Appendix)."""

import pytest
from scripted import UNIFORM, Scorer, ScriptedBounds

from guided_lgp.domains import load_domain
from guided_lgp.errors import InputError
from guided_lgp.logic import (
    Action,
    Objective,
    Skeleton,
    State,
    parse_objective,
    parse_skeleton,
    progress,
)
from guided_lgp.params import SearchLimits
from guided_lgp.scene.model import Scene
from guided_lgp.search import guided
from guided_lgp.search.problem import Problem

TOWER = parse_objective(["(on red green)", "(on green blue)"])
PLAN = parse_skeleton(
    "(grasp pr2L green) (place pr2L green blue) (grasp pr2R red) (place pr2R red green)"
)


START = load_domain().state({"red": "tab1", "green": "tab1", "blue": "tab1"})
ADVICE = {progress(START, PLAN[:k]): action for k, action in enumerate(PLAN)}


def prefers_plan(objective: Objective, state: State, action: Action) -> float:
    return 2.0 * (action == ADVICE[state])


def test_follows_a_known_plan(scene: Scene, limits: SearchLimits) -> None:
    bounds = ScriptedBounds(scene)
    result = guided.plan(Problem(scene, TOWER, limits, bounds, Scorer(prefers_plan)))
    assert result.skeleton == PLAN
    assert result.policy_calls == result.expansions == 4
    assert result.causes == ()
    assert bounds.path_asked == [PLAN]


def test_tree_size_counts_all_children(scene: Scene, limits: SearchLimits) -> None:
    objective = parse_objective(["(on red tab2)"])
    likes = parse_skeleton("(grasp pr2R red) (place pr2R red tab2)")
    policy = Scorer(lambda objective, state, action: 2.0 * (action in likes))
    result = guided.plan(Problem(scene, objective, limits, ScriptedBounds(scene), policy))
    assert result.skeleton == likes
    assert result.tree_size == 1 + 6 + 6


def test_reattempt_after_an_infeasible_step(scene: Scene, limits: SearchLimits) -> None:
    objective = parse_objective(["(on red tab2)"])
    likes = {"(grasp pr2L red)": 3.0, "(grasp pr2R red)": 2.0}
    likes |= {"(place pr2L red tab2)": 3.0, "(place pr2R red tab2)": 3.0}
    policy = Scorer(lambda objective, state, action: likes.get(str(action), 0.0))
    bounds = ScriptedBounds(scene, coarse=lambda skeleton: skeleton[-1].symbols[0] == "pr2R")
    result = guided.plan(Problem(scene, objective, limits, bounds, policy))
    assert result.skeleton == parse_skeleton("(grasp pr2R red) (place pr2R red tab2)")
    assert result.causes == ("infeasible",)
    assert result.reattempts == {"infeasible": 1, "max_depth": 0}
    assert (result.infeasible_calls, result.failed_candidates) == (1, 0)
    assert result.tree_size == 1 + 6 + 6


def test_reattempt_after_an_infeasible_path(scene: Scene, limits: SearchLimits) -> None:
    objective = parse_objective(["(held red)"])
    likes = {"(grasp pr2L red)": 3.0, "(grasp pr2R red)": 2.0}
    policy = Scorer(lambda objective, state, action: likes.get(str(action), 0.0))
    bounds = ScriptedBounds(scene, path=lambda skeleton: skeleton[0].symbols[0] == "pr2R")
    result = guided.plan(Problem(scene, objective, limits, bounds, policy))
    assert result.skeleton == parse_skeleton("(grasp pr2R red)")
    assert result.causes == ("infeasible",)
    assert len(bounds.path_asked) == 2
    assert (result.infeasible_calls, result.failed_candidates) == (0, 1)


def test_maximum_depth_ends_attempts(scene: Scene) -> None:
    never = Scorer(lambda objective, state, action: -9.0 * (action.symbols[1] == "red"))
    limits = SearchLimits(
        max_depth=3, reattempts=2, max_tree_size=20_000, max_paths=1000, max_sequences=1000
    )
    bounds = ScriptedBounds(scene)
    result = guided.plan(Problem(scene, parse_objective(["(held red)"]), limits, bounds, never))
    assert not result.solved
    assert result.reason == "attempts"
    assert result.causes == ("max_depth",) * 3
    assert result.reattempts == {"infeasible": 0, "max_depth": 2}
    assert all(len(skeleton) <= 3 for skeleton in bounds.coarse_asked)


def test_failed_nodes_are_never_tried_again(scene: Scene) -> None:
    bounds = ScriptedBounds(scene, coarse=lambda skeleton: False)
    limits = SearchLimits(
        max_depth=8, reattempts=100, max_tree_size=20_000, max_paths=1000, max_sequences=1000
    )
    result = guided.plan(Problem(scene, TOWER, limits, bounds, UNIFORM))
    assert result.reason == "exhausted"
    assert result.tree_size == 7
    assert len(bounds.coarse_asked) == len(set(bounds.coarse_asked)) == 6
    assert "every sequence within the depth limit is infeasible" in result.explanation


@pytest.mark.parametrize("adapt", [False, True])
def test_adaptation_encodes_unsatisfied_goals(
    scene: Scene, limits: SearchLimits, adapt: bool
) -> None:
    seen: list[Objective] = []

    def score(objective: Objective, state: State, action: Action) -> float:
        seen.append(objective)
        return 2.0 * (action in PLAN[:2])

    objective = parse_objective(["(on blue tab1)", "(on green blue)"])  # blue is there already
    guided.plan(Problem(scene, objective, limits, ScriptedBounds(scene), Scorer(score), adapt))
    assert set(seen) == {objective[1:] if adapt else objective}


def test_bad_objectives_are_answered_at_once(scene: Scene, limits: SearchLimits) -> None:
    bounds = ScriptedBounds(scene)
    with pytest.raises(InputError, match="already holds"):
        guided.plan(Problem(scene, parse_objective(["(on red tab1)"]), limits, bounds, UNIFORM))
    assert not bounds.coarse_asked


def test_a_reattempt_leaves_the_circle(scene: Scene) -> None:
    """The policy loves to move green to and fro, and then to move red."""
    circles = Scorer(
        lambda objective, state, action: (
            {"green": 6.0, "red": 3.0}.get(action.symbols[1], 0.0)
            + 2.0 * (action.symbols[2:] == ("tab2",))
        )
    )
    limits = SearchLimits(
        max_depth=8, reattempts=1, max_tree_size=20_000, max_paths=1000, max_sequences=1000
    )
    objective = parse_objective(["(on red tab2)"])
    result = guided.plan(Problem(scene, objective, limits, ScriptedBounds(scene), circles))
    assert result.causes == ("max_depth",)
    assert result.solved


def test_what_has_failed_is_doubted_in_other_contexts(scene: Scene) -> None:
    """The policy does not see that green keeps the hand from red, and would move blue."""
    likes = {"(grasp pr2L red)": 6.0, "(grasp pr2L green)": 1.0}
    likes |= {f"(place pr2L {box} tab2)": 4.0 for box in ("red", "green")}

    def score(objective: Objective, state: State, action: Action) -> float:
        if str(action) == "(grasp pr2L blue)" and state.support_of("blue") == "tab1":
            return 5.0
        return likes.get(str(action), -9.0)

    policy = Scorer(score)

    def feasible(skeleton: Skeleton) -> bool:
        moved = {action.symbols[1] for action in skeleton[:-1]}
        return skeleton[-1].symbols[1] != "red" or "green" in moved

    limits = SearchLimits(
        max_depth=8, reattempts=4, max_tree_size=20_000, max_paths=1000, max_sequences=1000
    )
    objective = parse_objective(["(on red tab2)"])
    problem = Problem(scene, objective, limits, ScriptedBounds(scene, coarse=feasible), policy)
    sure, doubting = guided.plan(problem), guided.plan_with_doubts(problem)
    assert not sure.solved
    assert doubting.solved
    assert doubting.infeasible_calls < sure.infeasible_calls == 5
