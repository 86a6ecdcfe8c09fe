"""The page ``docs/benchmarks.md``, from what ``make bench`` measured."""

from pathlib import Path
from typing import Any

from guided_lgp.experiments.problems import PROBLEMS
from guided_lgp.report.cells import NONE, number, percent, search_time, solved_suffix
from guided_lgp.report.metrics import Metrics
from guided_lgp.report.peers import peer_tables
from guided_lgp.report.scalability_tables import label
from guided_lgp.report.style import NETWORKS
from guided_lgp.report.table import Table
from guided_lgp.search.planners import BEST, PAPERS, RIVALS, TABLE_3

PAGE = Path("docs/benchmarks.md")

_GUIDED = tuple(
    name
    for name, planner in TABLE_3.items()
    if planner is BEST or (planner.policy == PAPERS.policy and planner is not PAPERS)
)
"""Whose time the rivals' is divided by."""


def benchmark_page(figures: Metrics) -> str:
    """The benchmarks as a Markdown page.

    Args:
        figures: the content of ``benchmark.json``; parts may be missing.
    """
    parts = {
        "against": _against,
        "limits": _limits,
        "minutes": _minutes,
        "false_infeasible": _witnesses,
        "coarse_bound": _coarse,
        "path_bound": _path,
        "enumeration": _enumeration,
        "planners": _planners,
        "training": _training,
        "memory": _memory,
    }
    tables = [build(figures[name]) for name, build in parts.items() if name in figures]
    tables += peer_tables(figures["peers"]) if "peers" in figures else ()
    shown = [table.markdown() for table in tables]
    about = _machine(figures["machine"]) + _others(figures)
    return "\n".join(["# Benchmarks", "", about, "", *shown])


def _others(figures: Metrics) -> str:
    """Which parts are of an earlier run on another processor."""
    here, parts = figures["machine"]["cpu"], figures.get("measured_on", {})
    others = [f"{name} ({cpu})" for name, cpu in parts.items() if cpu != here]
    return f" From an earlier run on another machine: {', '.join(others)}." if others else ""


def _machine(machine: Metrics) -> str:
    packages = ", ".join(f"{name} {version}" for name, version in machine["packages"].items())
    return (
        "Generated from `reports/metrics/benchmark.json`, which `make bench` writes: "
        f"{machine['cpu']}, {machine['cores']} cores, {machine['memory_gb']} GB, "
        f"{machine['system']}, Python {machine['python']}, {packages}."
    )


_COMMANDS = {"plan_process": "", "plan_process_uncoordinated": " --no-coordinate"}
"""Parts that time the command, with the option that only this version has."""


def _against(metrics: Metrics) -> Table:
    coarse = metrics["coarse_bound"]
    measured = {
        "coarse verdict, feasible and verified": coarse["feasible"],
        "coarse verdict, infeasible": coarse["infeasible"],
        "the same, where no fact explains it": coarse["infeasible_without_fact"],
        "one step of the solver, 40 actions": metrics["coarse_step"],
        "enumeration of a configuration": metrics["enumeration"],
        **{f"path bound, K = {k}": row for k, row in metrics["path_bound"].items()},
        **{
            f"guided-lgp plan{option}, K = {k}": row
            for part, option in _COMMANDS.items()
            for k, row in metrics.get(part, {}).items()
        },
    }
    bounds = (coarse, *metrics["path_bound"].values())
    more, less = (sum(b[f"changed_to_{to}"] for b in bounds) for to in ("feasible", "infeasible"))
    step = metrics["coarse_step"]
    return Table(
        "against",
        f"This version against version 0.1.0 ({metrics['baseline']})",
        ("What", "old (ms)", "new (ms)", "times faster", "n"),
        tuple(
            (
                what,
                number(row["old_median_ms"], 1),
                number(row["new_median_ms"], 1),
                f"{number(row['ratio'])}×",
                str(row["n"]),
            )
            for what, row in measured.items()
            if row["n"]
        ),
        (
            "Medians of CPU time, and of the ratios; both versions asked in turns in one run. "
            f"Load of the machine: {number(metrics['load'], 1)}. "
            "Verdicts of the enumeration of setup a, and of random sequences of setup e.10; paths "
            f"of random sequences of setup a. Verdicts that changed: {more} from infeasible to "
            f"feasible, {less} from feasible to infeasible. {_refused(coarse['refused_now'])}",
            "The program of 40 actions: "
            f"{step['old_variables']} variables and {number(step['old_rows'], 0)} rows then, "
            f"{step['new_variables']} and {number(step['new_rows'], 0)} now.",
        ),
    )


def _refused(counts: dict[str, int]) -> str:
    """What today's verification says of coarse solutions that only the older version finds."""
    if not counts:
        return ""
    reasons = ", ".join(f"{name} ({count})" for name, count in sorted(counts.items()))
    return f"Today's verification refuses the older solution for: {reasons}."


def _limits(metrics: Metrics) -> Table:
    checks, verdict = metrics["checks"], metrics["coarse_feasible"]
    measured = f"{number(checks['per_s'], 0)} / s"
    rows = [
        (
            "collision check of a configuration",
            measured,
            f"{number(checks[f'at_{limit}_per_s'], 0)} / s",
            why,
            percent(checks["per_s"] / checks[f"at_{limit}_per_s"]),
        )
        for limit, why in (("operations", "its operations"), ("memory", "its memory"))
    ]
    rows.append(
        (
            "feasible coarse verdict",
            f"{number(verdict['median_ms'], 2)} ms",
            f"{number(verdict['floor_ms'], 2)} ms",
            "its compiled code",
            percent(verdict["floor_ms"] / verdict["median_ms"]),
        )
    )
    return Table(
        "limits",
        "How near to the limits of one core",
        ("What", "measured", "limit", "set by", "share"),
        tuple(rows),
        (
            "A check is of a random configuration, a certificate without coal. Operations: as many "
            "as a product of matrices gets through, if spheres settled every pair of bodies. "
            "Memory: the joint values alone. Compiled code: solver, inverse kinematics and "
            "PyBullet, without what calls them.",
        ),
        labels=1,
    )


def _minutes(metrics: Metrics) -> Table:
    return Table(
        "minutes",
        "Whole runs in a fresh clone, installed before",
        ("`make repro` (min)", "`make test` (min)", "load before"),
        (tuple(number(metrics[name], 1) for name in ("repro", "test", "load_before")),),
        labels=0,
    )


def _witnesses(metrics: Metrics) -> Table:
    return Table(
        "false_infeasible",
        'Verdicts "infeasible" that other code refutes',
        ("Verdicts searched", "witnesses found", "share", "feasible sequences found"),
        (
            (
                str(metrics["n"]),
                str(metrics["found"]),
                percent(metrics["found"] / metrics["n"]),
                f"{metrics['feasible_found']} of {metrics['feasible']}",
            ),
        ),
        (
            "Random sequences of setup a, up to three actions. A witness is keyframes, verified, "
            "that a sampling search without the coarse bound's program and solver finds, with the "
            "ends of the straight ways free. How strong the search is, the same sequences without "
            "their last action tell, which are feasible.",
        ),
        labels=0,
    )


def _coarse(metrics: Metrics) -> Table:
    rows: list[tuple[str, ...]] = []
    for length, row in metrics.items():
        ipopt = row["ipopt"]
        ratios = [f"times_faster_than_ipopt_{kind}" for kind in ("feasible", "optimum")]
        rows.append(
            (
                length,
                number(row["coarse_median_ms"], 2),
                percent(row["coarse_first_try"]),
                percent(row["false_infeasible"]),
                number(ipopt["solver_median_ms"], 2),
                number(ipopt["ipopt_feasible_median_ms"]),
                number(ipopt["ipopt_optimum_median_ms"]),
                *(f"{number(ipopt[ratio])}×" for ratio in ratios),
                str(row["n"]),
                str(ipopt["n"]),
            )
        )
    return Table(
        "coarse_bound",
        "Coarse bound, and IPOPT on the same programs from the same starts",
        (
            "K",
            "one start (ms)",
            "first start solves",
            "not found",
            "our solver (ms)",
            "IPOPT, feasible (ms)",
            "IPOPT, optimum (ms)",
            "faster than IPOPT, feasible",
            "faster than IPOPT, optimum",
            "n",
            "n for IPOPT",
        ),
        tuple(rows),
        (
            "Medians on one core. One start: from skeleton and prefix to the end of the first "
            "start, the prefix's solution known. Not found: coarse-feasible within 40 starts, but "
            "not within the default ones. Our solver stops at a feasible point, which is what the "
            "bound asks for; IPOPT is run to a feasible point, and to a local optimum. The time to "
            "build IPOPT's programs is left out.",
        ),
    )


def _path(metrics: Metrics) -> Table:
    rows = tuple(
        (
            length,
            percent(row["path_verified_share"]),
            number(row["path_median_s"], 2),
            number(row["path_max_s"], 1),
            percent(row["physics_success_share"]),
            str(row["n"]),
            str(row["physics_n"]),
        )
        for length, row in metrics.items()
    )
    return Table(
        "path_bound",
        "Path bound with its verification",
        (
            "K",
            "verified path",
            "median (s)",
            "longest (s)",
            "goals hold after execution",
            "n",
            "executed",
        ),
        rows,
        ("Random coarse-feasible sequences of setup a; one core each.",),
    )


def _enumeration(metrics: Metrics) -> Table:
    single = metrics["1"]
    return Table(
        "enumeration",
        "Enumeration: verified verdicts of the coarse bound per second",
        ("Workers", "verdicts per second", "against one worker"),
        tuple(
            (n, number(speed, 0), f"{number(speed / single, 2)}×") for n, speed in metrics.items()
        ),
        ("Setup a; the start of the workers is included.",),
    )


def _planners(metrics: Metrics) -> Table:
    rivals = [name for name in RIVALS if all(name in row for row in metrics.values())]
    rows = []
    for problem in PROBLEMS:
        cells = metrics.get(problem.name)
        if cells is None:
            continue
        bases = {planner: search_time(cells[planner]) for planner in _GUIDED}
        row = [label(problem), str(problem.k_min)]
        row += [
            f"{number(bases[planner], 3)}{solved_suffix(cells[planner])}" for planner in _GUIDED
        ]
        for rival in rivals:
            theirs = search_time(cells[rival])
            row += [
                _ratio(theirs, bases[planner]) + solved_suffix(cells[rival]) for planner in _GUIDED
            ]
        rows.append(tuple(row))
    names = [TABLE_3[planner].label for planner in _GUIDED]
    return Table(
        "planners",
        "Guided search against each rival: time without the path bound",
        ("Problem", "K", *(f"{name} (s)" for name in names), *names * len(rivals)),
        tuple(rows),
        (
            "Means over the objectives solved in one configuration per problem, symbolic, policy "
            "and coarse time. A rival's figure is its time divided by the guided planner's: above "
            f"1, guided search is faster. {NONE}: nothing solved. (k/n): k of n solved.",
            "Longer problems, on which rivals run into their limits: Table III.",
        ),
        (("", 4), *((f"{TABLE_3[rival].label} takes, times", 2) for rival in rivals)),
    )


def _ratio(theirs: float | None, ours: float | None) -> str:
    return NONE if theirs is None or not ours else f"{number(theirs / ours)}×"


def _training(metrics: Metrics) -> Table:
    return Table(
        "training",
        "Training: samples per second of one sub-policy on one core",
        tuple(NETWORKS[network] for network in metrics),
        (tuple(number(speed, 0) for speed in metrics.values()),),
        labels=0,
    )


def _memory(metrics: dict[str, Any]) -> Table:
    return Table(
        "memory",
        "Peak memory of each stage (MB)",
        ("Stage", "largest process"),
        tuple((stage, number(peak, 0)) for stage, peak in metrics.items()),
        ("Resident memory, libraries included, in the small profile (tests/params.yaml).",),
    )
