"""The tables of the studies: ``reports/studies/studies.md``, and each as CSV and LaTeX."""

import logging
import shutil
import statistics
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, TypeAdapter

from guided_lgp.documents import read_json, write_text
from guided_lgp.errors import InputError
from guided_lgp.faults import validated
from guided_lgp.quantities import Count, Figures, Share
from guided_lgp.report.table import Record, Table
from guided_lgp.studies import cases
from guided_lgp.studies.cases import OUTCOMES, RESULTS, StudyParams, StudyTable, load_study
from guided_lgp.studies.feasibility_tables import feasibility_tables

PLANNERS = {key: key.replace("_", "-") for key in cases.PLANNERS}
SHOWN = (("shortest", "all"), ("shortest", "unseen"), ("no_solution", "all"))
"""The figures in the formatted table, by outcome and subset; the CSV file has all."""

Values = Mapping[str, Mapping[str, Mapping[str, Mapping[str, Sequence[float]]]]]
"""Case, planner, subset, figure: one value per run."""


class _Runs(Figures):
    """Of one planner and set of objectives: one value per run."""

    n: Annotated[list[Count], Field(min_length=1)]
    shortest: Annotated[list[Share], Field(min_length=1)]
    feasible: Annotated[list[Share], Field(min_length=1)]
    no_solution: Annotated[list[Share], Field(min_length=1)]


_Subsets = Annotated[dict[Literal["all", "unseen"], _Runs], Field(min_length=2)]
_FIGURES = TypeAdapter(dict[str, dict[str, _Subsets]])

logger = logging.getLogger(__name__)


def render(root: Path) -> None:
    """Write the tables.

    Raises:
        InputError: bad parameters, or an output of the stage evaluate is missing or damaged.
    """
    study, _ = load_study(root)
    folder = root / RESULTS / "tables"
    shutil.rmtree(folder, ignore_errors=True)
    tables = {}
    for name, content in study.tables.items():
        tables[name] = _table(name, content, read_figures(root, name, content), study)
    tables |= feasibility_tables(root)
    for name, table in tables.items():
        for suffix, text in (("tex", table.latex()), ("csv", table.csv())):
            write_text(folder / f"{name}.{suffix}", text)
    sections = [table.markdown() for table in tables.values()]
    write_text(root / RESULTS / "studies.md", "\n".join(["# Studies", "", *sections]))
    logger.info("studies: %s", root / RESULTS / "studies.md")


def read_figures(root: Path, name: str, content: StudyTable) -> Values:
    """The figures of all cases of a study.

    Raises:
        InputError: the file is missing or damaged, or lacks a case or planner.
    """
    path, remedy = root / RESULTS / f"{name}.json", "the output of studies/run.py evaluate"
    figures: Values = read_json(path, remedy)
    validated(_FIGURES.validate_python, figures, str(path), remedy)
    for case in content.cases:
        if not PLANNERS.keys() <= figures.get(case, {}).keys():
            raise InputError(f"{path}: {case}", "lacks a planner", remedy)
    return figures


def _table(name: str, content: StudyTable, figures: Values, study: StudyParams) -> Table:
    rows, records = [], []
    for case in content.cases:
        title = study.cases[case].title
        cells = [title, str(len(figures[case][next(iter(PLANNERS))]["all"]["n"]))]
        for planner in PLANNERS:
            subsets = figures[case][planner]
            cells += [_cell(subsets[subset][outcome]) for outcome, subset in SHOWN]
        rows.append(tuple(cells))
        records += _records(case, title, figures[case])
    return Table(
        name=f"study_{name}",
        title=content.title,
        columns=("policy", "runs", *("shortest, all", "unseen", "no plan") * len(PLANNERS)),
        groups=(("", 2), *((f"{label}, %", 3) for label in PLANNERS.values())),
        rows=tuple(rows),
        notes=(
            "Shares of the problems that do not hold at the start, over the test configurations "
            "and the 87 objectives; mean ± standard deviation over runs, each with its own draw of "
            "the training objectives and its own seed. No plan: of all objectives.",
            "A sequence with a coarse bound counts as a plan; the path bound is not asked.",
        ),
        records=records,
    )


def _records(case: str, title: str, figures: Mapping[str, Any]) -> list[Record]:
    return [
        {
            "case": case,
            "title": title,
            "planner": planner,
            "objectives": subset,
            "figure": outcome,
            "runs": len(values[outcome]),
            "mean": statistics.fmean(values[outcome]),
            "std": statistics.stdev(values[outcome]) if len(values[outcome]) > 1 else None,
        }
        for planner, subsets in figures.items()
        for subset, values in subsets.items()
        for outcome in OUTCOMES
    ]


def _cell(values: Sequence[float]) -> str:
    mean = f"{100 * statistics.fmean(values):.1f}"
    return f"{mean} ± {100 * statistics.stdev(values):.1f}" if len(values) > 1 else mean
