"""Results in the pages for readers: ``docs/results.md``, and the findings of the README."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from guided_lgp.documents import write_text
from guided_lgp.errors import InputError
from guided_lgp.paths import METRICS, REPORTS
from guided_lgp.report import paper
from guided_lgp.report.cells import number, percent, search_time
from guided_lgp.report.drawing import STYLE, save
from guided_lgp.report.inputs import Metrics, all_solved, compared, read_object
from guided_lgp.report.style import planner_style
from guided_lgp.search.planners import TABLE_3

BEGIN = "<!-- findings: written by make repro -->"
END = "<!-- end of findings -->"
RESULTS = Path("docs/results.md")
IMAGES = Path("docs/images")
TABLES = ("winners", "table_1", "table_3_tree_size", "table_3_time", "table_3_details", "training")
"""Files of ``reports/tables`` that the page of results has."""
OPTIONAL = ("draws", "unseen", "enumeration", "geometry")
"""Those that are there once ``make study`` and ``make bench`` have run."""
SHOWN = ("breadth_first", "astar", "uniform_best_first", "relational")
"""Planners of the README's figure."""
_INTRODUCTION = """\
# Results

Written by `make repro` from `reports/`; the whole report, with figures and 3D replays, is
`reports/report.html`. [Where and why this differs from the paper](differences.md) ·
[benchmarks](benchmarks.md) · [studies](studies.md)

![Share of problems solved against the number of actions](images/solved.png)
"""


def write_pages(root: Path) -> None:
    """Write the page of results with its figure, and the findings in ``README.md``.

    Args:
        root: the folder of ``dvc.yaml``.

    Raises:
        InputError: a table or metric, or a marker in the README, is missing, or a file cannot be
            written.
    """
    metrics = read_object(root / METRICS / "scalability.json", "compare_scalability")
    timing = read_object(root / METRICS / "scalability_timing.json", "compare_scalability")
    shares = read_object(root / METRICS / "generalization.json", "evaluate_generalization")
    (root / IMAGES).mkdir(parents=True, exist_ok=True)
    save(solved(metrics), root / IMAGES, "solved")
    write_text(root / RESULTS, "\n".join([_INTRODUCTION, *_tables(root)]))
    _replace(root / "README.md", findings(metrics, timing, shares))


def _tables(root: Path) -> list[str]:
    texts = []
    for name in (*TABLES, *OPTIONAL):
        path = root / REPORTS / "tables" / f"{name}.md"
        if path.is_file():
            texts.append(path.read_text(encoding="utf-8"))
        elif name in TABLES:
            raise InputError(str(path), "is missing", "the output of stage render_reports")
    return texts


def _replace(readme: Path, block: str) -> None:
    """Put a block between the two markers of a page."""
    before, begin, rest = readme.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not end:
        raise InputError(str(readme), "has no markers of the findings", f"{BEGIN} and {END}")
    write_text(readme, f"{before}{begin}\n\n{block}\n{end}{after}")


@mpl.rc_context(STYLE | {"font.size": 10.0, "legend.fontsize": 10.0})
def solved(metrics: Metrics) -> Figure:
    """The share of problems solved against K: a line per planner of :data:`SHOWN`."""
    figure = Figure(figsize=(5.0, 3.4))
    axis = figure.subplots()
    for planner in SHOWN:
        counts: dict[int, list[int]] = {}
        for problem in compared(metrics):
            if cell := metrics[problem.name].get(planner):
                total = counts.setdefault(problem.k_min, [0, 0])
                total[0] += cell["problems_solved"]
                total[1] += cell["problems"]
        shares = [done / given for done, given in counts.values()]
        style: dict[str, Any] = planner_style(TABLE_3[planner]) | {"linestyle": "-"}
        axis.plot(list(counts), shares, label=TABLE_3[planner].label, **style)
    axis.set_xlabel("Smallest number of actions $K$ (two per box)")
    axis.set_ylabel("Problems solved")
    axis.yaxis.set_major_formatter(PercentFormatter(1.0))
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def findings(metrics: Metrics, timing: Metrics, shares: Metrics) -> str:
    """Three findings for the README, each a bold statement with the figures beside it."""
    return "\n".join(
        [
            f"**1. The tree stays small.** {_tree(metrics, timing)}",
            "",
            "**2. Most plans are shortest.** Share of shortest plans, all / unseen objectives:",
            "",
            *_shares(shares),
            "",
            f"**3. With many boxes a relational policy pays.** {_many(metrics)}",
            "",
            f"![Share of problems solved against the number of actions]({IMAGES}/solved.png)",
            "",
        ]
    )


def _tree(metrics: Metrics, timing: Metrics) -> str:
    """How much smaller the guided tree is on the largest problem that breadth-first solves."""
    last = [
        problem.name
        for problem in compared(metrics)
        if (tree := metrics[problem.name].get("breadth_first")) and all_solved(tree)
    ][-1]
    nodes = [metrics[last][name]["tree_size_mean"] for name in ("breadth_first", "guided")]
    seconds = [search_time(timing[last][name]) for name in ("breadth_first", "guided")]
    faster = f"{seconds[0] / seconds[1]:.1f}" if seconds[0] and seconds[1] else "–"
    return (
        f"On {last}, the largest problem that breadth-first finishes, it generates "
        f"{number(nodes[0], 0)} nodes, guided search {number(nodes[1], 0)}. In time the factor is "
        f"{faster}: nodes are cheap, geometry is not."
    )


def _shares(shares: Metrics) -> list[str]:
    """A small table: the paper's networks in the paper and here, and the policies added."""
    printed = paper.GENERALIZATION
    rows = [
        ("Paper's networks", "default", _pair(printed["default"]), _pair(shares["default"])),
        (
            "Paper's networks",
            "objective adaptation",
            _pair(printed["adaptation"]),
            _pair(shares["adaptation"]),
        ),
        ("Paper's networks", "best-first", "–", _pair(shares["best_first"])),
        ("Relational policy", "objective adaptation", "–", _pair(shares["relational"])),
        ("No policy (control)", "best-first", "–", _pair(shares["uniform_best_first"])),
    ]
    head = ["| Policy | Search | paper | here |", "| :--- | :--- | ---: | ---: |"]
    return [*head, *(f"| {' | '.join(row)} |" for row in rows)]


def _pair(subsets: Metrics) -> str:
    return " / ".join(percent(subsets[subset]["shortest"]) for subset in ("all", "unseen"))


def _many(metrics: Metrics) -> str:
    """How many problems beyond the paper's each planner of the figure solves."""
    beyond = [metrics[p.name] for p in compared(metrics) if p.name not in paper.SCALABILITY]
    counts = []
    for planner in SHOWN:
        cells = [cells[planner] for cells in beyond if planner in cells]
        done, given = (sum(cell[key] for cell in cells) for key in ("problems_solved", "problems"))
        counts.append(f"{TABLE_3[planner].label} {done}")
    return (
        f"Of {given} problems of 6 to 10 boxes, solved with a verified path: {'; '.join(counts)}."
    )


if __name__ == "__main__":
    write_pages(Path.cwd())
