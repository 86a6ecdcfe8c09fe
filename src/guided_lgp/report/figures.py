"""The figures of the report on generalization, training and feasibility."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from guided_lgp.domains import load_domain
from guided_lgp.report.drawing import PAGE, STYLE, subplots
from guided_lgp.report.style import POLICIES, POLICY_COLORS
from guided_lgp.search.planners import TABLE_1

OUTCOMES = {
    "shortest": ("Shortest", "#0072B2"),
    "feasible": ("Feasible, longer", "#9CC8E3"),
    "no_solution": ("No solution", "#D55E00"),
}


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
    figure, axes = subplots(
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
    figure, axes = subplots(2, len(curves), PAGE, 3.3, sharex="col", sharey="row")
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
    figure, axes = subplots(
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
    titles = {
        one.name: f"{one.name.capitalize()}, {'from' if one.into_hand else 'on'}"
        for one in load_domain().instructions
    }
    figure, axes = subplots(1, len(titles), PAGE, 1.7)
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
    figure, axes = subplots(1, 1, PAGE, 0.8 + 0.24 * len(counts))
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
