"""Planning one task from Python, and what it says where no plan exists."""

import inspect
import json
import re
import textwrap
from itertools import pairwise
from pathlib import Path

import pytest

import guided_lgp
from guided_lgp import cli, load_scene, plan
from guided_lgp.bounds.results import CoarseResult, Failure, PathResult
from guided_lgp.domains import load_domain
from guided_lgp.errors import InputError
from guided_lgp.explanation import ObservedBounds, Obstacle
from guided_lgp.logic import Action, Skeleton, parse_objective, parse_skeleton
from guided_lgp.planning import PlanningResult
from guided_lgp.search.result import Times

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"
START = load_domain().state({"red": "tab1", "green": "tab1"})
OBJECTIVE = parse_objective(["(on red green)"])


class Verdicts:
    """Bounds that fail where a table says so."""

    def __init__(self, coarse: dict[str, Failure], path: dict[str, Failure]) -> None:
        self._coarse = {parse_skeleton(text): failure for text, failure in coarse.items()}
        self._path = {parse_skeleton(text): failure for text, failure in path.items()}

    def coarse(self, skeleton: Skeleton) -> CoarseResult:
        failure = self._coarse.get(skeleton)
        return CoarseResult(skeleton, failure is None, failure=failure, restarts=3)

    def path(self, skeleton: Skeleton) -> PathResult:
        failure = self._path.get(skeleton)
        return PathResult(skeleton, failure is None, failure=failure)


def obstacles(
    coarse: dict[str, Failure], path: dict[str, Failure] | None = None
) -> tuple[Obstacle, ...]:
    bounds = ObservedBounds(Verdicts(coarse, path or {}))
    for text in coarse:
        assert not bounds.coarse(parse_skeleton(text)).feasible
    for text in path or {}:
        assert not bounds.path(parse_skeleton(text)).feasible
    return bounds.obstacles(START, OBJECTIVE)


def test_equal_obstacles_are_counted_and_the_shortest_sequence_is_the_example() -> None:
    (found,) = obstacles(
        {
            "(grasp pr2L green) (grasp pr2R red)": Failure(1, "hold pr2R red", 0.01, "9 starts"),
            "(grasp pr2R red)": Failure(0, "hold pr2R red", 0.02, "9 starts"),
        }
    )
    assert found.action == Action("grasp", ("pr2R", "red"))
    assert (found.sequences, found.example, found.violation) == (2, (found.action,), 0.02)
    assert str(found) == "(grasp pr2R red): action 1 has no solution (9 starts)"


def test_what_is_nearest_to_the_goals_comes_first() -> None:
    reaching = "(grasp pr2L red) (place pr2L red green)"
    found = obstacles(
        {
            "(grasp pr2R red)": Failure(0, "hold pr2R red", 0.001, ""),
            "(grasp pr2R red) (place pr2R red green)": Failure(1, "balanced red green", 0.1, ""),
        },
        {reaching: Failure(1, "no motion found to place red", float("nan"), "")},
    )
    assert [obstacle.constraint for obstacle in found] == [
        "no motion found to place red",
        "balanced red green",
        "hold pr2R red",
    ]
    assert found[0].bound == "path"
    assert found[0].document()["violation"] is None


def test_a_sequence_asked_twice_counts_once() -> None:
    bounds = ObservedBounds(Verdicts({"(grasp pr2R red)": Failure(0, "reach", 0.1, "")}, {}))
    for _ in range(2):
        bounds.coarse(parse_skeleton("(grasp pr2R red)"))
    assert bounds.starts == 3
    assert bounds.obstacles(START, OBJECTIVE)[0].sequences == 1


def test_what_goes_on_where_a_path_has_failed_is_put_off_and_taken_up() -> None:
    failed = parse_skeleton("(grasp pr2R red) (place pr2R red green)")
    onwards = parse_skeleton("(grasp pr2R red) (place pr2R red tab1)")
    blocked = Failure(0, "clear r_gripper_palm_link green", float("nan"), "")
    bounds = ObservedBounds(Verdicts({}, {"(grasp pr2R red) (place pr2R red green)": blocked}))
    assert bounds.coarse(onwards).feasible
    assert not bounds.path(failed).feasible
    assert not bounds.take_up()  # nothing has been asked that would go on from there
    bounds.path(failed)
    assert bounds.coarse(onwards[:1]).feasible  # the beginning itself is as it was
    verdict = bounds.coarse(onwards)
    assert (verdict.feasible, verdict.failure) == (False, blocked)
    assert bounds.take_up()
    assert bounds.coarse(onwards).feasible
    assert not bounds.take_up()


@pytest.mark.parametrize(
    ("name", "goals", "nodes"),
    [
        ("impossible_tower", ["(on red green)", "(on blue red)"], 400),
        ("impossible_pair", ["(on wide1 small)", "(on wide2 small)"], 1000),
    ],
)
def test_impossible_tasks_are_explained_by_facts_or_by_an_action(
    name: str, goals: list[str], nodes: int
) -> None:
    scene = load_scene(EXAMPLES / f"{name}.json")
    result = plan(scene, goals, "breadth-first", max_nodes=nodes)
    assert not result.solved
    first = result.obstacles[0]
    assert first.violation > 0.001
    assert "violated" not in result.explanation  # a solver's compromise is no reason
    told = str(first) if result.finding is None else result.finding.text
    assert told in result.explanation
    assert f"{result.coarse_calls} sequences with {result.solver_starts} starts" in (
        result.explanation
    )


def test_what_only_a_search_can_tell_names_the_action() -> None:
    (found,) = obstacles(
        {}, {"(grasp pr2R red)": Failure(0, "no motion found to grasp red", float("nan"), "3 ways")}
    )
    assert str(found) == "(grasp pr2R red): action 1: no motion found to grasp red (3 ways)"


def test_attempts_that_go_in_circles_are_told_apart_from_infeasible_ones() -> None:
    result = PlanningResult(
        scene=load_scene(EXAMPLES / "three_boxes.json"),
        objective=OBJECTIVE,
        coarse=None,
        path=None,
        tree_size=30,
        expansions=9,
        policy_calls=9,
        coarse_calls=12,
        infeasible_calls=5,
        part_calls=0,
        path_calls=1,
        failed_candidates=0,
        causes=("max_depth", "infeasible", "max_depth"),
        reattempts={},
        times=Times(0.0, 0.0, 0.0, 0.0),
        reason="attempts",
        solver_starts=40,
    )
    assert result.explanation == (
        "the last allowed attempt failed (30 nodes; attempts: 1 infeasible, 2 without the goals at "
        "the maximum depth; 12 sequences with 40 starts of the coarse bound, 1 of them on to the "
        "path bound)"
    )


def test_a_plan_needs_no_explanation() -> None:
    result = plan(load_scene(EXAMPLES / "three_boxes.json"), "(held red)", "breadth-first")
    assert result.solved
    assert result.explanation == ""
    assert result.obstacles == ()


def test_the_readme_lists_every_scene() -> None:
    text = (EXAMPLES / "README.md").read_text()
    for file in EXAMPLES.glob("*.json"):
        assert f"`{file.name}`" in text
        assert json.loads(file.read_text())["name"] == file.stem.replace("_", "-")


@pytest.mark.parametrize(
    ("name", "goals", "actions"),
    re.findall(
        r"^\| `(\w+\.json)` \|.*\| `(--goal .*)` \| (\d) actions \|$",
        (EXAMPLES / "README.md").read_text(),
        flags=re.MULTILINE,
    ),
)
def test_an_example_takes_as_many_actions_as_the_readme_says(
    name: str, goals: str, actions: str
) -> None:
    result = plan(EXAMPLES / name, re.findall(r"\(.*?\)", goals))
    assert len(result.skeleton or ()) == int(actions)


def test_twenty_actions_are_moved_by_both_arms_at_once() -> None:
    towers = (
        ("red", "blue", "purple", "white", "pink", "tray"),
        ("green", "yellow", "orange", "black", "brown", "tray"),
    )
    goals = [f"(on {upper} {lower})" for tower in towers for upper, lower in pairwise(tower)]
    path = plan(EXAMPLES / "ten_boxes.json", goals).path
    assert path is not None
    assert path.trajectory is not None
    assert path.trajectory.times[-1] < 30.0  # one arm after the other takes 48 s


def test_the_docstring_of_the_package_runs(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(ROOT)
    _, example = (guided_lgp.__doc__ or "").split("::\n", 1)
    exec(textwrap.dedent(example))
    assert "grasp" in capsys.readouterr().out


def test_unknown_names() -> None:
    scene = load_scene(EXAMPLES / "three_boxes.json")
    with pytest.raises(InputError, match="planner: unknown 'fast'"):
        plan(scene, "(held red)", "fast")
    with pytest.raises(InputError, match="policy 'best': is unknown"):
        plan(scene, "(held red)", policy="best")


def test_the_command_line_has_the_defaults_of_the_python_interface() -> None:
    command, function = inspect.signature(cli.plan.plan), inspect.signature(plan)
    for name in ("planner", "policy"):
        assert command.parameters[name].default == function.parameters[name].default
