"""Figures on scalability: cost against the number of actions, planner by planner."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from guided_lgp.experiments.problems import ProblemClass
from guided_lgp.report import paper
from guided_lgp.report.cells import search_time
from guided_lgp.report.drawing import PAGE, STYLE, subplots
from guided_lgp.report.inputs import Metrics, all_solved, compared
from guided_lgp.report.style import planner_style
from guided_lgp.search.planners import RIVALS, TABLE_3


@dataclass(frozen=True)
class Quantity:
    """What is drawn against the number of actions."""

    title: str
    mean: str
    std: str
    source: Metrics
    """By problem and planner; a mean is None where there is none."""
    printed: bool = True
    """Whether the paper has it."""


def _quantities(metrics: Metrics, timing: Metrics) -> tuple[Quantity, Quantity, Quantity]:
    without_path = {
        problem: {planner: {"mean": search_time(cell), "std": 0.0} for planner, cell in row.items()}
        for problem, row in timing.items()
    }
    return (
        Quantity("Tree size (nodes)", "tree_size_mean", "tree_size_std", metrics),
        Quantity("Time to a plan (s)", "time_mean_s", "time_std_s", timing),
        Quantity("Without the path bound (s)", "mean", "std", without_path, printed=False),
    )


@mpl.rc_context(STYLE)
def headline(metrics: Metrics, timing: Metrics, limit: int) -> Figure:
    """Tree size and time against K, one curve per planner, with the paper's points.

    A point is the mean over all problems with the same smallest number of actions K.

    Args:
        metrics: by problem and planner, None where a planner met the limit of the tree size.
        timing: as ``metrics``.
        limit: of the tree size.
    """
    figure, axes = subplots(1, 2, PAGE, 3.7)
    problems = compared(metrics)
    for axis, quantity in zip(axes[0], _quantities(metrics, timing)[:2], strict=True):
        _against_k(axis, problems, quantity, metrics, spread=False)
        axis.set_xlabel("Smallest number of actions $K$")
        axis.set_ylabel(quantity.title)
        _log_axes(axis, problems)
    _limit(axes[0][0], problems, metrics, limit)
    _planner_legend(figure, axes)
    return figure


@mpl.rc_context(STYLE)
def scalability(metrics: Metrics, timing: Metrics, limit: int) -> Figure:
    """Tree size and times against the smallest number of actions, by type of problem.

    Args:
        metrics: by problem and planner, None where a planner met the limit of the tree size.
        timing: as ``metrics``.
        limit: of the tree size.
    """
    panels: dict[str, list[ProblemClass]] = {}
    for problem in compared(metrics):
        panels.setdefault(problem.target.split()[0], []).append(problem)
    quantities = _quantities(metrics, timing)
    figure, axes = subplots(
        3, len(panels), PAGE, 7.0, sharex="col", sharey="row", width_ratios=_widths(panels)
    )
    for row, quantity in zip(axes, quantities, strict=True):
        for axis, problems in zip(row, panels.values(), strict=True):
            _against_k(axis, problems, quantity, metrics)
        row[0].set_ylabel(quantity.title)
    for axis, problems in zip(axes[0], panels.values(), strict=True):
        names = ", ".join(problem.name for problem in problems)
        kind = problems[0].target.split()[0]
        axis.set_title(f"{_PANELS.get(kind, problems[0].target.capitalize())}\n({names})")
        _limit(axis, problems, metrics, limit)
    for axis, problems in zip(axes[-1], panels.values(), strict=True):
        axis.set_xlabel("Smallest number of actions $K$")
        axis.set_xticks(sorted({problem.k_min for problem in problems}))
    for axis in axes.flat:
        axis.set_yscale("log")
    _planner_legend(figure, axes)
    return figure


_PANELS = {"stack": "Stack boxes", "place": "Place boxes side by side"}
"""Titles of problems by the first word of their target; of others, the target itself."""


def _widths(panels: Mapping[str, Sequence[ProblemClass]]) -> list[int]:
    return [len({problem.k_min for problem in problems}) for problems in panels.values()]


def _log_axes(axis: Axes, problems: Sequence[ProblemClass]) -> None:
    axis.set_xscale("log")
    axis.set_yscale("log")
    lengths = sorted({problem.k_min for problem in problems})
    axis.set_xticks(lengths, list(map(str, lengths)))
    axis.minorticks_off()


def _against_k(
    axis: Axes,
    problems: Sequence[ProblemClass],
    quantity: Quantity,
    metrics: Metrics,
    spread: bool = True,
) -> None:
    """Draw a quantity of all planners; without ``spread`` on a log axis of K, without bars.

    A white dot marks the mean of a planner that leaves problems of that K unsolved.
    """
    for rank, (planner, row) in enumerate(TABLE_3.items()):
        style: dict[str, Any] = planner_style(row)
        # Side by side, so that equal figures do not hide each other.
        side = rank - (len(TABLE_3) - 1) / 2
        known: dict[int, list[Mapping[str, Any]]] = {}
        for problem in problems:
            cell = quantity.source[problem.name].get(planner)
            if cell and cell[quantity.mean] is not None:
                known.setdefault(problem.k_min, []).append(cell)
        places = {k: k * (1 + 0.006 * side) for k in known}
        if known:
            lengths = [places[k] for k in known]
            values = np.array(
                [np.mean([c[quantity.mean] for c in cells]) for cells in known.values()]
            )
            errors = np.array(
                [np.mean([c[quantity.std] for c in cells]) for cells in known.values()]
            )
            # On a log axis an error bar cannot reach zero.
            bars = (np.minimum(errors, 0.9 * values), errors) if spread else None
            axis.errorbar(
                lengths, values, bars, elinewidth=0.7, capsize=1.5, label=row.label, **style
            )
            partial = [
                any(
                    not all_solved(metrics[p.name][planner])
                    for p in problems
                    if p.k_min == k and planner in metrics[p.name]
                )
                for k in known
            ]
            dots = np.column_stack([lengths, values])[partial]
            axis.plot(*dots.T, "o", color="white", markersize=2.2, zorder=5)
        printed = [
            (p.k_min * (1 + 0.006 * side), paper.SCALABILITY[p.name][planner][quantity.mean])
            for p in problems
            if quantity.printed and planner in paper.SCALABILITY.get(p.name, {})
        ]
        if printed:
            axis.plot(
                *zip(*printed, strict=True),
                marker=style["marker"],
                color=style["color"],
                markerfacecolor="none",
                markersize=8,
                markeredgewidth=0.9,
                linestyle="none",
                label=f"{row.label} (paper)",
                zorder=1.5,
            )


def _limit(axis: Axes, problems: Sequence[ProblemClass], metrics: Metrics, limit: int) -> None:
    """Mark the limit of the tree size, and which planners without a policy met it where."""
    axis.axhline(limit, color="#999999", linewidth=0.8, linestyle=":")
    for planner in RIVALS:
        cells = [(p.k_min, metrics[p.name].get(planner)) for p in problems]
        stopped = sorted({k for k, cell in cells if cell and cell["tree_size_mean"] is None})
        axis.plot(
            stopped,
            [limit] * len(stopped),
            "x",
            color=planner_style(TABLE_3[planner])["color"],
            markersize=6,
        )


def _planner_legend(figure: Figure, axes: np.ndarray) -> None:
    handles: dict[str, Any] = {}
    for axis in axes.flat:
        handles = dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True)) | handles
    labels = [f"{row.label}{origin}" for row in TABLE_3.values() for origin in ("", " (paper)")]
    shown = [label for label in labels if label in handles]
    figure.legend([handles[label] for label in shown], shown, loc="outside lower center", ncols=4)
