"""The figures of the report, as matplotlib figures, and their deterministic saving."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from guided_lgp.report import paper
from guided_lgp.report.style import NETWORKS, PLANNER_COLORS, PLANNER_MARKERS, PLANNERS, VARIANTS
from guided_lgp.report.tables import Metrics, stopped

COLUMN = 3.45
"""Width of a column of a two-column page (in)."""
PAGE = 7.1
"""Width of both columns (in)."""

_STYLE = {
    "font.family": "STIXGeneral",
    "mathtext.fontset": "stix",
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.labelsize": 9.0,
    "legend.fontsize": 8.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.3,
    "lines.markersize": 4.5,
    "legend.frameon": False,
    "figure.constrained_layout.use": True,
    "svg.fonttype": "path",
    "svg.hashsalt": "guided-lgp",
    "savefig.dpi": 200,
}

OUTCOMES = {
    "shortest": ("Shortest", "#0072B2"),
    "feasible": ("Feasible, longer", "#9CC8E3"),
    "no_solution": ("No solution", "#D55E00"),
}


def save(figure: Figure, folder: Path, name: str) -> None:
    """Write ``name.png`` and ``name.svg``; the same figure gives the same bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    with mpl.rc_context(_STYLE):
        figure.savefig(folder / f"{name}.png", metadata={"Software": None})
        figure.savefig(folder / f"{name}.svg", metadata={"Date": None, "Creator": None})


def _subplots(rows: int, columns: int, width: float, height: float, **options: Any) -> tuple[Figure, Any]:
    figure = Figure(figsize=(width, height))
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def scalability(metrics: Metrics, timing: Metrics) -> Figure:
    """Tree size and time against the smallest number of actions, ours and the paper's."""
    with mpl.rc_context(_STYLE):
        figure, axes = _subplots(2, 2, PAGE, 4.9, sharex=True, sharey="row")
        rows = (
            ("tree_size_mean", "tree_size_std", metrics, "Tree size (nodes)"),
            ("time_mean_s", "time_std_s", timing, "Time to a plan (s)"),
        )
        for row, (mean, std, source, label) in zip(axes, rows, strict=True):
            for axis, stacking in zip(row, (True, False), strict=True):
                _against_k(axis, metrics, source, mean, std, stacking)
                axis.set_yscale("log")
            row[0].set_ylabel(label)
        limits = [axis for axis in axes[0]]
        for axis in limits:
            axis.axhline(paper.TREE_LIMIT, color="#999999", linewidth=0.8, linestyle=":")
        limits[0].annotate("limit of the tree size", (10, paper.TREE_LIMIT), (0, -3), textcoords="offset points", ha="right", va="top", fontsize=7, color="#777777")
        axes[0][0].set_title("Stack boxes (a.1, b.2, c.2, d.2)")
        axes[0][1].set_title("Place boxes on tray or table (b.1, c.1, d.1)")
        for axis in axes[1]:
            axis.set_xlabel("Smallest number of actions $K_{\\min}$")
            axis.set_xticks([4, 6, 8, 10])
        handles: dict[str, Any] = {}
        for axis in axes.flat:
            for handle, name in zip(*axis.get_legend_handles_labels(), strict=True):
                handles.setdefault(name, handle)
        figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=4)
    return figure


def _against_k(
    axis: Axes, metrics: Metrics, source: Metrics, mean: str, std: str, stacking: bool
) -> None:
    problems = [p for p in paper.PROBLEMS if p.stacking == stacking and p.name in metrics]
    for planner, name in PLANNERS.items():
        cells = [
            (p.k_min, source[p.name][planner])
            for p in problems
            if planner in metrics[p.name]
            and not stopped(planner, metrics[p.name][planner])
            and source[p.name][planner].get(mean) is not None
        ]
        color = PLANNER_COLORS[planner]
        if cells:
            lengths, values = zip(*((k, cell[mean]) for k, cell in cells), strict=True)
            errors = [cell[std] or 0.0 for _, cell in cells]
            # An error bar that reaches zero has no lower end on a log axis.
            lower = [min(error, 0.9 * value) for error, value in zip(errors, values, strict=True)]
            axis.errorbar(
                lengths, values, (lower, errors), color=color, marker=PLANNER_MARKERS[planner],
                elinewidth=0.7, capsize=1.5, label=name,
            )
        printed = [
            (p.k_min, paper.SCALABILITY[p.name][planner][mean])
            for p in problems
            if planner in paper.SCALABILITY[p.name]
        ]
        if printed:
            axis.plot(
                *zip(*printed, strict=True), color=color, marker=PLANNER_MARKERS[planner],
                markerfacecolor="white", linestyle="--", linewidth=0.8, label=f"{name} (paper)",
            )


def success(problems: pd.DataFrame) -> Figure:
    """Shares of outcomes by type of objective, one panel per planner.

    Args:
        problems: columns planner, kind (type of objective) and outcome, one row per problem
            that is not satisfied at the start.
    """
    planners = [name for name in VARIANTS if name in set(problems["planner"])]
    kinds = sorted(set(problems["kind"]), key=lambda kind: (kind.count("+"), kind))
    with mpl.rc_context(_STYLE):
        figure, axes = _subplots(1, len(planners), PAGE, 0.6 + 0.24 * len(kinds), sharey=True, sharex=True)
        for axis, planner in zip(axes[0], planners, strict=True):
            rows = problems[problems["planner"] == planner]
            shares = pd.crosstab(rows["kind"], rows["outcome"], normalize="index")
            counts = rows["kind"].value_counts()
            left = np.zeros(len(kinds))
            for outcome, (label, color) in OUTCOMES.items():
                column = shares.get(outcome, pd.Series(dtype=float)).reindex(kinds).fillna(0.0)
                axis.barh(range(len(kinds)), 100 * column, left=100 * left, color=color, label=label, height=0.72)
                left += column.to_numpy()
            axis.set_title(VARIANTS[planner])
            axis.set_xlabel("Problems (%)")
            axis.set_xlim(0, 100)
            axis.grid(axis="y", visible=False)
        axes[0][0].set_yticks(range(len(kinds)), [f"{kind} (n = {counts.get(kind, 0)})" for kind in kinds])
        axes[0][0].invert_yaxis()
        figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def learning_curves(curves: Mapping[str, pd.DataFrame]) -> Figure:
    """Loss by epoch of every sub-policy, on training (dashed) and validation samples.

    Args:
        curves: by "network / sub-policy"; columns epoch, train_loss, validation_loss,
            validation_accuracy.
    """
    with mpl.rc_context(_STYLE):
        figure, axes = _subplots(2, len(curves), PAGE, 3.2, sharex=True, sharey="row")
        for column, (title, frame) in zip(axes.T, curves.items(), strict=True):
            loss, accuracy = column
            loss.plot(frame["epoch"], frame["train_loss"], color="#999999", label="training")
            loss.plot(frame["epoch"], frame["validation_loss"], color="#0072B2", label="validation")
            accuracy.plot(frame["epoch"], 100 * frame["validation_accuracy"], color="#0072B2")
            loss.set_title(title)
            accuracy.set_xlabel("Epoch")
        axes[0][0].set_ylabel("Loss (nats)")
        axes[1][0].set_ylabel("Accuracy (%)")
        axes[0][-1].legend()
    return figure


def confusion(matrices: Mapping[str, tuple[Sequence[str], np.ndarray]]) -> Figure:
    """Confusion of every sub-policy: rows the action of the data, columns the one predicted."""
    sizes = [len(labels) for labels, _ in matrices.values()]
    with mpl.rc_context(_STYLE):
        figure, axes = _subplots(1, len(matrices), PAGE, 2.0, width_ratios=[s + 1 for s in sizes])
        for axis, (title, (labels, counts)) in zip(axes[0], matrices.items(), strict=True):
            total = np.maximum(counts.sum(axis=1, keepdims=True), 1)
            shares = counts / total
            _heat(axis, shares, labels, labels, [[f"{100 * s:.0f}" for s in row] for row in shares])
            axis.set_title(f"{title}\n(n = {int(counts.sum()):,})")
            axis.set_xlabel("predicted")
        axes[0][0].set_ylabel("in the data")
    return figure


def feasible_share(shares: Mapping[str, tuple[Sequence[str], Sequence[str], np.ndarray, np.ndarray]]) -> Figure:
    """Share of feasible sequences by the arm and the table of their last action.

    Args:
        shares: by kind of last action: arms, tables, feasible and all sequences (arms, tables).
    """
    with mpl.rc_context(_STYLE):
        figure, axes = _subplots(1, len(shares), PAGE, 1.7)
        for axis, (title, (arms, tables, feasible, total)) in zip(axes[0], shares.items(), strict=True):
            share = np.divide(feasible, total, out=np.full(total.shape, np.nan), where=total > 0)
            texts = [[f"{100 * s:.0f}%\nn = {int(n):,}" if n else "–" for s, n in zip(*pair, strict=True)] for pair in zip(share, total, strict=True)]
            _heat(axis, share, arms, tables, texts)
            axis.set_title(title)
    return figure


def failures(counts: pd.DataFrame) -> Figure:
    """Which constraint stays violated, by the action at which it does.

    Args:
        counts: index constraint, columns action (1, 2, …), values numbers of sequences.
    """
    with mpl.rc_context(_STYLE):
        figure, axes = _subplots(1, 1, PAGE, 0.8 + 0.24 * len(counts))
        axis = axes[0][0]
        left = np.zeros(len(counts))
        colors = mpl.colormaps["viridis"](np.linspace(0.1, 0.85, max(counts.shape[1], 2)))
        for color, action in zip(colors, counts.columns, strict=False):
            axis.barh(range(len(counts)), counts[action], left=left, color=color, label=f"action {action}", height=0.72)
            left += counts[action].to_numpy()
        axis.set_yticks(range(len(counts)), counts.index)
        axis.invert_yaxis()
        axis.set_xlabel("Infeasible sequences")
        axis.grid(axis="y", visible=False)
        axis.legend()
    return figure


def _heat(axis: Axes, values: np.ndarray, rows: Sequence[str], columns: Sequence[str], texts: Sequence[Sequence[str]]) -> None:
    axis.imshow(values, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    axis.set_xticks(range(len(columns)), columns)
    axis.set_yticks(range(len(rows)), rows)
    axis.grid(visible=False)
    axis.spines[:].set_visible(False)
    axis.tick_params(length=0)
    for i, row in enumerate(texts):
        for j, text in enumerate(row):
            dark = values[i, j] > 0.55
            axis.text(j, i, text, ha="center", va="center", fontsize=7, color="white" if dark else "#222222")
