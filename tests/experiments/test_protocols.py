"""The protocols on one configuration, with scripted bounds and a hand-made policy."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pytest

from guided_lgp.bounds.results import Array
from guided_lgp.experiments import compare_scalability, evaluate_generalization, policies
from guided_lgp.logic import (
    Action,
    Objective,
    State,
    Symbols,
    format_objective,
    one_goal_objectives,
    parse_skeleton,
    progress,
    satisfied,
    two_goal_objectives,
)
from guided_lgp.params import Params, load_params
from guided_lgp.scene import generate
from guided_lgp.search.enumerate import enumerate_sequences
from guided_lgp.search.planners import GUIDED
from stand_ins import NothingOnBlue


class Sensible:
    """Prefers to grasp what must move and to put it where it belongs, supports first."""

    def log_probabilities(
        self,
        objective: Objective,
        state: State,
        symbols: Symbols,
        positions: Mapping[str, Array],
        actions: Sequence[Action],
    ) -> Array:
        goals = [goal for goal in objective if not state.satisfies(goal)]
        waiting = {goal.symbols[0] for goal in goals}
        scores = np.zeros(len(actions))
        for row, action in enumerate(actions):
            for goal in goals:
                under = not waiting.isdisjoint(goal.symbols[1:])
                if action.symbols[1:] == goal.symbols:
                    scores[row] = 5.0 - 2.0 * under
                elif action.symbols[1] == goal.symbols[0] and action.instruction == "grasp":
                    scores[row] = 3.0 - 2.0 * under
        return scores - np.log(np.exp(scores).sum())


@pytest.fixture
def params(monkeypatch: pytest.MonkeyPatch) -> Params:
    for module in (compare_scalability, evaluate_generalization):
        monkeypatch.setattr(module, "SceneBounds", NothingOnBlue)
    monkeypatch.setattr(policies, "load_policy", lambda name, directory: Sensible())
    return load_params(Path(__file__).parents[2] / "params.yaml")


def test_generalization(params: Params, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = generate("a", 1, 3, "test").scenes[0]
    symbols = scene.symbols
    objectives = one_goal_objectives(symbols) + two_goal_objectives(symbols)
    found = enumerate_sequences(
        scene.state, symbols, objectives, NothingOnBlue(scene, params.bounds), 4
    )
    seen = tuple(two_goal_objectives(symbols)[:40])
    limits = params.evaluate_generalization.model_copy(
        update={"max_depth": 4, "max_tree_size": 150, "max_paths": 3}
    )
    rows = evaluate_generalization.evaluate(
        evaluate_generalization.Task(
            scene,
            seen,
            {format_objective(objective): length for objective, length in found.shortest.items()},
            tuple(" ".join(map(str, v.skeleton)) for v in found.verdicts if v.feasible),
            params.bounds,
            limits,
            Path("models"),
        )
    )
    assert len(rows) == 9 * 87
    assert sum(row["unseen"] for row in rows) == 9 * 47
    by_text = {format_objective(objective): objective for objective in objectives}
    for row in rows:
        objective = by_text[row["objective"]]
        tables = {name for goal in objective for name in goal.symbols[1:]}
        if satisfied(scene.state, objective):
            assert row["outcome"] == "trivial"
        elif "blue" in tables:
            assert (row["outcome"], row["shortest_length"]) == ("no_solution", None)
        elif "green" in tables:
            assert (row["outcome"], row["shortest_has_path"]) == ("no_solution", False)
        else:
            assert row["shortest_has_path"]
            assert satisfied(progress(scene.state, parse_skeleton(row["skeleton"])), objective)
            assert (row["outcome"] == "shortest") == (row["length"] == row["shortest_length"])
    metrics = evaluate_generalization.summarize(rows)
    assert metrics["best_first"]["all"]["unsolvable"] > 0
    assert metrics["best_first"]["all"]["shortest_without_path"] > 0
    for figures in metrics["adaptation"].values():
        assert figures["shortest"] + figures["feasible"] + figures["no_solution"] == pytest.approx(
            1
        )


def test_scalability(params: Params) -> None:
    scene = generate("b", 1, 3, "scalability-b").scenes[0]
    rows = compare_scalability.compare(
        compare_scalability.Task(
            "b.1", scene, params.bounds, params.compare_scalability, Path("models")
        )
    )
    unguided = ["breadth_first", "breadth_first_graph", "astar"]
    planners = [*GUIDED, "uniform_best_first", *unguided]
    assert [row["planner"] for row in rows] == 8 * planners
    cells = compare_scalability.summarize(rows)["b.1"]
    times = compare_scalability.summarize_times(rows)["b.1"]
    for planner in planners:
        assert (cells[planner]["objectives"], cells[planner]["solved"]) == (8, 8)
        assert cells[planner]["plan_length_mean"] == 6
        assert cells[planner]["policy_calls_mean"] == 6 * (planner not in unguided)
        assert times[planner]["path_s"] == 2.0  # a known verdict costs what it cost at first
        assert times[planner]["coarse_s"] >= 6 * 0.5
    # Reduced branching, levels 1 to 5 complete: 1 + 6 + 24 + 120 + 480 + 2400 nodes.
    assert 3031 < cells["breadth_first"]["tree_size_mean"] < 3031 + 9600
    assert cells["guided"]["tree_size_mean"] < 50
