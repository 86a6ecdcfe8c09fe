"""The figures of all cases: ``reports/cases.json``, and times in a file of their own."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np

from guided_lgp.cases.outcomes import Row, read_timed, require_same_problems
from guided_lgp.cases.policies import RIVALS
from guided_lgp.documents import write_json
from guided_lgp.params import Case, Params
from guided_lgp.paths import REPORTS

RESULTS = REPORTS / "cases.json"
TIMES = REPORTS / "cases_timing.json"
COMPARED = REPORTS / "cases_compared.json"
POLICY = "relational_best_first"
"""The planner that is compared with the rivals: they are complete, and so is it."""
Figures = dict[str, dict[str, dict[str, Row]]]
"""By case, size and planner."""


def run(params: Params, root: Path) -> None:
    """Write ``reports/cases.json``, ``cases_timing.json`` and ``cases_compared.json``."""
    rows = {name: read_rows(root, name, case) for name, case in params.cases.items()}
    write_json(root / RESULTS, by_cell(rows, figures))
    write_json(root / TIMES, by_cell(rows, times))
    write_json(root / COMPARED, {name: compared(found) for name, found in rows.items()})


def read_rows(root: Path, name: str, case: Case) -> list[Row]:
    """One row per problem, planner and training, times included.

    Raises:
        InputError: an evaluation is missing or damaged, or is of other problems than the others.
    """
    found = []
    for training in (RIVALS, *map(str, case.seeds)):
        found += read_timed(root, name, training)
    wanted = {(str(seed), POLICY) for seed in case.seeds}
    require_same_problems(found, str(root / REPORTS / name), wanted)
    return found


def by_cell(rows: Mapping[str, Sequence[Row]], summary: Callable[[list[Row]], Row]) -> Figures:
    """Summaries by case, size and planner, in the order of the rows."""
    cells: dict[str, dict[str, dict[str, list[Row]]]] = {}
    for name, found in rows.items():
        for row in found:
            sizes = cells.setdefault(name, {}).setdefault(str(row["size"]), {})
            sizes.setdefault(row["planner"], []).append(row)
    return {
        name: {
            size: {planner: summary(cell) for planner, cell in planners.items()}
            for size, planners in sizes.items()
        }
        for name, sizes in cells.items()
    }


def figures(cell: list[Row]) -> Row:
    """What one planner did on the problems of one size.

    ``problems`` is scenes times trainings, ``solved_within_2k`` those with at most two calls per
    action of the plan, ``solved_min`` the number of the worst training. Means of calls are over the
    solved; ``calls_limited_mean`` is over all, with the limit for the others.
    """
    trainings: dict[str, list[Row]] = {}
    for row in cell:
        trainings.setdefault(row["training"], []).append(row)
    solved = [row for row in cell if row["solved"]]
    return {
        "scenes": len({row["scene"] for row in cell}),
        "trainings": len(trainings),
        "problems": len(cell),
        "solved": len(solved),
        "solved_within_2k": sum(row["coarse_calls"] <= 2 * row["length"] for row in solved),
        "solved_min": min(sum(row["solved"] for row in rows) for rows in trainings.values()),
        "calls_mean": _mean(row["coarse_calls"] for row in solved),
        "infeasible_calls_mean": _mean(row["infeasible_calls"] for row in solved),
        "part_calls_mean": _mean(row["part_calls"] for row in solved),
        "calls_limited_mean": _mean(map(limited, cell)),
        "failed_candidates_mean": _mean(row["failed_candidates"] for row in solved),
        "plan_length_mean": _mean(row["length"] for row in solved),
        "path_verified_share": _share(row["path_verified"] for row in cell),
        "physics_share": _share(row["physics"] for row in cell),
    }


def times(cell: list[Row]) -> Row:
    """Seconds of the searches that found a plan."""
    return {"time_mean_s": _mean(row["time_s"] for row in cell if row["solved"])}


LIMIT = 100
"""What a search that found nothing counts as, in calls: the limit of all of them."""


def limited(row: Row) -> int:
    """The calls of a search; the limit where it found no plan."""
    return int(row["coarse_calls"]) if row["solved"] else LIMIT


def _mean(values: Iterable[float]) -> float | None:
    found = list(values)
    return round(fmean(found), 4) if found else None


def _share(values: Iterable[Any]) -> float | None:
    return _mean(float(value) for value in values if value is not None)


def compared(rows: Sequence[Row]) -> dict[str, Row]:
    """By size: the calls of the policy as a share of the best rival's, paired by scene.

    The best rival is the one without learning that needs the fewest calls, limits counted. Once all
    calls count, once those on parts of a scene do not: as if facts were there already.
    """
    found = {}
    for size in sorted({row["size"] for row in rows}):
        cell = [row for row in rows if row["size"] == size]
        found[str(size)] = {
            "with_facts": _best_ratio(cell, limited),
            "facts_given": _best_ratio(cell, lambda row: limited(row) - row["part_calls"]),
        }
    return found


def _best_ratio(cell: Sequence[Row], calls: Callable[[Row], int]) -> Row:
    scenes = sorted({row["scene"] for row in cell})

    def by_scene(planner: str) -> list[float]:
        own = [row for row in cell if row["planner"] == planner]
        return [fmean(calls(row) for row in own if row["scene"] == scene) for scene in scenes]

    rivals = dict.fromkeys(row["planner"] for row in cell if row["training"] == RIVALS)
    best = min(rivals, key=lambda planner: fmean(by_scene(planner)))
    ours, theirs = np.array(by_scene(POLICY)), np.array(by_scene(best))
    draws = np.random.default_rng(0).integers(len(scenes), size=(_RESAMPLED, len(scenes)))
    ratios = ours[draws].sum(axis=1) / theirs[draws].sum(axis=1)
    low, high = np.quantile(ratios, (0.025, 0.975))
    return {
        "rival": best,
        "calls": round(float(ours.mean()), 2),
        "rival_calls": round(float(theirs.mean()), 2),
        "ratio": round(float(ours.sum() / theirs.sum()), 3),
        "low": round(float(low), 3),
        "high": round(float(high), 3),
    }


_RESAMPLED = 2000
"""Draws of scenes, with replacement, behind each interval of 95 %."""
