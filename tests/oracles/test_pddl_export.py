"""The exported PDDL against Fast Downward, which shares nothing with the search."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import up_fast_downward

from guided_lgp.cli import main
from guided_lgp.domains import domain_names, load_domain
from guided_lgp.errors import InputError
from guided_lgp.logic import (
    Objective,
    State,
    Symbols,
    applicable_actions,
    parse_skeleton,
    progress,
    satisfied,
    successor,
)
from guided_lgp.logic.objectives import all_goals, contradiction
from guided_lgp.logic.pddl import domain_text, problem_text, read_plan
from guided_lgp.search.tree import StateSpace, distances

DRIVER = Path(up_fast_downward.__file__).parent / "downward" / "fast-downward.py"


def symbols_of(name: str) -> Symbols:
    return load_domain(name).symbols(
        gripper=("pr2L", "pr2R"), box=("red", "green", "blue"), table=("tab1", "tab2")
    )


def shortest_plan(state: State, objective: Objective, symbols: Symbols, folder: Path) -> str | None:
    """By blind search, which is optimal with axioms, too; None if there is no plan."""
    domain, problem, plan = (folder / name for name in ("domain.pddl", "problem.pddl", "plan"))
    domain.write_text(domain_text(symbols.domain))
    problem.write_text(problem_text(state, objective, symbols))
    plan.unlink(missing_ok=True)
    files = ["--plan-file", str(plan), str(domain), str(problem)]
    command = [sys.executable, str(DRIVER), *files, "--search", "astar(blind())"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 11, 12), done.stdout[-2000:] + done.stderr
    return plan.read_text() if plan.exists() else None


@pytest.mark.parametrize("name", domain_names())
@pytest.mark.parametrize("reduced", [False, True])
def test_shortest_lengths_and_plans(name: str, reduced: bool, tmp_path: Path) -> None:
    symbols, rng = symbols_of(name), np.random.default_rng(4)
    if reduced:
        symbols = symbols.restricted(table=("tab2",))
    goals = all_goals(symbols)
    solved = 0
    for _ in range(6):
        state = symbols.domain.state(dict.fromkeys(symbols.boxes, "tab1"))
        for _ in range(rng.integers(8)):
            actions = applicable_actions(state, symbols)
            state = successor(state, actions[rng.integers(len(actions))])
        chosen = rng.choice(len(goals), size=rng.integers(1, 4), replace=False)
        objective = tuple(goals[index] for index in chosen)
        if contradiction(objective, symbols):
            continue
        space = StateSpace(symbols, state)
        space.explore()
        length = distances(space, objective).get(0)
        text = shortest_plan(state, objective, symbols, tmp_path)
        assert (text is None) == (length is None)
        if text is not None:
            plan = read_plan(text, symbols)
            assert len(plan) == length
            assert satisfied(progress(state, plan), objective)
            solved += 1
    assert solved > 2


def test_a_plan_with_hand_overs_is_read(tmp_path: Path) -> None:
    """One gripper's box has to get into the other, which a hand-over does in one action."""
    symbols = symbols_of("handover")
    text = "(grasp pr2l red)\n(take pr2r pr2l red) ; comment\n; cost = 2 (unit cost)\n"
    assert read_plan(text, symbols) == parse_skeleton("(grasp pr2L red) (take pr2R pr2L red)")


def test_the_command_writes_both_files(tmp_path: Path) -> None:
    scene = Path(__file__).parents[2] / "examples/three_boxes.json"
    goals = ["--goal", "(on red green)", "--goal", "(held blue)"]
    with pytest.raises(SystemExit) as ended:
        main(["pddl", str(scene), *goals, "--folder", str(tmp_path)])
    assert not ended.value.code
    assert (tmp_path / "domain.pddl").read_text() == domain_text(load_domain())
    problem = (tmp_path / "problem.pddl").read_text()
    assert "(:goal (and (on red green) (held blue)))" in problem


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("(grasp pr2l pink)", "unknown symbol 'pink'"),
        ("(push pr2l red)", "is not an action"),
        ("(grasp pr2l)", "is not an action"),
        ("grasp pr2l red", "is not an action"),
    ],
)
def test_bad_plans_are_refused(text: str, fault: str) -> None:
    with pytest.raises(InputError, match=fault):
        read_plan(text, symbols_of("pick_and_place"))


def test_names_that_pddl_cannot_tell_apart() -> None:
    symbols = load_domain().symbols(gripper=("arm",), box=("Red", "red"), table=("tab1",))
    with pytest.raises(InputError, match="differ in case only"):
        problem_text(load_domain().state({"Red": "tab1", "red": "tab1"}), (), symbols)
