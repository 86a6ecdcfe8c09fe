"""The figure on the cases: what a plan costs against the number of boxes, by planner."""

from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from guided_lgp.report.cases import TITLES
from guided_lgp.report.drawing import STYLE, WIDTH, subplots
from guided_lgp.report.metrics import Metrics
from guided_lgp.search.planners import CASE_PLANNERS

_DRAWN: dict[str, dict[str, Any]] = {
    "no_policy": {"color": "#56B4E9", "marker": "v"},
    "astar": {"color": "#D55E00", "marker": "P"},
    "facts": {"color": "#E69F00", "marker": "^"},
    "facts_tuned": {"color": "#333333", "marker": "s"},
    "conflicts": {"color": "#009E73", "marker": "D"},
    "relational": {"color": "#CC79A7", "marker": "o", "linestyle": "--"},
    "relational_best_first": {"color": "#CC79A7", "marker": "o"},
}
"""Rivals and the policy, greedy (dashed) and complete; the tables have the controls, too."""

_MARGIN = 0.15
_LIMITS = 3, 120
_TICKS = 5, 10, 20, 50, 100
"""Calls, on an axis where equal distances are equal factors: they say what a policy saves."""


@mpl.rc_context(STYLE)
def calls(cases: Metrics) -> Figure:
    """Calls of the coarse bound against the number of boxes: a panel per case.

    Args:
        cases: by case, size and planner; a search without a plan counts with the limit.
    """
    figure, axes = subplots(len(cases), 1, WIDTH, 1.0 + 2.0 * len(cases))
    every_size = sorted({int(size) for sizes in cases.values() for size in sizes})
    for axis, (name, sizes) in zip(axes[:, 0], cases.items(), strict=True):
        axis.set_title(TITLES.get(name, name))
        axis.set_ylabel("Calls to a plan")
        for planner, style in _DRAWN.items():
            _curve(axis, planner, style, sizes)
        axis.set_yscale("log")
        axis.set_ylim(_LIMITS)
        axis.set_yticks(_TICKS, list(map(str, _TICKS)))
        axis.minorticks_off()
        axis.set_xlim(every_size[0] - _MARGIN, every_size[-1] + _MARGIN)
        axis.set_xticks(every_size)
    axes[-1, 0].set_xlabel("Boxes")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure


def _curve(axis: Axes, planner: str, style: dict[str, Any], sizes: Metrics) -> None:
    means = {
        int(size): planners[planner]["calls_limited_mean"]
        for size, planners in sizes.items()
        if planner in planners
    }
    axis.plot(list(means), list(means.values()), label=CASE_PLANNERS[planner].label, **style)
