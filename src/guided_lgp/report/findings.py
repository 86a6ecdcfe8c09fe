"""What the tables say, in words."""

from collections.abc import Iterator

from guided_lgp.report import paper
from guided_lgp.report.inputs import Metrics
from guided_lgp.report.style import PLANNERS, VARIANTS
from guided_lgp.report.tables import number, percent, search_time

GUIDED = ("guided", "guided_best_first", "relational")
RIVALS = ("breadth_first", "breadth_first_graph", "astar")


def generalization(metrics: Metrics) -> list[str]:
    """One sentence per planner: shares of shortest solutions and of problems left unsolved."""
    sentences = []
    for variant, label in VARIANTS.items():
        if variant not in metrics:
            continue
        ours, unseen = metrics[variant]["all"], metrics[variant]["unseen"]
        printed = paper.GENERALIZATION.get(variant)
        reference = (
            f" (paper: {percent(printed['all']['shortest'])} and "
            f"{percent(printed['unseen']['shortest'])})"
            if printed
            else ""
        )
        sentences.append(
            f"{label}: the shortest solution in {percent(ours['shortest'])} of all "
            f"{ours['n']} problems and in {percent(unseen['shortest'])} of the {unseen['n']} with "
            f"unseen objectives{reference}; no solution in {percent(ours['no_solution'])} and "
            f"{percent(unseen['no_solution'])}."
        )
    return sentences


def scalability(metrics: Metrics, timing: Metrics) -> list[str]:
    """How guided search compares with breadth-first, and where a rival beats it."""
    sentences = list(_against_breadth_first(metrics, timing))
    sentences += _unsolved(metrics)
    for quantity, key, source, unit in (
        ("generates fewer nodes", "tree_size_mean", metrics, ""),
        ("needs less time", "time_mean_s", timing, " s"),
    ):
        beaten = list(_beaten(metrics, source, key, quantity, unit))
        sentences += beaten or [
            f"No rival (breadth-first, graph breadth-first, A*) {quantity} than guided search on "
            "any problem that it solves completely."
        ]
    return sentences


def _against_breadth_first(metrics: Metrics, timing: Metrics) -> Iterator[str]:
    ratios, faster, limited = [], [], []
    for problem in paper.PROBLEMS:
        cells = metrics.get(problem.name, {})
        if not {"breadth_first", "guided"} <= cells.keys():
            continue
        tree, guided = cells["breadth_first"], cells["guided"]["tree_size_mean"]
        if tree["tree_size_mean"] is None:
            limited.append(
                f"{problem.name} ({tree['problems_solved']} of {tree['problems']} solved)"
            )
        elif guided:
            ratios.append(f"{number(tree['tree_size_mean'] / guided, 0)}× on {problem.name}")
        slow, fast = (search_time(timing[problem.name][p]) for p in ("breadth_first", "guided"))
        if slow and fast:
            faster.append(f"{number(slow / fast)}× on {problem.name}")
    if ratios:
        yield f"The breadth-first tree is larger than the guided one by {_join(ratios)}."
    if faster:
        yield (
            "Guided search without the path bound (symbolic, policy and coarse time) is faster "
            f"than breadth-first by {_join(faster)}; a factor below 1 means slower."
        )
    if limited:
        yield f"Breadth-first met the limit of the tree size on {_join(limited)}."


def _unsolved(metrics: Metrics) -> Iterator[str]:
    """Per guided planner, the problems without a plan, if any."""
    for planner in GUIDED:
        cells = {name: row[planner] for name, row in metrics.items() if planner in row}
        missing = [
            f"{cell['problems'] - cell['problems_solved']} of {cell['problems']} on {name}"
            for name, cell in cells.items()
            if cell["problems_solved"] < cell["problems"]
        ]
        if missing:
            yield f"{PLANNERS[planner]} leaves without a plan: {_join(missing)}."
        elif cells:
            yield f"{PLANNERS[planner]} solves every problem with a verified path."


def _beaten(metrics: Metrics, source: Metrics, key: str, quantity: str, unit: str) -> Iterator[str]:
    """Where a rival that solves every problem has a lower mean than guided search."""
    for rival in RIVALS:
        wins = []
        for problem in paper.PROBLEMS:
            cells = metrics.get(problem.name, {})
            if not {rival, "guided"} <= cells.keys():
                continue
            if cells[rival]["problems_solved"] < cells[rival]["problems"]:
                continue
            theirs = source[problem.name][rival][key]
            guided = source[problem.name]["guided"][key]
            if guided is None or theirs < guided:
                decimals = 2 if unit else 1
                ours = f"{number(guided, decimals)}{unit}" if guided is not None else "no plan"
                wins.append(f"{problem.name} ({number(theirs, decimals)}{unit} against {ours})")
        if wins:
            yield f"{PLANNERS[rival]} {quantity} than guided search on {_join(wins)}."


def _join(parts: list[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
