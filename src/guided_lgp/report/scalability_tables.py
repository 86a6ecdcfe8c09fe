"""Tables on scalability: Table III beside the paper's, and its details."""

from collections.abc import Mapping

from guided_lgp.experiments.problems import ProblemClass
from guided_lgp.report import paper
from guided_lgp.report.cells import NONE, number, search_time, solved_suffix, spread
from guided_lgp.report.inputs import all_solved, compared
from guided_lgp.report.metrics import Metrics
from guided_lgp.report.table import Table
from guided_lgp.search.planners import TABLE_3


def scalability(metrics: Metrics, timing: Metrics) -> list[Table]:
    """Who wins where; Table III beside the paper's; its details.

    Args:
        metrics: by problem and planner.
        timing: as ``metrics``.
    """
    return [
        winners(metrics, timing),
        _comparison("tree_size", metrics, metrics),
        _comparison("time", metrics, timing),
        _details(metrics, timing),
    ]


def _planners(metrics: Metrics) -> list[str]:
    return [name for name in TABLE_3 if any(name in row for row in metrics.values())]


def label(problem: ProblemClass) -> str:
    """The problem's name, starred as in the paper."""
    return f"{problem.name}*" if problem.reduced else problem.name


_QUANTITIES = {
    "tree_size": ("Table III. Tree size (nodes)", "tree_size_mean", "tree_size_std"),
    "time": ("Table III. Time to the first plan (s)", "time_mean_s", "time_std_s"),
}


def _comparison(quantity: str, metrics: Metrics, figures: Metrics) -> Table:
    title, mean, std = _QUANTITIES[quantity]
    problems = compared(metrics)
    printed_n = {problem.name: str(problem.objectives) for problem in paper.PROBLEMS}
    rows = [
        ("Problems n", "paper", *(printed_n.get(problem.name, "") for problem in problems)),
        ("Problems n", "ours", *(_count(metrics[problem.name]) for problem in problems)),
    ]
    records = []
    for planner in _planners(metrics):
        if planner in paper.PLANNERS:
            cells = []
            for problem in problems:
                printed = paper.SCALABILITY.get(problem.name)
                cell = (printed or {}).get(planner, {})
                cells.append("" if printed is None else spread(cell.get(mean), cell.get(std)))
                records.append(_record(problem, planner, "paper", cell.get(mean), cell.get(std)))
            rows.append((TABLE_3[planner].label, "paper", *cells))
        cells = []
        for problem in problems:
            cell = metrics[problem.name].get(planner)
            if cell is None:
                cells.append("")
                continue
            shown = figures[problem.name][planner]
            cells.append(spread(shown[mean], shown[std]) + solved_suffix(cell))
            records.append(
                _record(problem, planner, "ours", shown[mean], shown[std])
                | {"n": cell["problems"], "solved": cell["problems_solved"]}
            )
        rows.append((TABLE_3[planner].label, "ours", *cells))
    groups: dict[str, int] = {}
    for problem in problems:
        heading = f"K = {problem.k_min}"
        groups[heading] = groups.get(heading, 0) + 1
    return Table(
        f"table_3_{quantity}",
        title,
        ("Planner", "Source", *map(label, problems)),
        tuple(rows),
        (
            "Mean ± standard deviation over the problems solved. K: smallest number of actions. "
            "n: problems given to each planner, objectives × configurations (one in the paper). "
            f"(k/n): k of n solved. {NONE}: stopped at the limit of the tree size on at least one "
            "problem, or none solved. *: reduced branching factor for planners without a policy, "
            "as for the paper's breadth-first. Graph breadth-first merges equal states. Guided: "
            "the paper's networks.",
        ),
        (("", 2), *groups.items()),
        labels=2,
        records=records,
    )


def _count(cells: Metrics) -> str:
    return "/".join(map(str, sorted({cell["problems"] for cell in cells.values()})))


def _record(
    problem: ProblemClass, planner: str, source: str, mean: float | None, std: float | None
) -> dict[str, object]:
    return {
        "problem": problem.name,
        "k_min": problem.k_min,
        "planner": planner,
        "source": source,
        "mean": mean,
        "std": std,
    }


def _details(metrics: Metrics, timing: Metrics) -> Table:
    rows, records = [], []
    parts = ("symbolic_s", "policy_s", "coarse_s", "path_s")
    for problem in compared(metrics):
        for planner in _planners(metrics):
            cell = metrics[problem.name].get(planner)
            if cell is None:
                continue
            times = timing[problem.name][planner]
            rows.append(
                (
                    label(problem),
                    TABLE_3[planner].label,
                    f"{cell['problems_solved']}/{cell['problems']}",
                    number(cell["plan_length_mean"]),
                    number(cell["policy_calls_mean"]),
                    number(cell["coarse_calls_mean"]),
                    number(cell["infeasible_calls_mean"]),
                    number(cell["failed_candidates_mean"]),
                    number(cell["path_calls_mean"]),
                    *(number(times[part], 3) for part in parts),
                    number(search_time(times), 3),
                    number(times["peak_rss_mb"], 0),
                )
            )
            records.append({"problem": problem.name, "planner": planner, **cell, **times})
    return Table(
        "table_3_details",
        "Scalability in detail: plans, parts of the time, memory",
        (
            "Problem",
            "Planner",
            "Solved",
            "Plan length",
            "Policy calls",
            "Coarse calls",
            "Infeasible",
            "Failed candidates",
            "Path calls",
            "Symbolic (s)",
            "Policy (s)",
            "Coarse (s)",
            "Path (s)",
            "Without path (s)",
            "Peak (MB)",
        ),
        tuple(rows),
        (
            "Means over the problems solved. Calls count whether or not the verdict was known from "
            "another planner. Infeasible: coarse calls with a verdict against the sequence. Failed "
            "candidates: sequences that reach the goals and that a bound refused. Without path: "
            "symbolic, policy and coarse. Peak: resident memory of the process, libraries "
            "included.",
        ),
        labels=2,
        records=records,
    )


_NAMED = 3
"""How many planners that share a place are named."""


def winners(metrics: Metrics, timing: Metrics) -> Table:
    """Who wins where: of the planners that solve all problems of a class, the first in each figure.

    Args:
        metrics: by problem and planner.
        timing: as ``metrics``.
    """
    rows = []
    for problem in compared(metrics):
        cells = metrics[problem.name]
        complete = [name for name in TABLE_3 if name in cells and all_solved(cells[name])]
        nodes = {name: cells[name]["tree_size_mean"] for name in complete}
        seconds = {name: search_time(timing[problem.name][name]) for name in complete}
        rows.append(
            (
                problem.name,
                str(problem.k_min),
                f"{len(complete)} of {len(cells)}",
                _first(nodes, 1),
                _first({name: value for name, value in seconds.items() if value is not None}, 2),
            )
        )
    return Table(
        "winners",
        "Who wins where",
        ("Problem", "K", "Planners that solve all", "Fewest nodes", "Least time to search (s)"),
        tuple(rows),
        (
            "Means over the problems of a class, among the planners that solve all of them; equal "
            "figures share the place. Time to search: symbolic, policy and coarse time, without "
            "the path bound.",
        ),
        labels=1,
    )


def _first(figures: Mapping[str, float], decimals: int) -> str:
    """The smallest figure as it is printed, and all who have it."""
    if not figures:
        return "–"
    least = number(min(figures.values()), decimals)
    names = [
        TABLE_3[name].label for name, value in figures.items() if number(value, decimals) == least
    ]
    return f"{'; '.join(names) if len(names) <= _NAMED else f'{len(names)} planners'}: {least}"
