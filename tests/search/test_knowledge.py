"""Searches that know, or learn, what blocks what."""

from dataclasses import replace

import pytest
from scripted import COLOURS, UNIFORM, Scorer, ScriptedBounds, make_scene

from guided_lgp.bounds.results import CoarseResult
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
from guided_lgp.search.conflicts import Conflict, Conflicts
from guided_lgp.search.informed import ActionsNeeded, FactsOfPairs, InformedLandmarks
from guided_lgp.search.planners import SEARCHES
from guided_lgp.search.problem import Problem
from guided_lgp.search.result import Run
from guided_lgp.search.skeleton_tree import Node

LIMITS = SearchLimits(
    max_depth=12, reattempts=3, max_tree_size=400_000, max_paths=10, max_sequences=300
)
BLOCKED_BY = {"red": "green", "green": "blue"}
"""Nobody can take the first while the second stands where it was at the start."""
OBJECTIVE = parse_objective(["(on red tab2)"])


def possible(skeleton: Skeleton) -> bool:
    *before, last = skeleton
    moved = {action.symbols[1] for action in before}
    box = last.symbols[1]
    return box in moved or BLOCKED_BY.get(box, box) in {*moved, box}


class ScriptedParts(ScriptedBounds):
    """Bounds and parts that follow the rule; absent boxes are in nobody's way."""

    def __init__(self, scene: Scene) -> None:
        super().__init__(scene, possible)

    def out_of_reach(self, skeleton: Skeleton) -> bool:
        return False

    def part(self, boxes: frozenset[str], skeleton: Skeleton) -> CoarseResult:
        absent = [box for box in COLOURS if box not in boxes]
        away = parse_skeleton("".join(f"(grasp pr2L {box})" for box in absent))
        return CoarseResult(skeleton, possible((*away, *skeleton)))


@pytest.fixture
def problem() -> Problem:
    scene = make_scene(4, tray=False)
    parts = ScriptedParts(scene)
    return Problem(scene, OBJECTIVE, LIMITS, parts, UNIFORM, parts=parts)


@pytest.mark.parametrize("name", ["facts", "facts-tuned", "conflicts", "informed"])
def test_knowledge_saves_calls(problem: Problem, name: str) -> None:
    """Of all calls those for the facts are counted, too."""
    ignorant = SEARCHES["best-first"].plan(problem)
    informed = SEARCHES[name].plan(problem)
    assert informed.skeleton is not None
    assert len(informed.skeleton) <= 6
    assert informed.coarse_calls < ignorant.coarse_calls
    assert informed.coarse_calls - informed.part_calls < ignorant.coarse_calls / 2
    assert informed.infeasible_calls < informed.coarse_calls


def test_a_policy_that_knows_what_is_in_the_way_needs_no_facts(problem: Problem) -> None:
    """It makes way first; an estimate by the goals alone takes that for a detour."""
    order = ["blue", "green", "red"]

    def score(objective: Objective, state: State, action: Action) -> float:
        away = [box for box in order if state.support_of(box) == "tab2"]
        box = action.symbols[1]
        wanted = box == order[len(away)] if len(away) < 3 else False
        return 5.0 * (wanted and action.symbols[2:] in ((), ("tab2",)))

    guided = replace(problem, policy=Scorer(score))
    by_policy = SEARCHES["discrepancy"].plan(guided)
    assert by_policy.skeleton is not None
    assert by_policy.coarse_calls == len(by_policy.skeleton) == 6
    assert SEARCHES["best-first"].plan(guided).coarse_calls > 6


def test_facts_find_plans_as_short_as_astar(problem: Problem) -> None:
    shortest, informed = (SEARCHES[name].plan(problem) for name in ("astar", "facts"))
    assert shortest.skeleton is not None
    assert informed.skeleton is not None
    assert len(informed.skeleton) == len(shortest.skeleton)


def test_estimates_count_what_is_in_the_way(problem: Problem) -> None:
    facts = FactsOfPairs(problem, Run(problem))
    needed, landmarks = ActionsNeeded(problem, facts), InformedLandmarks(problem, facts)
    start = Node(0, (), problem.scene.state)
    assert (needed(start), landmarks(start)) == (6, 4)
    done = parse_skeleton("(grasp pr2L blue) (grasp pr2R green) (place pr2R green tab2)")
    later = Node(1, done, progress(problem.scene.state, done))
    assert (needed(later), landmarks(later)) == (3, 2)  # blue is still in a hand


def test_a_planted_pair_is_found_and_never_tried_again(problem: Problem) -> None:
    conflicts = Conflicts(problem.scene, Run(problem))
    conflicts.learn(parse_skeleton("(grasp pr2R yellow) (place pr2R yellow tab2) (grasp pr2L red)"))
    pair = Conflict(frozenset({"red", "green"}), parse_skeleton("(grasp pr2L red)"))
    assert conflicts.found == [pair]
    assert conflicts.blockers(pair.actions[0]) == ({"green"},)
    assert conflicts.denied(parse_skeleton("(grasp pr2R blue) (grasp pr2L red)"))
    assert not conflicts.denied(parse_skeleton("(grasp pr2R green) (grasp pr2L red)"))


def test_nothing_is_tried_twice_for_the_same_reason(problem: Problem) -> None:
    bounds = problem.bounds
    assert isinstance(bounds, ScriptedBounds)
    SEARCHES["conflicts"].plan(problem)
    failed = [skeleton for skeleton in set(bounds.coarse_asked) if not possible(skeleton)]
    assert len({(skeleton[-1], len(skeleton)) for skeleton in failed}) == len(failed) <= 4
