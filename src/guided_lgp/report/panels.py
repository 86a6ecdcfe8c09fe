"""Which panels a figure has, and the sentence that says what is not drawn.

What holds nearly everywhere needs no picture: the caption names planners, sub-policies and
instructions whose share is at least :data:`NEARLY_ALL`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from guided_lgp.report import analysis, figures
from guided_lgp.report.cells import percent
from guided_lgp.report.inputs import Inputs, sub_policies

NEARLY_ALL = 0.99
"""Share from which on a panel would be of one colour."""


@dataclass(frozen=True)
class Drawing:
    """A figure, and what its caption says of the rest."""

    figure: Figure
    rest: str = ""


def success(inputs: Inputs) -> Drawing:
    """Outcomes by type of objective, of the planners that miss some shortest plans."""
    problems = analysis.outcomes(inputs.problems, inputs.configurations)
    shortest = (problems["outcome"] == "shortest").groupby(problems["planner"]).mean()
    drawn, rest = _apart(shortest)
    text = (
        f"In our {len(rest)} other rows of Table I, {_least(rest)} of the problems get a shortest "
        "plan."
    )
    return Drawing(figures.success(problems[problems["planner"].isin(drawn)]), text if rest else "")


def confusion(inputs: Inputs) -> Drawing:
    """Confusion of the sub-policies that err."""
    matrices: dict[str, dict[str, tuple[list[str], np.ndarray]]] = {}
    for policy, name, report in sub_policies(inputs):
        matrices.setdefault(name, {})[policy] = report["classes"], np.array(report["confusion"])
    right = {
        name: min(np.trace(counts) / max(counts.sum(), 1) for _, counts in by_policy.values())
        for name, by_policy in matrices.items()
    }
    drawn, rest = _apart(right)
    names = "; ".join(name.replace(": ", ", ") for name in rest)
    text = f"Not drawn, right in {_least(rest)}: {names}." if rest else ""
    return Drawing(figures.confusion({name: matrices[name] for name in drawn}), text)


def feasible_share(inputs: Inputs) -> Drawing:
    """Where arms can act, for the instructions that are not feasible nearly everywhere."""
    shares = analysis.by_last_action(inputs.verdicts, inputs.configurations)
    totals = shares.groupby("instruction")[["feasible", "n"]].sum()
    drawn, rest = _apart(totals["feasible"] / totals["n"])
    figure = figures.feasible_share(shares[shares["instruction"].isin(drawn)])
    text = f"Not drawn, {_least(rest)}: {'; '.join(rest)}." if rest else ""
    return Drawing(figure, text)


def _apart(shares: Any) -> tuple[list[str], dict[str, float]]:
    """The names that are drawn, at least one, and the shares of the rest."""
    known = {str(name): float(share) for name, share in shares.items()}
    drawn = [name for name, share in known.items() if share < NEARLY_ALL]
    drawn = drawn or [min(known, key=lambda name: known[name])]
    return drawn, {name: share for name, share in known.items() if name not in drawn}


def _least(shares: Mapping[str, float]) -> str:
    least = percent(min(shares.values(), default=0.0))
    return least if least == percent(1.0) else f"at least {least}"
