"""The tables of the report, each beside the paper's figures where the paper has any."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from guided_lgp.report import paper
from guided_lgp.report.inputs import Metrics
from guided_lgp.report.style import NETWORKS, PLANNERS, VARIANTS
from guided_lgp.report.table import Table

NONE = "–"
"""Stands where there is no figure."""

_ROWS = {
    "shortest": "Shortest solution",
    "feasible": "Feasible solution",
    "no_solution": "No solution",
    "reattempt_infeasible": "Reattempts: infeasible solution",
    "reattempt_max_depth": "Reattempts: maximum depth",
    "unsolvable": "No feasible sequence exists",
    "shortest_without_path": "No shortest sequence has a path",
}
_SETS = {"all": "all", "unseen": "unseen"}


def percent(fraction: float | None) -> str:
    """A fraction as a percentage with one decimal."""
    return NONE if fraction is None or math.isnan(fraction) else f"{100 * fraction:.1f}%"


def number(value: float | None, decimals: int = 1) -> str:
    """A number with a fixed number of decimals and thin groups of thousands."""
    return NONE if value is None or math.isnan(value) else f"{value:,.{decimals}f}"


def spread(mean: float | None, std: float | None, decimals: int = 1) -> str:
    """Mean and standard deviation."""
    if mean is None or math.isnan(mean):
        return NONE
    return f"{number(mean, decimals)} ± {number(std, decimals)}"


def generalization(metrics: Metrics) -> Table:
    """Table I: shares of problems by outcome, paper and ours, all and unseen objectives."""
    variants = [name for name in VARIANTS if name in metrics]
    groups: list[tuple[str, int]] = [("", 1)]
    columns = ["Share of problems"]
    sources: list[tuple[str, str, str]] = []
    for variant in variants:
        origins = ("paper", "ours") if variant in paper.GENERALIZATION else ("ours",)
        groups.append((VARIANTS[variant], 2 * len(origins)))
        for subset in _SETS:
            for origin in origins:
                columns.append(f"{_SETS[subset]}, {origin}")
                sources.append((variant, subset, origin))

    def cell(key: str, variant: str, subset: str, origin: str) -> Any:
        figures = paper.GENERALIZATION if origin == "paper" else metrics
        return figures[variant][subset].get(key)

    rows = [
        (label, *(percent(cell(key, *source)) for source in sources))
        for key, label in _ROWS.items()
    ]
    rows.append(
        (
            "Problems n",
            *(
                str(
                    paper.GENERALIZATION_N[subset] if origin == "paper" else metrics[v][subset]["n"]
                )
                for v, subset, origin in sources
            ),
        )
    )
    records = [
        {"planner": v, "objectives": s, "source": o}
        | {key: cell(key, v, s, o) for key in _ROWS}
        | {"n": paper.GENERALIZATION_N[s] if o == "paper" else metrics[v][s]["n"]}
        for v, s, o in sources
    ]
    return Table(
        "table_1",
        "Table I. Generalizability over all and unseen objectives",
        tuple(columns),
        tuple(rows),
        (
            "A shortest solution has the minimal number of actions that exhaustive enumeration "
            "finds feasible. Ours are shares of the n problems that are not satisfied at the "
            "start; the paper's n is its number of configurations times objectives. Reattempts: "
            "problems with at least one for that cause. A problem counts as without a feasible "
            "sequence if the enumeration found none up to its longest length.",
        ),
        tuple(groups),
        records=records,
    )


def scalability(metrics: Metrics, timing: Metrics) -> list[Table]:
    """Table III: tree size and time of every planner beside the paper's, then the details."""
    return [
        _comparison("tree_size", metrics, metrics),
        _comparison("time", metrics, timing),
        _details(metrics, timing),
    ]


def _planners(metrics: Metrics) -> list[str]:
    return [name for name in PLANNERS if any(name in row for row in metrics.values())]


def _problems(metrics: Metrics) -> list[paper.Problem]:
    return [problem for problem in paper.PROBLEMS if problem.name in metrics]


_QUANTITIES = {
    "tree_size": ("Table III. Tree size (nodes)", "tree_size_mean", "tree_size_std", 1),
    "time": ("Table III. Time to the first plan (s)", "time_mean_s", "time_std_s", 2),
}


def _comparison(quantity: str, metrics: Metrics, figures: Metrics) -> Table:
    title, mean, std, decimals = _QUANTITIES[quantity]
    planners = _planners(metrics)
    groups: list[tuple[str, int]] = [("", 2), ("n", 2)]
    columns = ["Problem", "K_min", "paper", "ours"]
    for planner in planners:
        origins = ["paper", "ours"] if planner in paper.PLANNERS else ["ours"]
        groups.append((PLANNERS[planner], len(origins)))
        columns += origins
    rows, records = [], []
    for problem in _problems(metrics):
        row = []
        counts = {cell["problems"] for cell in metrics[problem.name].values()}
        for planner in planners:
            if planner in paper.PLANNERS:
                printed = paper.SCALABILITY[problem.name].get(planner, {})
                row.append(spread(printed.get(mean), printed.get(std), decimals))
                records.append(
                    _record(problem, planner, "paper", printed.get(mean), printed.get(std))
                    | {"n": problem.objectives}
                )
            cell = metrics[problem.name].get(planner)
            if cell is None:
                row.append("")
                continue
            shown = figures[problem.name][planner]
            solved, n = cell["problems_solved"], cell["problems"]
            partial = "" if solved == n else f" ({solved}/{n})"
            row.append(spread(shown[mean], shown[std], decimals) + partial)
            records.append(
                _record(problem, planner, "ours", shown[mean], shown[std])
                | {"n": n, "solved": solved}
            )
        n = "/".join(map(str, sorted(counts)))
        rows.append((problem.label, str(problem.k_min), str(problem.objectives), n, *row))
    return Table(
        f"table_3_{quantity}",
        title,
        tuple(columns),
        tuple(rows),
        (
            "Mean ± standard deviation over the problems solved. n: problems given to each "
            "planner, objectives × configurations (one in the paper). (k/n): k of n solved. "
            f"{NONE}: stopped at the limit of the tree size on at least one problem, or none "
            "solved. "
            "*: reduced branching factor for breadth-first, as in the paper.",
        ),
        tuple(groups),
        labels=1,
        records=records,
    )


def _record(
    problem: paper.Problem, planner: str, source: str, mean: float | None, std: float | None
) -> dict[str, object]:
    return {
        "problem": problem.name,
        "k_min": problem.k_min,
        "planner": planner,
        "source": source,
        "mean": mean,
        "std": std,
    }


def search_time(times: Metrics) -> float | None:
    """Mean time (s) of a search without the path bound: symbolic, policy and coarse."""
    parts = [times[part] for part in ("symbolic_s", "policy_s", "coarse_s")]
    return None if None in parts else float(sum(parts))


def _details(metrics: Metrics, timing: Metrics) -> Table:
    rows, records = [], []
    parts = ("symbolic_s", "policy_s", "coarse_s", "path_s")
    for problem in _problems(metrics):
        for planner in _planners(metrics):
            cell = metrics[problem.name].get(planner)
            if cell is None:
                continue
            times = timing[problem.name][planner]
            rows.append(
                (
                    problem.label,
                    PLANNERS[planner],
                    f"{cell['problems_solved']}/{cell['problems']}",
                    number(cell["plan_length_mean"]),
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
            "Symbolic (s)",
            "Policy (s)",
            "Coarse (s)",
            "Path (s)",
            "Without path (s)",
            "Peak (MB)",
        ),
        tuple(rows),
        (
            "Means over the problems solved; without path: symbolic, policy and coarse. Peak: "
            "resident memory of the process, libraries included.",
        ),
        labels=2,
        records=records,
    )


def training_metrics(reports: Metrics) -> dict[str, dict[str, dict[str, object]]]:
    """Accuracy, loss (nats) and epochs by network and sub-policy, for both choices of validation.

    Args:
        reports: by network, what its training wrote.
    """
    keys = ("accuracy", "loss", "epochs", "best_epoch")
    return {
        network: {
            name: {
                **{key: figures[key] for key in keys},
                "samples": report["samples"],
                "by_configuration": {key: figures["by_configuration"][key] for key in keys},
            }
            for name, figures in report["sub_policies"].items()
        }
        for network, report in reports.items()
    }


def training(metrics: Metrics) -> Table:
    """Accuracy, loss and epochs of every sub-policy; see :func:`training_metrics`."""
    rows, records = [], []
    for network, sub_policies in metrics.items():
        for name, figures in sub_policies.items():
            held_out = figures["by_configuration"]
            rows.append(
                (
                    NETWORKS[network],
                    name,
                    f"{figures['samples']:,}",
                    *(
                        text
                        for split in (figures, held_out)
                        for text in (
                            percent(split["accuracy"]),
                            number(split["loss"], 3),
                            f"{split['best_epoch']}/{split['epochs']}",
                        )
                    ),
                )
            )
            for validation, split in (("random", figures), ("configuration", held_out)):
                values = {key: split[key] for key in ("accuracy", "loss", "epochs", "best_epoch")}
                records.append(
                    {"network": network, "sub_policy": name, "validation": validation}
                    | values
                    | {"samples": figures["samples"]}
                )
    return Table(
        "training",
        "Training of the hierarchical policy",
        ("Network", "Sub-policy", "Samples n", *(2 * ("Accuracy", "Loss", "Epoch"))),
        tuple(rows),
        (
            "Accuracy and loss (nats) on the validation samples at the best epoch, of the epochs "
            "trained; previous decisions of the chain are the true ones. Weights are those of "
            "the random choice of validation samples, as in the paper; whole configurations held "
            "out show what copies of a sample on both sides hide. Several actions are right in "
            "most states, which bounds both figures.",
        ),
        (("", 3), ("Random samples (paper)", 3), ("Whole configurations", 3)),
        labels=2,
        records=records,
    )


def enumeration(lengths: Sequence[Metrics], rejected: Mapping[str, tuple[int, int]]) -> Table:
    """Verdicts of the coarse bound by number of actions.

    Args:
        lengths: each with split, length, n, infeasible_share.
        rejected: by set of scenes, configurations kept and rejected by the generator.
    """
    rows = [
        (row["split"], str(row["length"]), f"{row['n']:,}", percent(row["infeasible_share"]))
        for row in lengths
    ]
    counts = ", ".join(
        f"{name.replace('_', ' ')} {kept} ({out} rejected)"
        for name, (kept, out) in rejected.items()
    )
    return Table(
        "enumeration",
        "Exhaustive enumeration: verdicts of the coarse bound",
        ("Configurations", "K", "Sequences n", "Infeasible"),
        tuple(rows),
        (
            "Sequences are those that may end in a state of some objective still unsolved and "
            f"have a feasible prefix. Configurations: {counts}.",
        ),
        records=lengths,
    )


def geometry(metrics: Metrics) -> Table:
    """Quality and speed of the two bounds of the NLP, by number of actions."""
    lengths = sorted((key for key in metrics if key.isdigit()), key=int)
    shown: dict[str, tuple[str, Callable[[Any], str]]] = {
        "coarse_median_ms": ("Coarse bound, median (ms)", lambda v: number(v, 2)),
        "coarse_first_try": ("Coarse bound solved at the first start", percent),
        "false_infeasible": ("Coarse-feasible, not found within the default starts", percent),
        "infeasible_share": ("Coarse-infeasible", percent),
        "path_verified_share": ("Coarse-feasible with a verified path", percent),
        "path_median_s": ("Path bound with its verification, median (s)", lambda v: number(v, 2)),
        "physics_success_share": ("Goals hold after physics execution", percent),
        "n": ("Sequences n", lambda v: number(v, 0)),
    }
    rows = [
        (label, *(text(metrics[length].get(key)) for length in lengths))
        for key, (label, text) in shown.items()
    ]
    return Table(
        "geometry",
        "The two bounds of the NLP on random sequences",
        ("", *(f"K = {length}" for length in lengths)),
        tuple(rows),
        records=[{"K": length, **metrics[length]} for length in lengths],
    )
