"""Figures on scalability: what a plan costs against its number of actions, by planner."""

from collections.abc import Mapping
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import PercentFormatter

from guided_lgp.report import paper
from guided_lgp.report.drawing import STYLE, WIDTH, subplots
from guided_lgp.report.inputs import all_solved, compared
from guided_lgp.report.metrics import Metrics
from guided_lgp.report.style import planner_style
from guided_lgp.search.planners import RIVALS, TABLE_3

DRAWN = tuple(name for name, planner in TABLE_3.items() if planner.drawn)
"""Those without a policy, the paper's, and the one that ``plan`` uses; the tables have all."""
SOLVING = tuple(name for name, planner in TABLE_3.items() if planner.headline)
"""Planners of the figure of the problems solved, which the README has."""


@mpl.rc_context(STYLE)
def tree_size(metrics: Metrics, limit: int) -> Figure:
    """Nodes generated against K, with the paper's points and the limit of the tree size.

    A point is the mean over all problems with the same smallest number of actions K.

    Args:
        metrics: by problem and planner, None where a planner met the limit of the tree size.
        limit: of the tree size.
    """
    figure, axis = _costs("Tree size (nodes)", "tree_size_mean", metrics, metrics)
    axis.axhline(limit, color="#999999", linewidth=0.8, linestyle=":")
    for planner in RIVALS:
        cells = [(p.k_min, metrics[p.name].get(planner)) for p in compared(metrics)]
        stopped = sorted({k for k, cell in cells if cell and cell["tree_size_mean"] is None})
        color = planner_style(TABLE_3[planner])["color"]
        axis.plot(stopped, [limit] * len(stopped), "x", color=color, markersize=6)
    return figure


@mpl.rc_context(STYLE)
def time(metrics: Metrics, timing: Metrics) -> Figure:
    """Time to a plan with its motion against K, with the paper's points; as :func:`tree_size`."""
    return _costs("Time to a plan (s)", "time_mean_s", timing, metrics)[0]


@mpl.rc_context(STYLE)
def solved(metrics: Metrics) -> Figure:
    """The share of problems solved against K: a line per planner of :data:`SOLVING`."""
    figure, axes = subplots(1, 1, WIDTH, 3.2)
    axis = axes[0][0]
    for planner in SOLVING:
        cells = _by_length(metrics, planner)
        shares = [
            sum(cell["problems_solved"] for cell in group) / sum(cell["problems"] for cell in group)
            for group in cells.values()
        ]
        style: dict[str, Any] = planner_style(TABLE_3[planner]) | {"linestyle": "-"}
        axis.plot(list(cells), shares, label=TABLE_3[planner].label, **style)
    axis.set_xlabel("Smallest number of actions $K$ (two per box)")
    axis.set_ylabel("Problems solved")
    axis.yaxis.set_major_formatter(PercentFormatter(1.0))
    figure.legend(loc="outside lower center", ncols=2)
    return figure


def _costs(title: str, mean: str, figures: Metrics, metrics: Metrics) -> tuple[Figure, Axes]:
    """A quantity of the planners of :data:`DRAWN` against K, both axes logarithmic."""
    figure, axes = subplots(1, 1, WIDTH, 4.0)
    axis: Axes = axes[0][0]
    for rank, planner in enumerate(DRAWN):
        # Side by side, so that equal figures do not hide each other.
        shift = 1 + 0.008 * (rank - (len(DRAWN) - 1) / 2)
        _curve(axis, planner, shift, mean, figures, metrics)
        _printed(axis, planner, shift, mean, metrics)
    axis.set_xscale("log")
    axis.set_yscale("log")
    lengths = sorted({problem.k_min for problem in compared(metrics)})
    axis.set_xticks(lengths, list(map(str, lengths)))
    axis.minorticks_off()
    axis.set_xlabel("Smallest number of actions $K$")
    axis.set_ylabel(title)
    figure.legend(loc="outside lower center", ncols=2)
    return figure, axis


def _curve(
    axis: Axes, planner: str, shift: float, mean: str, figures: Metrics, metrics: Metrics
) -> None:
    """A planner's means; a white dot where it leaves problems of that K unsolved."""
    cells = _by_length(figures, planner, mean)
    values = [np.mean([cell[mean] for cell in group]) for group in cells.values()]
    places = [k * shift for k in cells]
    if cells:
        style: dict[str, Any] = planner_style(TABLE_3[planner])
        axis.plot(places, values, label=TABLE_3[planner].label, **style)
    counts = _by_length(metrics, planner)
    partial = [not all(map(all_solved, counts[k])) for k in cells]
    axis.plot(*np.column_stack([places, values])[partial].T, "o", color="white", ms=2.2, zorder=5)


def _printed(axis: Axes, planner: str, shift: float, mean: str, metrics: Metrics) -> None:
    """The paper's means, a large open marker each."""
    points = [
        (problem.k_min * shift, paper.SCALABILITY[problem.name][planner][mean])
        for problem in compared(metrics)
        if planner in paper.SCALABILITY.get(problem.name, {})
    ]
    style = planner_style(TABLE_3[planner])
    if points:
        axis.plot(
            *zip(*points, strict=True),
            marker=style["marker"],
            color=style["color"],
            markerfacecolor="none",
            markersize=8,
            markeredgewidth=0.9,
            linestyle="none",
            label=f"{TABLE_3[planner].label} (paper)",
            zorder=1.5,
        )


def _by_length(
    figures: Metrics, planner: str, mean: str | None = None
) -> dict[int, list[Mapping[str, Any]]]:
    """A planner's cells by K, those without a mean left out."""
    found: dict[int, list[Mapping[str, Any]]] = {}
    for problem in compared(figures):
        cell = figures[problem.name].get(planner)
        if cell and (mean is None or cell[mean] is not None):
            found.setdefault(problem.k_min, []).append(cell)
    return found
