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
from guided_lgp.report.inputs import Metrics
from guided_lgp.report.style import PLANNER_COLORS, PLANNER_MARKERS, PLANNERS, VARIANTS

COLUMN = 3.45
"""Width of a column of a two-column page (in)."""
PAGE = 7.1
"""Width of both columns (in)."""

_STYLE: dict[Any, Any] = {
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

QUANTITIES = {
    "tree_size": ("tree_size_mean", "tree_size_std"),
    "time": ("time_mean_s", "time_std_s"),
}

OUTCOMES = {
    "shortest": ("Shortest", "#0072B2"),
    "feasible": ("Feasible, longer", "#9CC8E3"),
    "no_solution": ("No solution", "#D55E00"),
}


@mpl.rc_context(_STYLE)
def save(figure: Figure, folder: Path, name: str) -> None:
    """Write ``name.png`` and ``name.svg``; the same figure gives the same bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    figure.savefig(folder / f"{name}.png", metadata={"Software": None})
    figure.set_layout_engine("none")  # keep the layout, which takes longer than drawing
    figure.savefig(folder / f"{name}.svg", metadata={"Date": None, "Creator": None})


def _subplots(
    rows: int, columns: int, width: float, height: float, **options: Any
) -> tuple[Figure, Any]:
    figure = Figure(figsize=(width, height))
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


@mpl.rc_context(_STYLE)
def scalability(metrics: Metrics, timing: Metrics, limit: int) -> Figure:
    """Tree size and time against the smallest number of actions, ours and the paper's.

    Args:
        metrics: by problem and planner, None where a planner met the limit of the tree size.
        timing: as ``metrics``.
        limit: of the tree size.
    """
    figure, axes = _subplots(2, 2, PAGE, 4.9, sharex=True, sharey="row")
    for column, stacking in enumerate((True, False)):
        problems = [p for p in paper.PROBLEMS if p.stacking == stacking and p.name in metrics]
        tree, time = axes[:, column]
        names = ", ".join(problem.name for problem in problems)
        tree.set_title(f"{'Stack boxes' if stacking else 'Place boxes side by side'} ({names})")
        _against_k(tree, problems, metrics, "tree_size", limit)
        _against_k(time, problems, timing, "time", None)
        tree.axhline(limit, color="#999999", linewidth=0.8, linestyle=":")
        time.set_xlabel(r"Smallest number of actions $K_{\mathrm{min}}$")
        time.set_xticks(sorted({problem.k_min for problem in paper.PROBLEMS}))
    axes[0][0].set_ylabel("Tree size (nodes)")
    axes[1][0].set_ylabel("Time to a plan (s)")
    handles: dict[str, Any] = {}
    for axis in axes.flat:
        axis.set_yscale("log")
        handles = dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True)) | handles
    labels = [f"{name}{origin}" for name in PLANNERS.values() for origin in ("", " (paper)")]
    shown = [label for label in labels if label in handles]
    figure.legend([handles[label] for label in shown], shown, loc="outside lower center", ncols=4)
    return figure


def _against_k(
    axis: Axes,
    problems: Sequence[paper.Problem],
    metrics: Metrics,
    quantity: str,
    limit: int | None,
) -> None:
    mean, std = QUANTITIES[quantity]
    for rank, (planner, name) in enumerate(PLANNERS.items()):
        style: dict[str, Any] = {
            "color": PLANNER_COLORS[planner],
            "marker": PLANNER_MARKERS[planner],
        }
        # Side by side, so that equal figures do not hide each other.
        shift = 0.07 * (rank - (len(PLANNERS) - 1) / 2)
        cells = [(p.k_min + shift, metrics[p.name].get(planner)) for p in problems]
        known = [(k, cell) for k, cell in cells if cell and cell[mean] is not None]
        if known:
            lengths = [k for k, _ in known]
            values = np.array([cell[mean] for _, cell in known])
            errors = np.array([cell[std] for _, cell in known])
            # On a log axis an error bar cannot reach zero.
            lower = np.minimum(errors, 0.9 * values)
            axis.errorbar(
                lengths, values, (lower, errors), elinewidth=0.7, capsize=1.5, label=name, **style
            )
        stopped = [k for k, cell in cells if cell and cell[mean] is None]
        # Guided search ends with its attempts, not at the limit.
        if limit is not None and stopped and planner != "guided":
            axis.plot(
                stopped,
                [limit] * len(stopped),
                "x",
                color=style["color"],
                markersize=6,
                zorder=3,
                label=None if known else name,
            )
        printed = [
            (p.k_min + shift, paper.SCALABILITY[p.name][planner][mean])
            for p in problems
            if planner in paper.SCALABILITY[p.name]
        ]
        if printed:
            axis.plot(
                *zip(*printed, strict=True),
                markerfacecolor="none",
                markersize=7.5,
                markeredgewidth=0.8,
                linestyle="--",
                linewidth=0.8,
                label=f"{name} (paper)",
                zorder=1.5,
                **style,
            )


@mpl.rc_context(_STYLE)
def success(problems: pd.DataFrame) -> Figure:
    """Shares of outcomes by type of objective, one panel per planner.

    Args:
        problems: columns planner, kind (type of objective) and outcome, one row per problem
            that is not satisfied at the start.
    """
    planners = [name for name in VARIANTS if name in set(problems["planner"])]
    kinds = sorted(set(problems["kind"]), key=lambda kind: (kind.count("+"), kind))
    figure, axes = _subplots(
        1, len(planners), PAGE, 0.6 + 0.24 * len(kinds), sharey=True, sharex=True
    )
    for axis, planner in zip(axes[0], planners, strict=True):
        rows = problems[problems["planner"] == planner]
        shares = pd.crosstab(rows["kind"], rows["outcome"], normalize="index")
        counts = rows["kind"].value_counts()
        left = np.zeros(len(kinds))
        for outcome, (label, color) in OUTCOMES.items():
            column = shares.get(outcome, pd.Series(dtype=float)).reindex(kinds).fillna(0.0)
            axis.barh(
                range(len(kinds)),
                100 * column,
                left=100 * left,
                color=color,
                label=label,
                height=0.72,
            )
            left += column.to_numpy()
        axis.set_title(VARIANTS[planner])
        axis.set_xlabel("Problems (%)")
        axis.set_xlim(0, 100)
        axis.grid(axis="y", visible=False)
    axes[0][0].set_yticks(
        range(len(kinds)), [f"{kind} (n = {counts.get(kind, 0)})" for kind in kinds]
    )
    axes[0][0].invert_yaxis()
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


@mpl.rc_context(_STYLE)
def learning_curves(curves: Mapping[str, Mapping[str, Sequence[float]]]) -> Figure:
    """Loss and accuracy by epoch of every sub-policy.

    Args:
        curves: by name of the sub-policy; training_loss, validation_loss, training_accuracy and
            validation_accuracy, one value per epoch.
    """
    figure, axes = _subplots(2, len(curves), PAGE, 3.2, sharex=True, sharey="row")
    for column, (title, values) in zip(axes.T, curves.items(), strict=True):
        for axis, quantity, scale in zip(column, ("loss", "accuracy"), (1, 100), strict=True):
            for split, color in (("training", "#AAAAAA"), ("validation", "#0072B2")):
                heights = scale * np.array(values[f"{split}_{quantity}"])
                axis.plot(range(1, len(heights) + 1), heights, color=color, label=split)
        column[0].set_title(title)
        column[1].set_xlabel("Epoch")
    axes[0][0].set_ylabel("Loss (nats)")
    axes[1][0].set_ylabel("Accuracy (%)")
    figure.legend(*axes[0][0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


@mpl.rc_context(_STYLE)
def confusion(matrices: Mapping[str, tuple[Sequence[str], np.ndarray]]) -> Figure:
    """Confusion of every sub-policy: rows the action of the data, columns the one predicted."""
    sizes = [len(labels) for labels, _ in matrices.values()]
    figure, axes = _subplots(1, len(matrices), PAGE, 2.1, width_ratios=[s + 0.5 for s in sizes])
    for axis, (title, (labels, counts)) in zip(axes[0], matrices.items(), strict=True):
        total = np.maximum(counts.sum(axis=1, keepdims=True), 1)
        shares = counts / total
        _heat(axis, shares, labels, labels, [[f"{100 * s:.0f}" for s in row] for row in shares])
        axis.set_title(f"{title}\n(n = {int(counts.sum()):,})", fontsize=8)
        axis.tick_params(labelsize=6.5, pad=1.5)
        axis.set_xlabel("predicted", fontsize=8)
    axes[0][0].set_ylabel("in the data")
    return figure


@mpl.rc_context(_STYLE)
def feasible_share(shares: pd.DataFrame) -> Figure:
    """Share of sequences that stay feasible with one more action, by its arm and table.

    Args:
        shares: columns instruction, gripper, table, n, feasible.
    """
    titles = {"grasp": "Grasp, from", "place": "Place, on"}
    figure, axes = _subplots(1, len(titles), PAGE, 1.7)
    for axis, (instruction, title) in zip(axes[0], titles.items(), strict=True):
        rows = shares[shares["instruction"] == instruction]
        tables = sorted(set(rows["table"]), key=lambda name: ("box" in name, name))
        arms = sorted(set(rows["gripper"]))
        cells = rows.set_index(["gripper", "table"])[["feasible", "n"]]
        pairs = [[cells.T.get((arm, table)) for table in tables] for arm in arms]
        share = np.array(
            [[np.nan if p is None else p["feasible"] / p["n"] for p in row] for row in pairs]
        )
        texts = [
            [
                "–" if p is None else f"{100 * p['feasible'] / p['n']:.0f}%\nn = {int(p['n']):,}"
                for p in row
            ]
            for row in pairs
        ]
        _heat(axis, share, arms, tables, texts)
        axis.set_title(title)
    return figure


@mpl.rc_context(_STYLE)
def failures(counts: pd.DataFrame) -> Figure:
    """Which constraint stays violated, by the action at which it does.

    Args:
        counts: index constraint, columns action (1, 2, …), values numbers of sequences.
    """
    figure, axes = _subplots(1, 1, PAGE, 0.8 + 0.24 * len(counts))
    axis = axes[0][0]
    left = np.zeros(len(counts))
    colors = mpl.colormaps["viridis"](np.linspace(0.1, 0.85, max(counts.shape[1], 2)))
    for color, action in zip(colors, counts.columns, strict=False):
        axis.barh(
            range(len(counts)),
            counts[action],
            left=left,
            color=color,
            label=f"action {action}",
            height=0.72,
        )
        left += counts[action].to_numpy()
    axis.set_yticks(range(len(counts)), counts.index)
    axis.invert_yaxis()
    axis.set_xlabel("Infeasible sequences")
    axis.grid(axis="y", visible=False)
    if not counts.empty:
        figure.legend(loc="outside right upper")
    return figure


def _heat(
    axis: Axes,
    values: np.ndarray,
    rows: Sequence[str],
    columns: Sequence[str],
    texts: Sequence[Sequence[str]],
) -> None:
    axis.imshow(values, cmap="Blues", vmin=0.0, vmax=1.0, aspect="auto")
    axis.set_xticks(range(len(columns)), columns)
    axis.set_yticks(range(len(rows)), rows)
    axis.grid(visible=False)
    axis.spines[:].set_visible(False)
    axis.tick_params(length=0)
    for i, row in enumerate(texts):
        for j, text in enumerate(row):
            dark = values[i, j] > 0.55
            axis.text(
                j,
                i,
                text,
                ha="center",
                va="center",
                fontsize=7,
                color="white" if dark else "#222222",
            )
