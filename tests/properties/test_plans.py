"""Planning as a whole: solved means solved, and a search that finds nothing says why."""

from pathlib import Path

import pytest
from bad_input import answer, examples
from hypothesis import assume, event, given
from hypothesis import strategies as st

from guided_lgp.bounds.plan_file import read_plan, write_plan
from guided_lgp.bounds.verify import verify_path
from guided_lgp.logic import (
    Objective,
    applicable_actions,
    format_objective,
    one_goal_objectives,
    satisfied,
    successor,
    two_goal_objectives,
)
from guided_lgp.params import BoundsParams, Params, SearchLimits, load_params
from guided_lgp.planning import plan
from guided_lgp.scene import Box, Scene, Table, generate
from guided_lgp.scene.world import World
from guided_lgp.search.planners import SEARCHES
from guided_lgp.search.result import SearchResult


@pytest.fixture(scope="module")
def params() -> Params:
    """Limits that end a search within about a second."""
    limits = SearchLimits(
        max_depth=4, reattempts=1, max_tree_size=120, max_paths=2, max_sequences=1000
    )
    return load_params(Path(__file__).parents[2] / "params.yaml").model_copy(
        update={
            "bounds": BoundsParams(coarse_restarts=3, path_solutions=1),
            "compare_scalability": limits,
        }
    )


@st.composite
def tasks(draw: st.DrawFn) -> tuple[Scene, Objective]:
    """A configuration of the experiments, some of its boxes taken away, and an objective."""
    setup = draw(st.sampled_from("aabd"))
    (scene,) = generate(setup, 1, draw(st.integers(0, 10_000)), "scene").scenes
    boxes = draw(st.sets(st.sampled_from(scene.boxes), min_size=1))
    scene = scene.model_copy(update={"boxes": tuple(sorted(boxes, key=lambda box: box.name))})
    objectives = one_goal_objectives(scene.symbols) + two_goal_objectives(scene.symbols)
    objective = draw(st.sampled_from(objectives))
    assume(not satisfied(scene.state, objective))
    return scene, objective


def check(scene: Scene, objective: Objective, result: SearchResult, folder: Path) -> None:
    """A plan follows the rules, reaches the objective, and its written motion verifies."""
    if result.path is None:
        assert not result.solved
        assert result.explanation.splitlines() == [result.explanation]
        return
    state = scene.state
    for action in result.path.skeleton:
        assert action in applicable_actions(state, scene.symbols)
        state = successor(state, action)
    assert satisfied(state, objective)
    file = folder / "plan.json"
    write_plan(file, scene, objective, result.path, {})
    found = read_plan(file)
    assert (found.skeleton, found.goals) == (result.path.skeleton, objective)
    with World(scene) as world:
        assert verify_path(world, found.skeleton, found.trajectory).violation is None


@examples(40)
@given(task=tasks(), planner=st.sampled_from(list(SEARCHES)))
def test_solved_means_solved(
    task: tuple[Scene, Objective], planner: str, params: Params, folder: Path
) -> None:
    scene, objective = task
    result = plan(scene, objective, planner, params=params)
    event("solved" if result.solved else str(result.reason))
    check(scene, objective, result, folder)


@examples(20)
@given(
    position=st.tuples(st.floats(0.2, 1.2), st.floats(-0.9, 0.9), st.floats(0.3, 1.1)),
    size=st.tuples(st.floats(0.02, 0.3), st.floats(0.02, 0.08), st.floats(0.02, 0.3)),
    yaw=st.floats(-3.1, 3.1),
)
def test_boxes_of_any_size_anywhere(
    position: tuple[float, float, float],
    size: tuple[float, float, float],
    yaw: float,
    params: Params,
    folder: Path,
) -> None:
    """One box on a table of its own: refused, held, or not reached, but never wrongly held."""
    x, y, z = position
    scene = Scene(
        tables=(Table(name="tab1", position=position, half_extents=(0.15, 0.15)),),
        boxes=(Box(name="red", size=size, position=(x, y, z + size[2] / 2), yaw=yaw, on="tab1"),),
    )
    objective = one_goal_objectives(scene.symbols)[0]
    result = answer(lambda: plan(scene, objective, "breadth-first", params=params), "scene: ")
    event("refused" if result is None else "planned")
    if result is not None:
        check(scene, objective, result, folder)


@pytest.mark.parametrize("planner", SEARCHES)
def test_fifty_boxes(planner: str, params: Params, folder: Path) -> None:
    boxes = tuple(
        Box(
            name=f"box{index}",
            size=(0.03, 0.03, 0.05),
            position=(0.40 + 0.04 * (index % 8), 0.16 + 0.05 * (index // 8), 0.625),
            on="tab1",
        )
        for index in range(50)
    )
    tables = tuple(
        Table(name=name, position=(0.54, y, 0.60), half_extents=(0.17, 0.20))
        for name, y in (("tab1", 0.33), ("tab2", -0.33))
    )
    scene = Scene(tables=tables, boxes=boxes)
    objective = one_goal_objectives(scene.symbols)[7]
    assert format_objective(objective) == "(held box7)"
    check(scene, objective, plan(scene, objective, planner, params=params), folder)
