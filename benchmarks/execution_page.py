"""The page of the documentation with the figures of ``benchmarks/execution.py``."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

_TITLES = {
    "friction_loaded": "friction alone, μ = 0.6, hands that carry boxes on the one that they hold",
    "friction_noise_5mm": "friction alone, μ = 0.6, boxes misplaced by 5 mm",
    "closed_loop_8mm": "towers of five, boxes misplaced by 8 mm, in closed loop",
    "open_loop": "the same plans in open loop",
    "disturbed": "closed loop, a box moved, dropped or taken away: survived, or named in one line",
}


PARTS = {"plans", "towers", "friction", "duration_ratio", *_TITLES} - {"open_loop"}
"""Keys of the figures that the page needs."""


def page(figures: Mapping[str, Any]) -> str:
    """The page of the figures."""
    cells = figures | {"open_loop": figures["closed_loop_8mm"]["open_loop"]}
    rows = [("random plans of 4, 6 and 8 actions", figures)]
    rows += [(f"towers of {n}", cell) for n, cell in figures["towers"].items()]
    rows += [(f"friction alone, μ = {mu}", cell) for mu, cell in figures["friction"].items()]
    rows += [(title, cells[key]) for key, title in _TITLES.items()]
    lines = [
        f"| {title} | {cell['succeeded']} | {cell['plans']} | {_failures(cell['faults'])} |"
        for title, cell in rows
    ]
    head = ["| | succeeded | plans | what failed |", "| :--- | ---: | ---: | :--- |"]
    return "\n\n".join((_TITLE, _ORIGIN, "\n".join((*head, *lines)), _shares(figures)))


_TITLE = "# Plans carried out"
_ORIGIN = """\
Plans as `guided-lgp plan` gives them, by motors under gravity; what counts as success is in
[Carrying out a plan](execution.md). Boxes are rigid in the hand where nothing is said of friction.
Misplaced ones are off by a normal error along x and y with this standard deviation. Made by
`make verify-execution` from scenes that nothing else uses; figures with all faults:
`reports/metrics/execution.json`."""


def _failures(faults: Sequence[str]) -> str:
    """How often each kind of fault happened."""
    kinds = Counter(fault.split()[0] if fault else "goal" for fault in faults)
    return ", ".join(f"{count} `{kind}`" for kind, count in sorted(kinds.items()))


def _shares(figures: Mapping[str, Any]) -> str:
    ratios, disturbed = figures["duration_ratio"], figures["disturbed"]
    both, one, best = (
        f"{ratios[row]['median']:.2f} in the median and {ratios[row]['worst']:.2f} at most"
        for row in ("both_arms", "one_arm", "candidates_8")
    )
    return (
        "Of the random plans:\n\n"
        "- rows outside any limit, of position, velocity, acceleration, jerk and effort: "
        f"{figures['rows_outside_limits']}\n"
        f"- share of the time in which no arm moves: {100 * figures['waiting_share']:.0f} %\n"
        "- smallest distance from what is not touched: "
        f"{figures['smallest_clearance_mm']:.1f} mm\n\n"
        "Plans of random actions take, as a share of those that version 0.1.0 makes of them, with "
        f"both arms {both}, with one {one}. For two random goals in the setups a to e.10, the best "
        f"of eight plans (`--candidates 8`) takes {best} of what that version's plan does.\n\n"
        f"{disturbed['survived']} of the {disturbed['plans']} disturbed plans reached all goals; "
        "for the others, one line says what hinders them.\n"
    )
