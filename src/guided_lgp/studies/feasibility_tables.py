"""The tables of the study of the feasibility classifier."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Annotated, Any, TypeVar

from pydantic import Field, TypeAdapter

from guided_lgp.documents import read_json
from guided_lgp.errors import InputError
from guided_lgp.faults import validated
from guided_lgp.quantities import Count, Figures, Number, Share
from guided_lgp.report.table import Table
from guided_lgp.search.planners import PAPERS
from guided_lgp.studies.cases import CLASSIFIER, PLANNERS, RESULTS

SEARCHES = {
    key: "greedy" if planner.search == PAPERS.search else planner.search
    for key, planner in PLANNERS.items()
    if planner.adapt
}

Run = Mapping[str, float]
Runs = Mapping[str, Mapping[str, Mapping[str, Run]]]
"""Policy, search, without or with the classifier, figure."""


_ORIGIN = "the output of studies/run.py feasibility"
Item = TypeVar("Item")


class _Calls(Figures):
    """What one search did with one policy."""

    shortest: Share
    no_solution: Share
    coarse_calls: Count
    infeasible_calls: Count


class _Times(Figures):
    """How long it took."""

    coarse_s: Annotated[Number, Field(gt=0)]
    infeasible_s: Number
    policy_s: Number


class _Bin(Figures):
    """Predicted and observed shares, from one probability on."""

    start: Annotated[Share, Field(alias="from")]
    n: Count
    predicted: Share
    feasible: Share


_Pair = Annotated[list[Item], Field(min_length=2, max_length=2)]


class _Classifier(Figures):
    """How far it can be trusted."""

    n: Count
    brier: Share
    brier_base: Share
    ece: Share
    confusion: _Pair[_Pair[Count]]
    bins: list[_Bin]


class _Study(Figures):
    classifier: _Classifier
    search: dict[str, dict[str, dict[str, _Calls]]]


_FIGURES = TypeAdapter[Any](_Study)
_TIMES = TypeAdapter[Any](dict[str, dict[str, dict[str, _Times]]])


def feasibility_tables(root: Path) -> dict[str, Table]:
    """By file name: what the classifier saves, and how far its probabilities can be trusted.

    Raises:
        InputError: an output of the stage feasibility is missing or damaged.
    """
    figures = _read(root / RESULTS / "feasibility.json", _FIGURES)
    times = _read(root / RESULTS / "feasibility_timing.json", _TIMES)
    runs = [_names(figures["search"]), _names(times)]
    if not runs[0] or runs[0] != runs[1]:
        raise InputError(str(root / RESULTS), "lacks figures or times of a search", _ORIGIN)
    return {
        "feasibility": _savings(figures["search"], times),
        "feasibility_reliability": _reliability(figures["classifier"]),
    }


def _read(path: Path, shape: TypeAdapter[Any]) -> Any:
    document = read_json(path, _ORIGIN)
    validated(shape.validate_python, document, str(path), _ORIGIN)
    return document


def _names(runs: Runs) -> set[str]:
    """The policies, if all their searches are there, without and with the classifier."""
    wanted = {(search, classified) for search in SEARCHES for classified in CLASSIFIER}
    found = {
        policy: {(search, kind) for search, kinds in searches.items() for kind in kinds}
        for policy, searches in runs.items()
    }
    return set(found) if all(known == wanted for known in found.values()) else set()


def verdict(times: Runs) -> str:
    """Whether the classifier pays, in one sentence."""
    changes = {policy: _change(searches.values()) for policy, searches in times.items()}
    paying = [policy for policy, change in changes.items() if change < 0]
    pays = {0: "does not pay", len(changes): "pays for every policy"}.get(
        len(paying), f"pays for {len(paying)} of {len(changes)} policies ({', '.join(paying)})"
    )
    changed = ", ".join(f"{100 * change:+.1f} % ({policy})" for policy, change in changes.items())
    infeasible = ", ".join(
        f"{100 * _infeasible_share(run['without'] for run in searches.values()):.1f} % ({policy})"
        for policy, searches in times.items()
    )
    return (
        f"The classifier {pays}: it changes the time of coarse NLPs and policy, over both "
        f"searches, by {changed}; infeasible NLPs, which a perfect one would not ask for, take "
        f"{infeasible} of the time of the coarse NLPs."
    )


def _change(searches: Iterable[Mapping[str, Run]]) -> float:
    """By which share the classifier changes the time of coarse NLPs and policy."""
    runs = list(searches)
    without, with_it = (
        sum(run[classified]["coarse_s"] + run[classified]["policy_s"] for run in runs)
        for classified in CLASSIFIER
    )
    return with_it / without - 1


def _infeasible_share(runs: Iterable[Run]) -> float:
    pairs = [(run["infeasible_s"], run["coarse_s"]) for run in runs]
    return sum(infeasible for infeasible, _ in pairs) / sum(coarse for _, coarse in pairs)


def _savings(search: Runs, times: Runs) -> Table:
    runs = [
        (policy, name, classified)
        for policy in search
        for name in SEARCHES
        for classified in CLASSIFIER
    ]
    rows, records = [], []
    for policy, name, classified in runs:
        own, time = search[policy][name][classified], times[policy][name][classified]
        rows.append(
            (
                policy,
                SEARCHES[name],
                classified,
                f"{100 * own['shortest']:.1f}",
                f"{100 * own['no_solution']:.1f}",
                str(own["coarse_calls"]),
                str(own["infeasible_calls"]),
                f"{time['coarse_s']:.1f}",
                f"{100 * _infeasible_share([time]):.1f}",
                f"{time['policy_s']:.1f}",
            )
        )
        run = {"policy": policy, "search": name, "classifier": classified}
        records.append(run | dict(own) | dict(time))
    return Table(
        name="study_feasibility",
        title="A feasibility classifier: what it saves",
        columns=(
            *("policy", "search", "classifier", "shortest, %", "no plan, %"),
            *("coarse NLPs", "infeasible", "coarse time, s", "of it infeasible, %"),
            "policy time, s",
        ),
        labels=3,
        rows=tuple(rows),
        notes=(
            verdict(times),
            "The classifier predicts from state and action whether the coarse NLP will be "
            "feasible, and adds log p(feasible) to the policy's log p: it orders the actions and "
            "excludes none. Sums over all problems of the generalization test, up to the coarse "
            "bound; the time of the policy includes the classifier's.",
        ),
        records=records,
    )


def _reliability(quality: Mapping[str, Any]) -> Table:
    (caught, missed), (alarms, _) = quality["confusion"]
    return Table(
        name="study_feasibility_reliability",
        title="A feasibility classifier: predicted and observed shares of feasible sequences",
        columns=("predicted from", "sequences", "predicted, %", "feasible, %"),
        rows=tuple(
            (
                f"{row['from']:.1f}",
                str(row["n"]),
                f"{100 * row['predicted']:.1f}",
                f"{100 * row['feasible']:.1f}",
            )
            for row in quality["bins"]
        ),
        notes=(
            f"Over the enumerated sequences of the test configurations ({quality['n']}): Brier "
            f"score {quality['brier']:.4f}, that of the share of the feasible "
            f"{quality['brier_base']:.4f}; expected calibration error {quality['ece']:.4f}. At 0.5 "
            f"it recognises {caught} of {caught + missed} infeasible ones, with {alarms} false "
            "alarms.",
        ),
    )
