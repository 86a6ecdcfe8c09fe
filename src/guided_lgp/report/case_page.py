"""What came out of the cases, in the page for readers ``docs/cases.md``."""

from collections.abc import Iterator, Mapping

from guided_lgp.report.cases import TITLES, answers, carried_out
from guided_lgp.report.cells import NONE, number
from guided_lgp.report.metrics import Metrics
from guided_lgp.search.planners import CASE_PLANNERS


def came_out(cases: Mapping[str, Metrics], compared: Mapping[str, Metrics]) -> str:
    """Per case a small table, then what it says.

    Args:
        cases: by case, size and planner.
        compared: by case and size, calls of the policy against those of the best rival.
    """
    lines = [_INTRODUCTION]
    for (name, sizes), answer in zip(cases.items(), answers(compared).values(), strict=True):
        lines += ["", *_table(name, sizes), "", f"- {answer}"]
        lines += [f"- {text}" for text in (*_shares(compared[name]), carried_out(sizes))]
        lines.append(f"- {_easy(sizes, compared[name])}")
    return "\n".join([*lines, ""])


_INTRODUCTION = (
    "Problems solved within 100 calls of the coarse bound, and mean calls to a plan. Problems are "
    "scenes times trainings; the controls are trained once."
)


def _table(name: str, sizes: Mapping[str, Metrics]) -> Iterator[str]:
    """Solved problems and calls, by planner and size."""
    yield _row(TITLES.get(name, name), *(f"{size} boxes" for size in sizes))
    yield _row("---", *("---:" for _ in sizes))
    for planner in CASE_PLANNERS:
        cells = [sizes[size].get(planner) for size in sizes]
        if any(cells):
            yield _row(_label(planner), *map(_cell, cells))


def _label(planner: str) -> str:
    return CASE_PLANNERS[planner].label.replace("*", r"\*")


def _row(*cells: str) -> str:
    return f"| {' | '.join(cells)} |"


def _cell(cell: Metrics | None) -> str:
    if cell is None:
        return NONE
    return f"{cell['solved']} of {cell['problems']}, {number(cell['calls_mean'], 1)}"


def _shares(sizes: Mapping[str, Metrics]) -> Iterator[str]:
    """The policy's calls as shares of the best rival's, with all calls and without its facts."""
    for key, what in _COUNTED.items():
        shares = "; ".join(_share(ratios[key]) for ratios in sizes.values())
        yield f"Calls as a share of that search's with {', '.join(sizes)} boxes, {what}: {shares}."


_COUNTED = {"with_facts": "all calls counted", "facts_given": "its facts for free"}


def _share(ratio: Metrics) -> str:
    """With the interval of 95 % over scenes, and the rival."""
    interval = f"{ratio['low']:.2f} to {ratio['high']:.2f}"
    return f"{ratio['ratio']:.2f} ({interval}, {_label(ratio['rival'])})"


def _easy(sizes: Mapping[str, Metrics], compared: Mapping[str, Metrics]) -> str:
    """How many scenes leave little to learn."""
    found = []
    for size, planners in sizes.items():
        rival, control = planners[compared[size]["with_facts"]["rival"]], planners["no_policy"]
        easy, known = rival["solved_within_2k"], control["solved"]
        found.append(f"{size} boxes: {easy} and {known} of {rival['problems']}")
    return (
        "Scenes that leave little to learn, because that search needs at most two calls per "
        f"action, or because no policy and no facts are needed: {'; '.join(found)}."
    )
