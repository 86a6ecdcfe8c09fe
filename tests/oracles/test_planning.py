"""Symbolic planning against pyperplan, and plans against the validator of unified-planning."""

import logging
from pathlib import Path

import numpy as np
import pddl
import pytest
from pyperplan.planner import search_plan
from pyperplan.search import breadth_first_search
from unified_planning.engines import ValidationResultStatus
from unified_planning.io import PDDLReader
from unified_planning.model import FNode
from unified_planning.shortcuts import PlanValidator, Problem, get_environment

from guided_lgp.domains import load_domain
from guided_lgp.errors import InputError
from guided_lgp.logic import (
    Goal,
    Objective,
    State,
    Symbols,
    applicable_actions,
    progress,
    satisfied,
    successor,
    validate_objective,
)
from guided_lgp.logic.objectives import all_goals
from guided_lgp.logic.strips import facts, goal_facts, relaxed_operators
from guided_lgp.search.landmark_cut import LandmarkCut
from guided_lgp.search.tree import StateSpace, distances

GRIPPERS = ("pr2L", "pr2R")
THREE = load_domain().symbols(
    gripper=GRIPPERS, box=("red", "green", "blue"), table=("tab1", "tab2")
)
FOUR = load_domain().symbols(
    gripper=GRIPPERS, box=("red", "green", "blue", "yellow"), table=("tab1", "tab2", "tray")
)
PAIRS = {THREE: 190, FOUR: 10}


def random_pair(symbols: Symbols, rng: np.random.Generator) -> tuple[State, Objective]:
    """A state after a random walk and a valid objective of one to three goals."""
    goals: list[Goal] = all_goals(symbols)
    while True:
        state = load_domain().state(dict.fromkeys(symbols.boxes, "tab1"))
        for _ in range(rng.integers(12)):
            actions = list(applicable_actions(state, symbols))
            state = successor(state, actions[rng.integers(len(actions))])
        chosen = rng.choice(len(goals), size=rng.integers(1, 4), replace=False)
        objective = tuple(goals[index] for index in chosen)
        try:
            validate_objective(objective, symbols, state)
        except InputError:
            continue
        return state, objective


def validated_task(
    template: Problem, state: State, objective: Objective, symbols: Symbols
) -> Problem:
    """The problem as parsed by unified-planning, with another start and another goal."""

    def expression(fact: list[str]) -> FNode:
        name, *arguments = fact
        return template.fluent(name)(*map(template.object, arguments))

    task = template.clone()
    for fluent in template.initial_values:
        task.set_initial_value(fluent, False)
    for fact in pddl.initial_facts(state, symbols):
        task.set_initial_value(expression(fact), True)
    task.clear_goals()
    for fact in pddl.goal_facts(objective):
        task.add_goal(expression(fact))
    return task


@pytest.mark.parametrize("symbols", PAIRS, ids=["three", "four"])
def test_minimal_lengths_and_plans(symbols: Symbols, tmp_path: Path) -> None:
    logging.disable(logging.INFO)
    get_environment().credits_stream = None
    rng = np.random.default_rng(20)
    domain, problem = tmp_path / "domain.pddl", tmp_path / "problem.pddl"
    domain.write_text(pddl.domain(symbols))
    operators = relaxed_operators(symbols)
    reader = PDDLReader()
    state, objective = random_pair(symbols, rng)
    template = reader.parse_problem_string(
        domain.read_text(), pddl.problem(state, objective, symbols)
    )
    for _ in range(PAIRS[symbols]):
        state, objective = random_pair(symbols, rng)
        problem.write_text(pddl.problem(state, objective, symbols))

        oracle = search_plan(str(domain), str(problem), breadth_first_search, None)
        space = StateSpace(symbols, state)
        space.explore()
        to_go = distances(space, objective)
        assert len(oracle) == to_go[0]
        landmark_cut = LandmarkCut(goal_facts(objective, symbols), operators)
        assert landmark_cut(facts(state, symbols)) <= to_go[0]

        theirs = [pddl.action(operator.name, symbols) for operator in oracle]
        assert satisfied(progress(state, theirs), objective)

        steps = []
        number = 0
        while to_go[number]:
            action, target = next(
                (action, target)
                for action, target in space.transitions(number)
                if to_go.get(target) == to_go[number] - 1
            )
            steps.append(pddl.step(space.state(number), action, symbols))
            number = target
        task = validated_task(template, state, objective, symbols)
        plan = reader.parse_plan_string(task, "\n".join(steps))
        with PlanValidator(name="sequential_plan_validator") as validator:
            assert validator.validate(task, plan).status == ValidationResultStatus.VALID
    logging.disable(logging.NOTSET)
