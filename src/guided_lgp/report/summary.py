"""About ten figures that say whether one execution of the pipeline is better than another."""

from collections.abc import Mapping
from statistics import fmean

from guided_lgp.report import paper
from guided_lgp.report.inputs import Inputs, compared
from guided_lgp.report.metrics import Metrics
from guided_lgp.search.planners import BEST, PAPERS

PLANNERS = (PAPERS, BEST)
"""Of Table III: the paper's, and the one that ``plan`` uses first."""


def summary(inputs: Inputs) -> dict[str, dict[str, float]]:
    """The figures that ``dvc exp show`` and ``dvc metrics diff`` compare, by group.

    ``accuracy`` is the mean over the sub-policies of a network; ``shortest`` and ``unseen`` are
    shares of problems with a shortest plan, of all objectives and of the unseen ones; ``solved`` is
    the share of the problems of Table III that got a plan, and ``coarse_calls`` the verdicts of the
    coarse bound per action of such a plan.
    """
    return {
        "accuracy": _accuracy(inputs.training),
        "shortest": _shortest(inputs.generalization, "all"),
        "unseen": _shortest(inputs.generalization, "unseen"),
        "solved": {row.name: _solved(inputs.scalability, row.name) for row in PLANNERS},
        "coarse_calls": {row.name: _calls(inputs.scalability, row.name) for row in PLANNERS},
    }


def _accuracy(training: Mapping[str, Mapping[str, Metrics]]) -> dict[str, float]:
    networks = {**training[PAPERS.policy], **training.get(BEST.policy, {})}
    return {
        network: fmean(sub_policy["accuracy"] for sub_policy in report["sub_policies"].values())
        for network, report in networks.items()
    }


def _shortest(generalization: Metrics, subset: str) -> dict[str, float]:
    planners = (*paper.GENERALIZATION, BEST.table_1)
    return {
        name: generalization[name][subset]["shortest"]
        for name in planners
        if name in generalization
    }


def _cells(scalability: Metrics, planner: str) -> list[Metrics]:
    rows = (scalability[problem.name] for problem in compared(scalability))
    return [row[planner] for row in rows if planner in row]


def _solved(scalability: Metrics, planner: str) -> float:
    cells = _cells(scalability, planner)
    solved, given = (sum(cell[key] for cell in cells) for key in ("problems_solved", "problems"))
    return float(solved / given) if given else 0.0


def _calls(scalability: Metrics, planner: str) -> float:
    cells = [c for c in _cells(scalability, planner) if c["coarse_calls_mean"] is not None]
    ratios = [cell["coarse_calls_mean"] / cell["plan_length_mean"] for cell in cells]
    return fmean(ratios) if ratios else 0.0
