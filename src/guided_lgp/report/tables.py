"""The tables of the report, each beside the paper's figures where the paper has any."""

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from statistics import fmean, stdev
from typing import Any

import pandas as pd

from guided_lgp.report import paper
from guided_lgp.report.analysis import NEW, RENAMED, SEEN
from guided_lgp.report.cells import NONE, number, percent
from guided_lgp.report.metrics import Metrics
from guided_lgp.report.style import NETWORKS, POLICIES
from guided_lgp.report.table import Table
from guided_lgp.search.planners import PAPERS, TABLE_1

_SHARES = {
    "shortest": "Shortest solution",
    "feasible": "Feasible solution",
    "no_solution": "No solution",
    "reattempt_infeasible": "Reattempts: infeasible",
    "reattempt_max_depth": "Reattempts: depth",
}
_SUBSETS = ("all", "unseen")
_CALLS = {
    "policy_calls": ("policy, per action", 2),
    "coarse_calls": ("coarse", 2),
    "infeasible_calls": ("infeasible", 2),
    "failed_candidates": ("failed candidates", 2),
}
"""Figures of :func:`analysis.calls`: what they are called, and decimals."""


def generalization(metrics: Metrics, calls: Mapping[str, Mapping[str, float]]) -> Table:
    """Table I: shares of problems by outcome, paper and ours, all and unseen objectives.

    Args:
        metrics: by planner and set of objectives.
        calls: by planner, means over the problems solved; see :func:`analysis.calls`.
    """
    rows, records = [], []
    for name, variant in TABLE_1.items():
        if name not in metrics:
            continue
        sources = {"ours": metrics[name]}
        if name in paper.GENERALIZATION:
            sources = {"paper": paper.GENERALIZATION[name], **sources}
        for source, subsets in sources.items():
            n = {
                subset: paper.GENERALIZATION_N[subset]
                if source == "paper"
                else subsets[subset]["n"]
                for subset in _SUBSETS
            }
            shown = calls.get(name, {}) if source == "ours" else {}
            rows.append(
                (
                    POLICIES[variant.policy],
                    variant.strategy,
                    source,
                    *(percent(subsets[subset][key]) for key in _SHARES for subset in _SUBSETS),
                    *(number(shown.get(key), decimals) for key, (_, decimals) in _CALLS.items()),
                    *(str(n[subset]) for subset in _SUBSETS),
                )
            )
            records += [
                {"planner": name, "objectives": subset, "source": source, "n": n[subset]}
                | {key: subsets[subset].get(key) for key in (*_SHARES, *_OF_PROBLEMS)}
                | {key: shown.get(key) for key in _CALLS if subset == "all"}
                for subset in _SUBSETS
            ]
    problems = next(iter(metrics.values()))["all"]
    return Table(
        "table_1",
        "Table I. Generalizability over all and unseen objectives",
        (
            *("Policy", "Search", "Source"),
            *(_SUBSETS * len(_SHARES)),
            *(label for label, _ in _CALLS.values()),
            *_SUBSETS,
        ),
        tuple(rows),
        (
            "A shortest solution has the minimal number of actions that exhaustive enumeration "
            "finds feasible; a feasible one has more. Ours are shares of the n problems that are "
            "not satisfied at the start; the paper's n is its number of configurations times "
            "objectives. Reattempts: problems with at least one for that cause. Best-first search "
            "adapts the objective, too. Calls: means over the problems solved; of the policy per "
            "action of the plan, of the coarse bound, and those with a verdict against the "
            "sequence. Failed candidates: sequences that reach the goals and that a bound refused. "
            f"In {percent(problems['unsolvable'])} of our problems the enumeration finds no "
            f"feasible sequence, in {percent(problems['shortest_without_path'])} no shortest "
            "sequence has a path.",
        ),
        (
            ("", 3),
            *((label, 2) for label in _SHARES.values()),
            ("Calls to a plan", len(_CALLS)),
            ("n", 2),
        ),
        labels=3,
        records=records,
    )


_OF_PROBLEMS = ("unsolvable", "shortest_without_path")
"""Shares that are the same for every planner."""


def draws(metrics: Metrics) -> Table:
    """Shortest solutions over several draws of the training objectives and training seeds.

    Args:
        metrics: by policy, search, set of objectives and figure, one value per draw.
    """
    searches = {
        key: planner.strategy.capitalize()
        for key, planner in TABLE_1.items()
        if planner.policy == PAPERS.policy
    }
    rows, records = [], []
    for policy, name in POLICIES.items():
        if policy not in metrics:
            continue
        cells, runs = [], 0
        for search in searches:
            for subset in _SUBSETS:
                shares = metrics[policy].get(search, {}).get(subset, {}).get("shortest", [])
                runs = max(runs, len(shares))
                mean = fmean(shares) if shares else None
                std = stdev(shares) if len(shares) > 1 else None
                cells.append(NONE if mean is None else f"{percent(mean)} ± {percent(std)}")
                records.append(
                    {"policy": policy, "search": search, "objectives": subset}
                    | {"mean": mean, "std": std, "draws": len(shares)}
                )
        rows.append((name, *cells, str(runs)))
    return Table(
        "draws",
        "Shortest solutions over draws of the training objectives and seeds",
        ("Policy", *(_SUBSETS * len(searches)), "draws"),
        tuple(rows),
        (
            "Mean ± standard deviation over the draws, from make study. Policies are trained anew "
            "for every draw, and a sequence counts as a plan once it has a coarse bound.",
        ),
        (("", 1), *((label, 2) for label in searches.values()), ("n", 1)),
        records=records,
    )


def unseen(shares: pd.DataFrame, novelty: Mapping[str, str]) -> Table:
    """What "unseen" means where boxes are interchangeable.

    Args:
        shares: columns planner, kind, n and shortest (share); see :func:`analysis.by_novelty`.
        novelty: of every objective.
    """
    counts = Counter(novelty.values())
    kinds = [kind for kind in (SEEN, RENAMED, NEW) if counts[kind]]
    cells = shares.set_index(["planner", "kind"])["shortest"]
    planners = [name for name in TABLE_1 if name in set(shares["planner"])]
    return Table(
        "unseen",
        "Shortest solutions by how new the objective is",
        ("Policy", "Search", *(f"{counts[kind]} objectives" for kind in kinds)),
        tuple(
            (
                POLICIES[TABLE_1[name].policy],
                TABLE_1[name].strategy,
                *(percent(cells.get((name, kind))) for kind in kinds),
            )
            for name in planners
        ),
        (
            "Seen: drawn for training. Renamed: unseen, but a training objective becomes it when "
            "the boxes are renamed; a policy that treats all boxes alike has seen these. New: "
            "unseen under every renaming of the boxes.",
        ),
        (("", 2), *((kind.capitalize(), 1) for kind in kinds)),
        labels=2,
        records=[dict(zip(shares.columns, row, strict=True)) for row in shares.to_numpy()],
    )


_FIT = ("accuracy", "loss", "epochs", "best_epoch")


def training_metrics(reports: Mapping[str, Mapping[str, Metrics]]) -> dict[str, Any]:
    """Accuracy, loss (nats) and epochs by network and sub-policy, for both choices of validation.

    The paper's networks stand at the top, those of other policies below the policy's name.

    Args:
        reports: by policy and network, what its training wrote.
    """
    figures = {
        policy: {
            network: {name: _fits(report, name) for name in report["sub_policies"]}
            for network, report in networks.items()
        }
        for policy, networks in reports.items()
    }
    return {**figures.pop("paper", {}), **figures}


def _fits(report: Metrics, name: str) -> dict[str, Any]:
    figures = report["sub_policies"][name]
    return {
        **{key: figures[key] for key in _FIT},
        "samples": report["samples"],
        "by_configuration": {key: figures["by_configuration"][key] for key in _FIT},
    }


def training(reports: Mapping[str, Mapping[str, Metrics]]) -> Table:
    """Accuracy, loss and epochs of every sub-policy; see :func:`training_metrics`."""
    rows, records = [], []
    for policy, networks in reports.items():
        for network, report in networks.items():
            for name in report["sub_policies"]:
                fits = _fits(report, name)
                splits = {"random": fits, "configuration": fits["by_configuration"]}
                rows.append(
                    (
                        POLICIES[policy],
                        NETWORKS.get(network, network),
                        name,
                        f"{fits['samples']:,}",
                        *(
                            text
                            for split in splits.values()
                            for text in (
                                percent(split["accuracy"]),
                                number(split["loss"], 3),
                                f"{split['best_epoch']}/{split['epochs']}",
                            )
                        ),
                    )
                )
                records += [
                    {"policy": policy, "network": network, "sub_policy": name}
                    | {"validation": validation, "samples": fits["samples"]}
                    | {key: split[key] for key in _FIT}
                    for validation, split in splits.items()
                ]
    return Table(
        "training",
        "Training of the policies",
        ("Policy", "Network", "Sub-policy", "Samples n", *(2 * ("Accuracy", "Loss", "Epoch"))),
        tuple(rows),
        (
            "Accuracy and loss (nats) on the validation samples at the best epoch, of the epochs "
            "trained; previous decisions of the chain are the true ones. Weights are those of "
            "the random choice of validation samples, as in the paper; whole configurations held "
            "out show what copies of a sample on both sides hide. Several actions are right in "
            "most states, which bounds both figures.",
        ),
        (("", 4), ("Random samples (paper)", 3), ("Whole configurations", 3)),
        labels=3,
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
        "physics_n": ("Of these executed", lambda v: number(v, 0)),
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
