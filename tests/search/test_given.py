"""Plans that begin with given actions, and several candidates of which the best is taken."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scripted import UNIFORM, ScriptedBounds

from guided_lgp import load_scene, plan
from guided_lgp.bounds.results import PathResult, Trajectory
from guided_lgp.errors import InputError
from guided_lgp.logic import (
    Skeleton,
    format_skeleton,
    parse_objective,
    parse_skeleton,
    progress,
    satisfied,
)
from guided_lgp.params import SearchLimits
from guided_lgp.scene.model import Scene
from guided_lgp.search import best_first, complete
from guided_lgp.search.given import read_skeleton
from guided_lgp.search.problem import Problem
from guided_lgp.search.result import SearchResult

OBJECTIVE = parse_objective(["(on red tab2)"])
EXAMPLE = Path(__file__).parents[2] / "examples" / "three_boxes.json"
WHOLE = "(grasp pr2L red) (place pr2L red green)"


class TimedBounds(ScriptedBounds):
    """Paths of a duration (s) by the gripper that carries red last."""

    def path(self, skeleton: Skeleton) -> PathResult:
        duration = 1.0 if skeleton[-1].symbols[0] == "pr2R" else 2.0
        moment = Trajectory((), np.array([0.0, duration]), np.zeros((2, 0)), ())
        return PathResult(skeleton, feasible=True, trajectory=moment)


@pytest.mark.parametrize(
    ("search", "candidates", "duration"),
    [(best_first.plan, 1, 2.0), (best_first.plan, 2, 1.0), (complete.plan, 20, 1.0)],
)
def test_of_several_candidates_the_fastest_of_the_shortest_is_taken(
    search: Callable[[Problem], SearchResult],
    candidates: int,
    duration: float,
    scene: Scene,
    limits: SearchLimits,
) -> None:
    bounds = TimedBounds(scene)
    path = search(Problem(scene, OBJECTIVE, limits, bounds, UNIFORM, candidates=candidates)).path
    assert path is not None
    assert path.trajectory is not None
    assert (len(path.skeleton), path.trajectory.times[-1]) == (2, duration)


@pytest.mark.parametrize(("seconds", "gripper"), [(1.98, "pr2L"), (1.8, "pr2R")])
def test_where_durations_are_alike_the_lighter_grip_is_taken(
    seconds: float, gripper: str, scene: Scene, limits: SearchLimits
) -> None:
    class LoadedBounds(TimedBounds):
        """Quicker by pr2R, which has to press with 50 N."""

        def path(self, skeleton: Skeleton) -> PathResult:
            found = super().path(skeleton)
            assert found.trajectory is not None
            if skeleton[-1].symbols[0] == "pr2L":
                return found
            motion = replace(found.trajectory, times=np.array([0.0, seconds]))
            return replace(found, trajectory=motion, load=50.0)

    problem = Problem(scene, OBJECTIVE, limits, LoadedBounds(scene), UNIFORM, candidates=2)
    skeleton = best_first.plan(problem).skeleton
    assert skeleton is not None
    assert skeleton[-1].symbols[0] == gripper


def test_fewer_candidates_than_asked_for_are_enough(scene: Scene, limits: SearchLimits) -> None:
    problem = Problem(scene, OBJECTIVE, limits, TimedBounds(scene), UNIFORM, candidates=50)
    result = best_first.plan(problem)
    assert result.solved
    assert result.reason is None
    assert result.skeleton is not None
    assert len(result.skeleton) == 2


@pytest.mark.parametrize("search", [best_first.plan, complete.plan])
def test_a_plan_begins_with_what_is_given(
    search: Callable[[Problem], SearchResult], scene: Scene, limits: SearchLimits
) -> None:
    prefix = parse_skeleton("(grasp pr2L blue) (place pr2L blue green)")
    problem = Problem(scene, OBJECTIVE, limits, ScriptedBounds(scene), UNIFORM, prefix=prefix)
    result = search(problem)
    assert result.skeleton is not None
    assert result.skeleton[:2] == prefix
    assert satisfied(progress(scene.state, result.skeleton), OBJECTIVE)


def test_what_is_read_as_a_sequence(tmp_path: Path) -> None:
    scene = load_scene(EXAMPLE)
    written = tmp_path / "plan.json"
    written.write_text(json.dumps({"actions": WHOLE.replace(") (", ");(").split(";")}))
    lines = tmp_path / "plan.pddl"
    lines.write_text("; a plan\n(grasp pr2l red)\n(place pr2l red green)\n")
    for given in (WHOLE, str(written), str(lines), parse_skeleton(WHOLE)):
        assert format_skeleton(read_skeleton(given, scene.symbols, scene.state)) == WHOLE


@pytest.mark.parametrize(
    ("given", "fault"),
    [
        ("(grasp pr2L red) (grasp pr2L blue)", r"action 2, \(grasp pr2L blue\), is not applicable"),
        ("(push red)", "is not an action"),
        ("(grasp pr2L pink)", "not applicable"),
        ("nowhere.txt", "No such file .*a file, or actions such as"),
        ("a\0b", "is no name of a file"),
    ],
)
def test_bad_sequences_are_told(given: str, fault: str) -> None:
    scene = load_scene(EXAMPLE)
    with pytest.raises(InputError, match=fault):
        read_skeleton(given, scene.symbols, scene.state)


def test_a_whole_plan_is_only_timed() -> None:
    timed = plan(EXAMPLE, [], skeleton=WHOLE)
    assert format_skeleton(timed.skeleton or ()) == WHOLE
    assert timed.tree_size == 1
    goals = plan(EXAMPLE, "(on red green)", skeleton=WHOLE)
    assert goals.skeleton == timed.skeleton


def test_a_given_sequence_that_is_infeasible_is_told_so() -> None:
    far = EXAMPLE.parents[1] / "tests" / "cases" / "handover_only.json"
    result = plan(far, "(held parcel)", skeleton="(grasp pr2R parcel)")
    assert (result.solved, result.reason) == (False, "given")
    assert "(grasp pr2R parcel)" in result.explanation


def test_searches_over_states_begin_with_nothing() -> None:
    for planner in ("graph", "breadth-first"):
        with pytest.raises(InputError, match=f"planner: {planner} knows neither"):
            plan(EXAMPLE, "(on red green)", planner, skeleton="(grasp pr2L red)")
