"""Benchmark of the open world: generated scenes of thirteen kinds, their truth, and the verdicts.

A scene with a planted fault has no plan; another one is solvable if there is a witness that the
plan checker of the tests accepts: the plan of the default planner, or else that of a search with
more patience. What has neither is undecided. Limits are coarse calls, so that a loaded machine
changes nothing; times stand apart. Writes ``reports/metrics/open_world.json`` and
``open_world_times.json``, and the table of ``docs/open_world.md``:

    python benchmarks/open_world.py [scenes of each kind [first scene [kind ...]]]
"""

import json
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, TypeVar

from guided_lgp import parallel
from guided_lgp.bounds.plan_file import write_plan
from guided_lgp.documents import read_json, write_json, written_whole
from guided_lgp.params import load_params, load_planning
from guided_lgp.paths import METRICS, SOURCES
from guided_lgp.planning import PlanningResult, plan
from open_world_scenes import KINDS, Case, cases

Known = TypeVar("Known", list[dict[str, Any]], dict[str, float])

SCENES = 30
"""Of each kind."""
CALLS, PATIENCE = 100, 10
"""Coarse calls of the default planner, beyond those that follow the task, and how many times as
many a witness may take."""
ENDS = ("impossible", "exhausted", "attempts")
"""Reasons that claim that there is no plan."""
FILE, TIMES = "open_world.json", "open_world_times.json"
PAGE = Path("docs/open_world.md")
BEGIN, END = "<!-- written by benchmarks/open_world.py -->", "<!-- end -->"
FIGURES = (
    *("scenes", "solvable", "solved", "no_plan", "false_infeasible", "stopped", "undecided"),
    *("reasons", "reason_right", "rejected_by_checker"),
)


@dataclass(frozen=True)
class Task:
    """One scene of a kind."""

    kind: str
    number: int


def run_task(task: Task) -> tuple[dict[str, Any], float]:
    """The row of a scene, and the time (s) of the default planner."""
    case, begin = cases(task.kind, task.number), time.perf_counter()
    result = _planned(case, CALLS)
    elapsed = time.perf_counter() - begin
    faults = faults_of(result)
    finding = None if result.finding is None else result.finding.kind
    return {
        "kind": task.kind,
        "number": task.number,
        "truth": _truth(case, result, faults),
        "verdict": _verdict(result),
        "actions": len(result.skeleton or ()),
        "coarse_calls": result.coarse_calls,
        "finding": finding,
        "reason_right": bool(case.fault) and finding in case.fault,
        "rejected": bool(faults),
    }, elapsed


def _planned(case: Case, calls: int, planner: str = "complete") -> PlanningResult:
    params = load_planning()
    limits = params.compare_scalability.model_copy(update={"max_sequences": calls})
    patient = params.model_copy(update={"compare_scalability": limits})
    return plan(case.scene, case.goals, planner, params=patient)


def _verdict(result: PlanningResult) -> str:
    if result.solved:
        return "plan"
    return "no plan" if result.reason in ENDS else "stopped"


def _truth(case: Case, result: PlanningResult, faults: Sequence[object]) -> str:
    if case.fault:
        return "no plan"
    if result.solved and not faults:
        return "solvable"
    witness = _planned(case, CALLS * PATIENCE, "informed")
    return "solvable" if witness.solved and not faults_of(witness) else "undecided"


def faults_of(result: PlanningResult) -> Sequence[object]:
    """What the checker of the tests finds in a plan; nothing where there is none."""
    if result.path is None:
        return ()
    with TemporaryDirectory() as folder:
        file = Path(folder) / "plan.json"
        write_plan(file, result.scene, result.objective, result.path, {})
        found: Sequence[object] = _checker().check(json.loads(file.read_text(encoding="utf-8")))
    return found


def _checker() -> Any:
    """The plan checker of the tests; workers, too, have to find it."""
    folder = str(SOURCES / "tests" / "oracles")
    if folder not in sys.path:
        sys.path.append(folder)
    import plan_checker

    return plan_checker


def figures(rows: Iterable[Mapping[str, Any]]) -> dict[str, int]:
    """The figures of some scenes."""
    counts = dict.fromkeys(FIGURES, 0)
    for row in rows:
        solvable, planted = row["truth"] == "solvable", row["truth"] == "no plan"
        counts["scenes"] += 1
        counts["solvable"] += solvable
        counts["solved"] += solvable and row["verdict"] == "plan" and not row["rejected"]
        counts["no_plan"] += row["verdict"] == "no plan"
        counts["false_infeasible"] += solvable and row["verdict"] == "no plan"
        counts["stopped"] += row["verdict"] == "stopped"
        counts["undecided"] += row["truth"] == "undecided"
        counts["reasons"] += planted and row["verdict"] != "plan"
        counts["reason_right"] += planted and row["reason_right"]
        counts["rejected_by_checker"] += row["rejected"]
    return counts


def summary(rows: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The whole document."""
    kinds = {kind: figures(row for row in rows if row["kind"] == kind) for kind in KINDS}
    return {"kinds": kinds, "all": figures(rows), "rows": list(rows)}


def table(document: Mapping[str, Any]) -> str:
    """The figures in Markdown."""
    return markdown("kind", document["kinds"] | {"all": document["all"]})


def markdown(head: str, rows: Mapping[str, Mapping[str, int]]) -> str:
    """A table with one row for each key and the same columns in all of them."""
    columns = list(next(iter(rows.values())))
    lines = [[head, *(name.replace("_", " ") for name in columns)], ["---"] * (len(columns) + 1)]
    lines += [[name, *(str(row[column]) for column in columns)] for name, row in rows.items()]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def write_table(begin: str, text: str) -> None:
    """Put a table into the page, between a mark and the next end."""
    before, mark, rest = (SOURCES / PAGE).read_text(encoding="utf-8").partition(begin)
    _, end, after = rest.partition(END)
    with written_whole(SOURCES / PAGE) as unfinished:
        unfinished.write_text(f"{before}{mark}\n\n{text}\n\n{end}{after}", "utf-8")


def main(count: int = SCENES, first: int = 0, *kinds: str) -> None:
    """Plan scenes and add them to those of before, which stay where they are others."""
    tasks = [Task(kind, first + number) for kind in kinds or KINDS for number in range(count)]
    settings = load_params(SOURCES / "params.yaml").parallel
    done = parallel.run(run_task, tasks, settings, "scenes of the open world")
    known = {(row["kind"], row["number"]): row for row in _before(FILE, "rows", [])}
    known |= {(row["kind"], row["number"]): row for row, _ in done}
    order = list(KINDS)
    keys = sorted(known, key=lambda key: (order.index(key[0]), key[1]))
    document = summary([known[key] for key in keys])
    write_json(SOURCES / METRICS / FILE, document)
    times = {f"{row['kind']}-{row['number']}": round(seconds, 2) for row, seconds in done}
    write_json(SOURCES / METRICS / TIMES, {"seconds": _before(TIMES, "seconds", {}) | times})
    write_table(BEGIN, table(document))


def _before(name: str, field: str, otherwise: Known) -> Known:
    """What an earlier run has written."""
    file = SOURCES / METRICS / name
    found: Known = read_json(file)[field] if file.is_file() else otherwise
    return found


if __name__ == "__main__":
    main(*map(int, sys.argv[1:3]), *sys.argv[3:])
