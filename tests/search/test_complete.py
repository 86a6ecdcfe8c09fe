"""The search for users: greedy where that is enough, complete where it is not, never endless."""

from scripted import UNIFORM, Scorer, ScriptedBounds

from guided_lgp.bounds.deadline import Deadline
from guided_lgp.logic import parse_objective, progress, satisfied
from guided_lgp.params import SearchLimits
from guided_lgp.scene.model import Scene
from guided_lgp.search import complete, guided
from guided_lgp.search.problem import Problem

OBJECTIVE = parse_objective(["(on red tab2)"])
CIRCLES = Scorer(lambda objective, state, action: 6.0 * ("green" in action.symbols))
"""It loves to move green to and fro."""


def test_where_the_policy_is_right_nothing_changes(scene: Scene, limits: SearchLimits) -> None:
    likes = Scorer(lambda objective, state, action: 6.0 * ({"red", "tab2"} <= {*action.symbols}))
    results = [
        search.plan(Problem(scene, OBJECTIVE, limits, ScriptedBounds(scene), likes))
        for search in (complete, guided)
    ]
    assert results[0].skeleton == results[1].skeleton


def test_where_the_policy_goes_in_circles_the_search_goes_on(
    scene: Scene, limits: SearchLimits
) -> None:
    limits = limits.model_copy(update={"reattempts": 0})
    bounds = ScriptedBounds(scene)
    assert not guided.plan(Problem(scene, OBJECTIVE, limits, bounds, CIRCLES)).solved
    result = complete.plan(Problem(scene, OBJECTIVE, limits, bounds, CIRCLES))
    assert result.skeleton is not None
    assert satisfied(progress(scene.state, result.skeleton), OBJECTIVE)
    assert result.causes == ("max_depth",)


def test_what_is_infeasible_is_exhausted(scene: Scene, limits: SearchLimits) -> None:
    bounds = ScriptedBounds(scene, coarse=lambda skeleton: False)
    result = complete.plan(Problem(scene, OBJECTIVE, limits, bounds, UNIFORM))
    assert result.reason == "exhausted"
    assert len(set(bounds.coarse_asked)) == len(bounds.coarse_asked)


def test_the_limit_of_time_ends_it(scene: Scene, limits: SearchLimits) -> None:
    bounds = ScriptedBounds(scene)
    result = complete.plan(
        Problem(scene, OBJECTIVE, limits, bounds, CIRCLES, deadline=Deadline.after(0))
    )
    assert (result.reason, bounds.coarse_asked) == ("max_seconds", [])
