"""How figures are written in cells of tables and in sentences."""

import math

from guided_lgp.report.inputs import all_solved
from guided_lgp.report.metrics import Metrics

NONE = "–"
"""Stands where there is no figure."""


def percent(fraction: float | None) -> str:
    """A fraction as a percentage with one decimal."""
    return NONE if fraction is None or math.isnan(fraction) else f"{100 * fraction:.1f}%"


def number(value: float | None, decimals: int = 1) -> str:
    """A number with a fixed number of decimals and thin groups of thousands."""
    return NONE if value is None or math.isnan(value) else f"{value:,.{decimals}f}"


def spread(mean: float | None, std: float | None) -> str:
    """Mean and standard deviation, both with as many decimals as fit the mean."""
    if mean is None or math.isnan(mean):
        return NONE
    decimals = 2 if mean < 10 else 1 if mean < 1000 else 0
    return f"{number(mean, decimals)} ± {number(std, decimals)}"


def solved_suffix(cell: Metrics) -> str:
    """What follows a mean over a part of the problems: (k/n) for k of n solved."""
    return "" if all_solved(cell) else f" ({cell['problems_solved']}/{cell['problems']})"


def search_time(times: Metrics) -> float | None:
    """Mean time (s) of a search without the path bound: symbolic, policy and coarse."""
    parts = [times[part] for part in ("symbolic_s", "policy_s", "coarse_s")]
    return None if None in parts else float(sum(parts))
