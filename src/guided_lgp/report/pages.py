"""Results in the pages for readers: ``docs/results.md``, findings in README and ``cases.md``."""

from pathlib import Path
from typing import Any

from pydantic import TypeAdapter

from guided_lgp.documents import read_text, write_text
from guided_lgp.errors import InputError
from guided_lgp.paths import REPORTS
from guided_lgp.report import paper
from guided_lgp.report.case_page import came_out
from guided_lgp.report.cases import headline
from guided_lgp.report.cells import NONE
from guided_lgp.report.drawing import save
from guided_lgp.report.findings import many, pair, tree
from guided_lgp.report.metrics import (
    CASES,
    COMPARED,
    Metrics,
    read_evaluations,
    read_metrics,
)
from guided_lgp.report.scalability_figures import solved
from guided_lgp.report.style import POLICIES
from guided_lgp.search.planners import BEST, CONTROL, PAPERS, TABLE_1

BEGIN = "<!-- findings: written by make repro -->"
END = "<!-- end of findings -->"
RESULTS = Path("docs/results.md")
ABOUT_CASES = Path("docs/cases.md")
IMAGES = Path("docs/images")
TABLES = ("winners", "table_1", "table_3_tree_size", "table_3_time", "table_3_details", "training")
"""Files of ``reports/tables`` that the page of results has."""
OPTIONAL = (
    *("cases_compared", "case_rows", "case_rows_decoys"),
    *("draws", "unseen", "enumeration", "geometry"),
)
"""Those that are there once ``make cases``, ``make study`` and ``make bench`` have run."""
_INTRODUCTION = """\
# Results

Written by `make repro` from `reports/`; the whole report, with figures and 3D replays, is
`reports/report.html`. [Where and why this differs from the paper](differences.md) ·
[benchmarks](benchmarks.md) · [studies](studies.md) · [cases](cases.md)

![Share of problems solved against the number of actions](images/solved.png)
"""


def write_pages(root: Path) -> None:
    """Write the page of results with its figure, and the findings in the README and about cases.

    Args:
        root: the folder of ``dvc.yaml``.

    Raises:
        InputError: a table or metric, or a marker in a page, is missing, or a file cannot be
            written.
    """
    shares, metrics, timing = read_evaluations(root)
    (root / IMAGES).mkdir(parents=True, exist_ok=True)
    save(solved(metrics), root / IMAGES, "solved")
    write_text(root / RESULTS, "\n".join([_INTRODUCTION, *_tables(root)]))
    compared = _of_cases(root, "cases_compared", COMPARED)
    _replace(root / "README.md", findings(metrics, timing, shares, compared))
    if compared:
        _replace(root / ABOUT_CASES, came_out(_of_cases(root, "cases", CASES), compared))


def _of_cases(root: Path, name: str, shape: TypeAdapter[Any]) -> Metrics:
    """Figures of the cases; none before ``make cases`` has run."""
    path = root / REPORTS / f"{name}.json"
    return read_metrics(path, "make cases", shape) if path.is_file() else {}


def _tables(root: Path) -> list[str]:
    texts = []
    for name in (*TABLES, *OPTIONAL):
        path = root / REPORTS / "tables" / f"{name}.md"
        if path.is_file():
            texts.append(_headed(read_text(path)))
        elif name in TABLES:
            raise InputError(str(path), "is missing", "the output of stage render_reports")
    return texts


def _headed(table: str) -> str:
    """A table whose title is a heading, so that a list of contents has it."""
    title, _, rest = table.partition("\n")
    return f"## {title.removeprefix('**').removesuffix('**')}\n{rest}"


def _replace(page: Path, block: str) -> None:
    """Put a block between the two markers of a page."""
    before, begin, rest = read_text(page).partition(BEGIN)
    _, end, after = rest.partition(END)
    if not end:
        raise InputError(str(page), "has no markers of the findings", f"{BEGIN} and {END}")
    write_text(page, f"{before}{begin}\n\n{block}\n{end}{after}")


def findings(metrics: Metrics, timing: Metrics, shares: Metrics, cases: Metrics) -> str:
    """Three findings for the README, each a bold statement with the figures beside it."""
    return "\n".join(
        [
            f"**1. The tree stays small.** {tree(metrics, timing)}",
            "",
            "**2. Most plans are shortest.** Share of shortest plans, all / unseen objectives:",
            "",
            *_shares(shares),
            "",
            f"**3. With many boxes a relational policy pays.** {many(metrics)}",
            "",
            f"![Share of problems solved against the number of actions]({IMAGES}/solved.png)",
            "",
            *_rows(cases.get("rows", {})),
        ]
    )


def _rows(sizes: Metrics) -> list[str]:
    """What learning is worth where geometry decides, once ``make cases`` has run."""
    if not sizes:
        return []
    return [f"Where geometry decides, in [crowded rows](docs/cases.md), {headline(sizes)}", ""]


def _shares(shares: Metrics) -> list[str]:
    """A small table: the paper's networks in the paper and here, and the policies added."""
    printed = paper.GENERALIZATION
    rows = [
        (
            POLICIES[planner.policy],
            planner.strategy,
            pair(printed[key]) if key in printed else NONE,
            pair(shares[key]),
        )
        for key, planner in TABLE_1.items()
        if planner.policy == PAPERS.policy or planner in (BEST, CONTROL)
    ]
    head = ["| Policy | Search | paper | here |", "| :--- | :--- | ---: | ---: |"]
    return [*head, *(f"| {' | '.join(row)} |" for row in rows)]


if __name__ == "__main__":
    write_pages(Path.cwd())
