"""The scalability problems: counts and least numbers of actions (Table II)."""

import pytest

from guided_lgp.domains import load_domain
from guided_lgp.experiments.problems import PROBLEMS, ProblemClass
from guided_lgp.logic import contradiction, format_objective
from guided_lgp.logic.strips import facts, goal_facts, relaxed_operators
from guided_lgp.scene import generate
from guided_lgp.search.landmark_cut import LandmarkCut


def test_counts_and_names() -> None:
    counts = {
        problem.name: len(
            problem.objectives(generate(problem.setup, 1, 0, "x").scenes[0].symbols.boxes)
        )
        for problem in PROBLEMS
    }
    assert counts.pop("a.1") == 9
    assert counts.pop("b.1") == 8
    assert counts == dict.fromkeys(("b.2", "c.1", "c.2", "d.1", "d.2", "e.6", "e.8", "e.10"), 6)


@pytest.mark.parametrize("problem", PROBLEMS, ids=lambda problem: problem.name)
def test_objectives_need_the_stated_number_of_actions(problem: ProblemClass) -> None:
    scene = generate(problem.setup, 1, 0, "x").scenes[0]
    objectives = problem.objectives(scene.symbols.boxes)
    assert len(set(map(frozenset, objectives))) == len(objectives)
    symbols = problem.unguided_symbols(scene.symbols)
    operators = relaxed_operators(symbols)
    for objective in objectives:
        assert contradiction(objective, symbols) is None
        # At least so many by the landmarks, and no more: every goal takes one grasp, one place.
        bound = LandmarkCut(goal_facts(objective, symbols), operators)(facts(scene.state, symbols))
        assert bound == problem.k_min == 2 * len(objective)


def test_reduced_branching() -> None:
    symbols = load_domain().symbols(
        gripper=("pr2L", "pr2R"), box=("red", "green", "blue"), table=("tab1", "tab2", "tray")
    )
    starred = {problem.name for problem in PROBLEMS if problem.reduced}
    assert starred == {"b.1", "c.1", "d.1"}
    for problem in PROBLEMS:
        tables = problem.unguided_symbols(symbols).tables
        assert tables == (("tray", "tab2") if problem.reduced else symbols.tables)


def test_objectives_spelled_out() -> None:
    problems = {problem.name: problem for problem in PROBLEMS}
    boxes = ("red", "green", "blue", "yellow", "purple")
    stacks = [format_objective(objective) for objective in problems["a.1"].objectives(boxes[:3])]
    assert "(on red green) (on green blue)" in stacks
    assert "(on red blue) (on green blue)" in stacks
    towers = problems["d.2"].objectives(boxes)
    assert format_objective(towers[0]) == (
        "(on red green) (on green blue) (on blue yellow) (on yellow purple) (on purple tray)"
    )
    assert {tower[0].symbols[0] for tower in towers} == set(boxes)  # every box is at the top once
    for objective in problems["d.1"].objectives(boxes):
        assert [goal.symbols[1] for goal in objective].count("tray") == 2


def test_objectives_for_many_boxes() -> None:
    problems = {problem.name: problem for problem in PROBLEMS}
    boxes = ("red", "green", "blue", "yellow", "purple", "orange")
    written = [format_objective(objective) for objective in problems["e.6"].objectives(boxes)]
    assert written[2:5] == [
        "(on green yellow) (on yellow tab1) (on red blue) (on blue tab2)"
        " (on purple orange) (on orange tray)",
        "(on red tray) (on green tray) (on blue tray) (on yellow tray)"
        " (on purple tab2) (on orange tab1)",
        "(on red orange) (on green purple) (on blue tray) (on yellow tray)"
        " (on purple tab2) (on orange tab1)",
    ]
    ten = generate("e10", 1, 0, "x").scenes[0].symbols.boxes
    for objective in problems["e.10"].objectives(ten):
        assert {goal.symbols[0] for goal in objective} == set(ten)
