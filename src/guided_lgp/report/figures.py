"""The figures of the report, as matplotlib figures, and their deterministic saving."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from guided_lgp.documents import written_whole
from guided_lgp.experiments.problems import ProblemClass
from guided_lgp.report import paper
from guided_lgp.report.inputs import Metrics, all_solved, compared
from guided_lgp.report.style import POLICIES, POLICY_COLORS, planner_style
from guided_lgp.report.tables import search_time
from guided_lgp.search.planners import RIVALS, TABLE_1, TABLE_3

COLUMN = 3.45
"""Width of a column of a two-column page (in)."""
PAGE = 7.1
"""Width of both columns (in)."""

STYLE: dict[Any, Any] = {
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
"""Matplotlib's settings for every figure."""

OUTCOMES = {
    "shortest": ("Shortest", "#0072B2"),
    "feasible": ("Feasible, longer", "#9CC8E3"),
    "no_solution": ("No solution", "#D55E00"),
}


@mpl.rc_context(STYLE)
def save(figure: Figure, folder: Path, name: str) -> None:
    """Write ``name.png`` and ``name.svg``; the same figure gives the same bytes."""
    with written_whole(folder / f"{name}.png") as file:
        figure.savefig(file, metadata={"Software": None})
    figure.set_layout_engine("none")  # keep the layout, which takes longer than drawing
    with written_whole(folder / f"{name}.svg") as file:
        figure.savefig(file, metadata={"Date": None, "Creator": None})


def _subplots(
    rows: int, columns: int, width: float, height: float, **options: Any
) -> tuple[Figure, Any]:
    figure = Figure(figsize=(width, height))
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


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
    figure, axes = _subplots(1, 2, PAGE, 3.7)
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
    figure, axes = _subplots(
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


@mpl.rc_context(STYLE)
def success(problems: pd.DataFrame) -> Figure:
    """Shares of outcomes by type of objective, one panel per planner.

    Args:
        problems: columns planner, kind (type of objective) and outcome, one row per problem
            that is not satisfied at the start.
    """
    planners = [name for name in TABLE_1 if name in set(problems["planner"])]
    policies = list(dict.fromkeys(TABLE_1[name].policy for name in planners))
    rows_of = [[n for n in planners if TABLE_1[n].policy == policy] for policy in policies]
    kinds = sorted(set(problems["kind"]), key=lambda kind: (kind.count("+"), kind))
    figure, axes = _subplots(
        len(policies),
        max(map(len, rows_of)),
        PAGE,
        0.6 + len(policies) * (0.3 + 0.16 * len(kinds)),
        sharey=True,
        sharex=True,
    )
    for axis in axes.flat:
        axis.set_visible(False)
    for planner in planners:
        variant = TABLE_1[planner]
        number = policies.index(variant.policy)
        place = rows_of[number].index(planner)
        axis = axes[number][place]
        axis.set_visible(True)
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
        axis.set_title(f"{POLICIES[variant.policy]}:\n{variant.strategy}")
        axis.set_yticks(
            range(len(kinds)), [f"{kind} (n = {counts.get(kind, 0)})" for kind in kinds]
        )
        axis.tick_params(labelbottom=True, labelleft=place == 0)
        axis.set_xlim(0, 100)
        axis.grid(axis="y", visible=False)
    axes[0][0].invert_yaxis()
    for axis in axes[-1]:
        axis.set_xlabel("Problems (%)")
    handles = axes[0][0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=3)
    return figure


@mpl.rc_context(STYLE)
def learning_curves(curves: Mapping[str, Mapping[str, Mapping[str, Sequence[float]]]]) -> Figure:
    """Loss and accuracy by epoch of every sub-policy.

    Args:
        curves: by name of the sub-policy and policy; training_loss, validation_loss,
            training_accuracy and validation_accuracy, one value per epoch.
    """
    figure, axes = _subplots(2, len(curves), PAGE, 3.3, sharex="col", sharey="row")
    for column, (title, policies) in zip(axes.T, curves.items(), strict=True):
        for axis, quantity, scale in zip(column, ("loss", "accuracy"), (1, 100), strict=True):
            for policy, values in policies.items():
                for split, style in _SPLITS.items():
                    heights = scale * np.array(values[f"{split}_{quantity}"])
                    axis.plot(
                        range(1, len(heights) + 1),
                        heights,
                        color=POLICY_COLORS[policy],
                        label=f"{POLICIES[policy]}, {split}",
                        **style,
                    )
        column[0].set_title(title.replace(": ", ":\n"))
        column[1].set_xlabel("Epoch")
    axes[0][0].set_ylabel("Loss (nats)")
    axes[1][0].set_ylabel("Accuracy (%)")
    handles: dict[str, Any] = {}
    for axis in axes.flat:
        handles |= dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True))
    figure.legend(handles.values(), handles, loc="outside lower center", ncols=3)
    return figure


_SPLITS: dict[str, dict[str, Any]] = {
    "training": {"linewidth": 0.8, "alpha": 0.45},
    "validation": {"linewidth": 1.2},
}


@mpl.rc_context(STYLE)
def confusion(matrices: Mapping[str, Mapping[str, tuple[Sequence[str], np.ndarray]]]) -> Figure:
    """Confusion of every sub-policy: rows the action of the data, columns the one predicted.

    Args:
        matrices: by policy and name of the sub-policy, labels and counts.
    """
    columns = max(matrices.values(), key=len)
    sizes = [len(labels) + 0.5 for labels, _ in columns.values()]
    figure, axes = _subplots(
        len(matrices), len(sizes), PAGE, 2.1 * len(matrices), width_ratios=sizes
    )
    for row, (policy, chain) in zip(axes, matrices.items(), strict=True):
        for axis in row[len(chain) :]:
            axis.set_visible(False)
        for axis, (title, (labels, counts)) in zip(row, chain.items(), strict=False):
            total = np.maximum(counts.sum(axis=1, keepdims=True), 1)
            shares = counts / total
            _heat(axis, shares, labels, labels, [[f"{100 * s:.0f}" for s in row] for row in shares])
            lines = (*title.split(": "), f"(n = {int(counts.sum()):,})")
            axis.set_title("\n".join(lines), fontsize=8)
            axis.tick_params(labelsize=6.5, pad=1.5)
            axis.set_xlabel("predicted", fontsize=8)
        row[0].set_ylabel(f"{POLICIES[policy]}\nin the data")
    return figure


@mpl.rc_context(STYLE)
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


@mpl.rc_context(STYLE)
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
