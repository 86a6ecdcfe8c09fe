"""Tables I and III from rows worked out by hand."""

from typing import Any

import pytest

from guided_lgp.experiments import compare_scalability, evaluate_generalization


def generalization_row(planner: str, outcome: str, **changes: Any) -> dict[str, Any]:
    figures = {
        "unseen": False,
        "shortest_length": 2,
        "shortest_has_path": True,
        "reattempts_infeasible": 0,
        "reattempts_max_depth": 0,
    }
    return {"planner": planner, "outcome": outcome} | figures | changes


def test_table_one() -> None:
    rows = [
        generalization_row("default", "shortest"),
        generalization_row("default", "shortest", unseen=True, reattempts_infeasible=2),
        generalization_row("default", "feasible", unseen=True, reattempts_max_depth=1),
        generalization_row("default", "no_solution", shortest_length=None, shortest_has_path=None),
        generalization_row("default", "trivial", unseen=True),
    ]
    metrics = evaluate_generalization.summarize(rows)
    assert metrics["default"]["all"] == {
        "n": 4,
        "trivial": 0.2,
        "shortest": 0.5,
        "feasible": 0.25,
        "no_solution": 0.25,
        "reattempt_infeasible": 0.25,
        "reattempt_max_depth": 0.25,
        "unsolvable": 0.25,
        "shortest_without_path": 0.0,
    }
    unseen = metrics["default"]["unseen"]
    assert (unseen["n"], unseen["shortest"], unseen["trivial"]) == (2, 0.5, pytest.approx(1 / 3))
    assert list(metrics) == [
        "default",
        "adaptation",
        "best_first",
        "improved_default",
        "improved_adaptation",
        "improved_best_first",
        "relational",
        "relational_best_first",
        "uniform_best_first",
    ]


def scalability_row(objective: str, solved: bool, size: int, **times: float) -> dict[str, Any]:
    return {
        "problem": "a.1",
        "planner": "guided",
        "objective": objective,
        "solved": solved,
        "tree_size": size,
        "length": 4 if solved else None,
        "time_s": sum(times.values()),
        "peak_rss_mb": float(size),
        **dict.fromkeys(compare_scalability.COUNTS, size // 10),
        **{f"{part}_s": times.get(part, 0.0) for part in ("symbolic", "policy", "coarse", "path")},
    }


def test_table_three() -> None:
    rows = [
        scalability_row("(on red green)", True, 20, coarse=1.0, path=1.0),
        scalability_row("(on red green)", True, 30, coarse=2.0, path=2.0),
        scalability_row("(on green red)", True, 40, policy=3.0),
        scalability_row("(on green red)", False, 400, coarse=9.0),
    ]
    cell = compare_scalability.summarize(rows)["a.1"]["guided"]
    assert (cell["objectives"], cell["solved"]) == (2, 1)
    assert (cell["problems"], cell["problems_solved"]) == (4, 3)
    assert cell["tree_size_mean"] == 30
    assert cell["tree_size_std"] == pytest.approx((200 / 3) ** 0.5)
    assert cell["plan_length_mean"] == 4
    means = (cell[f"{count}_mean"] for count in compare_scalability.COUNTS)
    assert set(means) == {3}
    times = compare_scalability.summarize_times(rows)["a.1"]["guided"]
    assert times["time_mean_s"] == 3
    assert times["coarse_s"] == 1
    assert times["policy_s"] == 1
    assert times["peak_rss_mb"] == 400


def test_nothing_solved_is_no_number() -> None:
    rows = [scalability_row("(on red green)", False, 400)]
    cell = compare_scalability.summarize(rows)["a.1"]["guided"]
    assert cell["solved"] == 0
    assert cell["tree_size_mean"] is None
