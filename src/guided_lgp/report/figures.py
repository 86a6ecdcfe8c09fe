"""The figures of the report on generalization, training and feasibility."""

from collections.abc import Mapping, Sequence

import matplotlib as mpl
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from guided_lgp.domains import load_domain
from guided_lgp.report.drawing import STYLE, WIDTH, subplots
from guided_lgp.report.style import POLICIES
from guided_lgp.search.planners import TABLE_1

OUTCOMES = {
    "shortest": ("Shortest", "#0072B2"),
    "feasible": ("Feasible, longer", "#9CC8E3"),
    "no_solution": ("No solution", "#D55E00"),
}


@mpl.rc_context(STYLE)
def success(problems: pd.DataFrame) -> Figure:
    """Shares of outcomes by type of objective, one panel per planner below the other.

    Args:
        problems: columns planner, kind (type of objective) and outcome, one row per problem
            that is not satisfied at the start.
    """
    planners = [name for name in TABLE_1 if name in set(problems["planner"])]
    kinds = sorted(set(problems["kind"]), key=lambda kind: (kind.count("+"), kind))
    height = 0.6 + len(planners) * (0.4 + 0.17 * len(kinds))
    figure, axes = subplots(len(planners), 1, WIDTH, height, sharex=True)
    for axis, planner in zip(axes[:, 0], planners, strict=True):
        rows = problems[problems["planner"] == planner]
        _stacked(axis, rows, kinds)
        axis.set_title(f"{POLICIES[TABLE_1[planner].policy]}: {TABLE_1[planner].strategy}")
    axes[-1][0].set_xlabel("Problems (%)")
    handles = axes[0][0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=3)
    return figure


def _stacked(axis: Axes, rows: pd.DataFrame, kinds: list[str]) -> None:
    """A bar per type of objective, in parts by outcome."""
    shares = pd.crosstab(rows["kind"], rows["outcome"], normalize="index")
    counts = rows["kind"].value_counts()
    left = np.zeros(len(kinds))
    for outcome, (label, color) in OUTCOMES.items():
        column = 100 * shares.get(outcome, pd.Series(dtype=float)).reindex(kinds).fillna(0.0)
        axis.barh(range(len(kinds)), column, left=left, color=color, label=label, height=0.72)
        left += column.to_numpy()
    axis.set_yticks(range(len(kinds)), [f"{kind} (n = {counts.get(kind, 0)})" for kind in kinds])
    axis.set_xlim(0, 100)
    axis.invert_yaxis()
    axis.grid(axis="y", visible=False)


@mpl.rc_context(STYLE)
def confusion(matrices: Mapping[str, Mapping[str, tuple[Sequence[str], np.ndarray]]]) -> Figure:
    """Confusion of sub-policies: rows the action of the data, columns the one predicted.

    Args:
        matrices: by name of the sub-policy and policy, labels and counts.
    """
    policies = list(dict.fromkeys(policy for row in matrices.values() for policy in row))
    sizes = [len(next(iter(row.values()))[0]) for row in matrices.values()]
    height = 0.9 + sum(0.6 + 0.3 * size for size in sizes)
    figure, axes = subplots(
        len(matrices), len(policies), WIDTH, height, height_ratios=[size + 1.5 for size in sizes]
    )
    for row, (title, by_policy) in zip(axes, matrices.items(), strict=True):
        for axis, policy in zip(row, policies, strict=True):
            axis.set_visible(policy in by_policy)
            if policy in by_policy:
                labels, counts = by_policy[policy]
                shares = counts / np.maximum(counts.sum(axis=1, keepdims=True), 1)
                texts = [[f"{100 * share:.0f}" for share in line] for line in shares]
                _heat(axis, shares, labels, labels, texts)
                axis.set_title(f"{title.replace(': ', ', ')} (n = {int(counts.sum()):,})")
        row[0].set_ylabel("in the data")
    for top, bottom, policy in zip(axes[0], axes[-1], policies, strict=True):
        top.set_title(f"{POLICIES[policy]}\n\n{top.get_title()}")
        bottom.set_xlabel("predicted")
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
        if one.name in set(shares["instruction"])
    }
    figure, axes = subplots(len(titles), 1, WIDTH, 1.6 * len(titles))
    for axis, (instruction, title) in zip(axes[:, 0], titles.items(), strict=True):
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
    figure, axes = subplots(1, 1, WIDTH, 1.2 + 0.24 * len(counts))
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
        figure.legend(loc="outside lower center", ncols=2)
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
                fontsize=8,
                color="white" if dark else "#222222",
            )
