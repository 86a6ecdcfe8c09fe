"""The figures that the paper prints, under the key names of our own metrics."""

from dataclasses import dataclass

from guided_lgp.search.planners import TABLE_3


@dataclass(frozen=True)
class Problem:
    """A row of Table II."""

    name: str
    target: str
    objectives: int
    k_min: int
    """Smallest number of high-level actions that solves it."""
    reduced: bool = False
    """Whether breadth-first is granted a reduced branching factor (starred in the paper)."""


PROBLEMS = (
    Problem("a.1", "Stack boxes on table", 9, 4),
    Problem("b.1", "Place boxes on tray/tab2", 8, 6, reduced=True),
    Problem("b.2", "Stack boxes on tray", 6, 6),
    Problem("c.1", "Place boxes on tray/tab2", 6, 8, reduced=True),
    Problem("c.2", "Stack boxes on tray", 6, 8),
    Problem("d.1", "Place boxes on tray/other table", 6, 10, reduced=True),
    Problem("d.2", "Stack boxes on tray", 6, 10),
)
"""Table II."""

GENERALIZATION: dict[str, dict[str, dict[str, float]]] = {
    "default": {
        "all": {
            "shortest": 0.919,
            "feasible": 0.081,
            "no_solution": 0.0,
            "reattempt_infeasible": 0.032,
            "reattempt_max_depth": 0.011,
        },
        "unseen": {
            "shortest": 0.903,
            "feasible": 0.097,
            "no_solution": 0.0,
            "reattempt_infeasible": 0.022,
            "reattempt_max_depth": 0.016,
        },
    },
    "adaptation": {
        "all": {
            "shortest": 0.985,
            "feasible": 0.015,
            "no_solution": 0.0,
            "reattempt_infeasible": 0.034,
            "reattempt_max_depth": 0.0,
        },
        "unseen": {
            "shortest": 0.982,
            "feasible": 0.018,
            "no_solution": 0.0,
            "reattempt_infeasible": 0.025,
            "reattempt_max_depth": 0.0,
        },
    },
}
"""Table I, as fractions."""

GENERALIZATION_N = {"all": 20 * 87, "unseen": 20 * 47}
"""Table V: test configurations times objectives."""


def _cell(time_mean: float, time_std: float, tree_mean: float, tree_std: float) -> dict[str, float]:
    return {
        "time_mean_s": time_mean,
        "time_std_s": time_std,
        "tree_size_mean": tree_mean,
        "tree_size_std": tree_std,
    }


PLANNERS = tuple(name for name, planner in TABLE_3.items() if planner.printed)
"""The planners of Table III, under our names."""

SCALABILITY: dict[str, dict[str, dict[str, float]]] = {
    "a.1": {
        "breadth_first": _cell(2.1, 0.8, 400.7, 127.6),
        "guided": _cell(2.7, 0.9, 26.1, 6.0),
    },
    "b.1": {
        "breadth_first": _cell(4.0, 1.1, 3096.0, 41.4),
        "guided": _cell(5.0, 1.0, 48.0, 0.0),
    },
    "b.2": {
        "breadth_first": _cell(8.55, 1.0, 43630.3, 437.5),
        "guided": _cell(3.6, 0.2, 47.0, 0.0),
    },
    "c.1": {
        "breadth_first": _cell(112.3, 8.5, 216682.5, 1998.3),
        "guided": _cell(12.4, 3.2, 101.0, 38.0),
    },
    "c.2": {"guided": _cell(8.5, 3.3, 98.8, 35.8)},
    "d.1": {"guided": _cell(18.0, 5.6, 176.7, 59.9)},
    "d.2": {"guided": _cell(8.3, 1.1, 117.7, 0.5)},
}
"""Table III; a planner that the paper stopped at the limit has no entry."""
