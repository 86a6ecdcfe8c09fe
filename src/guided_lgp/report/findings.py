"""What the tables say, in words."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence

from guided_lgp.experiments.problems import ProblemClass
from guided_lgp.report import paper
from guided_lgp.report.analysis import NEW, RENAMED, SEEN
from guided_lgp.report.cells import number, percent, search_time
from guided_lgp.report.inputs import Metrics, all_solved, compared
from guided_lgp.report.style import POLICIES
from guided_lgp.search.planners import GUIDED, RIVALS, TABLE_1, TABLE_3

AIM_SPEEDUP = 50
"""How much faster than breadth-first guided search should be on the longest problem that
breadth-first solves, path bound left out."""


def generalization(metrics: Metrics, calls: Mapping[str, float]) -> list[str]:
    """Per policy: shares of shortest solutions and of problems unsolved, beside the paper's.

    Args:
        metrics: by planner and set of objectives.
        calls: by planner, mean number of policy calls per action of the plan.
    """
    sentences = []
    for policy, name in POLICIES.items():
        variants = [v for v in TABLE_1 if v in metrics and TABLE_1[v].policy == policy]
        if not variants:
            continue
        parts = [
            f"{_shortest(metrics[v])} ({TABLE_1[v].strategy}; "
            f"{percent(metrics[v]['all']['no_solution'])} without a solution{_calls(calls.get(v))})"
            for v in variants
        ]
        sentences.append(f"{name}: shortest solutions, all / unseen objectives: {_join(parts)}.")
    missed = [
        f"{TABLE_1[v].strategy}, {subset}: {percent(metrics[v][subset]['shortest'])} against "
        f"{percent(printed[subset]['shortest'])}"
        for v, printed in paper.GENERALIZATION.items()
        if v in metrics
        for subset in printed
        if metrics[v][subset]["shortest"] < printed[subset]["shortest"]
    ]
    if missed:
        sentences.append(
            "With the paper's networks, trained as it tells, our shares of shortest solutions "
            f"stay below its own: {_join(missed)}."
        )
    return sentences


def _shortest(subsets: Metrics) -> str:
    return " / ".join(percent(subsets[subset]["shortest"]) for subset in ("all", "unseen"))


def _calls(calls: float | None) -> str:
    return "" if calls is None else f"; {number(calls, 2)} policy calls per action"


def unseen(kinds: Mapping[str, str], symmetric: Sequence[str]) -> str:
    """What "unseen" means for a policy to which all boxes are alike.

    Args:
        kinds: of every objective; see :func:`guided_lgp.report.analysis.novelty`.
        symmetric: names of the policies to which they are.
    """
    counts = Counter(kinds.values())
    total = counts[RENAMED] + counts[NEW]
    return (
        f"Of the {total} unseen objectives, {counts[RENAMED]} "
        f"({percent(counts[RENAMED] / max(total, 1))}) are one of the {counts[SEEN]} training "
        "objectives with its boxes renamed. The paper's networks have an input for every box and "
        "must generalize to these objectives. All boxes are alike to "
        f"{_join([f'the {name.lower()}' for name in symmetric])}, so that to a policy of this kind "
        f"they are not new. The other {counts[NEW]} are new under any names: objectives of one "
        "goal, which no training objective has, and pairs of goals of a kind that was not drawn."
    )


def scalability(metrics: Metrics, timing: Metrics) -> list[str]:
    """How guided search compares with breadth-first and the paper, and where a rival beats it.

    Args:
        metrics: by problem and planner.
        timing: as ``metrics``.
    """
    return [
        *_against_breadth_first(metrics, timing),
        *_against_the_paper(metrics),
        *_solved(metrics),
        *_many_boxes(metrics, timing),
        *_rivals(metrics, timing),
    ]


def _against_breadth_first(metrics: Metrics, timing: Metrics) -> Iterator[str]:
    nodes, faster, limited = [], {}, []
    for problem in compared(metrics):
        cells, times = metrics[problem.name], timing[problem.name]
        if not {"breadth_first", "guided"} <= cells.keys():
            continue
        tree, guided = cells["breadth_first"], cells["guided"]["tree_size_mean"]
        if tree["tree_size_mean"] is None:
            limited.append(
                f"{problem.name} ({tree['problems_solved']} of {tree['problems']} solved)"
            )
        elif guided:
            nodes.append(f"{number(tree['tree_size_mean'] / guided, 0)}× on {problem.name}")
        slow, fast = (search_time(times[planner]) for planner in ("breadth_first", "guided"))
        if slow and fast:
            faster[problem.name] = slow / fast
    if nodes:
        yield f"The breadth-first tree is larger than the guided one by {_join(nodes)}."
    if faster:
        ratios = [f"{number(ratio)}× on {name}" for name, ratio in faster.items()]
        yield (
            "Guided search without the path bound (symbolic, policy and coarse time) is faster "
            f"than breadth-first by {_join(ratios)}; a factor below 1 means slower."
        )
        last, ratio = list(faster.items())[-1]
        if ratio < AIM_SPEEDUP:
            tree = metrics[last]["breadth_first"]["tree_size_mean"]
            search = timing[last]["breadth_first"]["symbolic_s"]
            geometry = timing[last]["guided"]["coarse_s"]
            yield (
                f"The aim of {AIM_SPEEDUP}× in time on {last} is not reached: our own "
                f"breadth-first generates its {number(tree, 0)} nodes in {number(search, 2)} s, "
                f"and the coarse bounds of guided search alone take {number(geometry, 2)} s."
            )
    if limited:
        yield f"Breadth-first was stopped at a limit on {_join(limited)}."


def _against_the_paper(metrics: Metrics) -> Iterator[str]:
    """Where greedy guided search needs more nodes than the paper's."""
    larger = []
    for problem in compared(metrics):
        printed = paper.SCALABILITY.get(problem.name)
        ours = metrics[problem.name].get("guided")
        if printed is None or ours is None:
            continue
        mean, theirs = ours["tree_size_mean"], printed["guided"]["tree_size_mean"]
        if mean is not None and mean > theirs:
            larger.append(f"{problem.name} ({number(mean)} against {number(theirs)})")
    if larger:
        yield (
            "Greedy search with the paper's networks generates more nodes than the paper's on "
            f"{_join(larger)}."
        )


def _solved(metrics: Metrics) -> Iterator[str]:
    """Who solves every problem, and what the guided planners solve, the paper's problems apart."""
    printed, beyond = _printed_and_beyond(metrics)
    for problems, which in (
        (printed, "the paper's problems"),
        (beyond, "problems of 6 to 10 boxes"),
    ):
        complete, partial = [], []
        for planner, row in TABLE_3.items():
            cells = {
                p.name: metrics[p.name][planner] for p in problems if planner in metrics[p.name]
            }
            missing = [
                f"{cell['problems_solved']} of {cell['problems']} on {name}"
                for name, cell in cells.items()
                if not all_solved(cell)
            ]
            if cells and not missing:
                complete.append(row.label)
            elif planner in GUIDED and missing:
                partial.append(f"{row.label} solves {_join(missing)}")
        if complete:
            yield f"All {which} are solved, with a verified path, by {_join(complete)}."
        if partial:
            yield f"Not all {which}: {'; '.join(partial)}."


def _printed_and_beyond(metrics: Metrics) -> tuple[list[ProblemClass], list[ProblemClass]]:
    """The problems of which the paper prints figures, and the others."""
    problems = compared(metrics)
    return (
        [problem for problem in problems if problem.name in paper.SCALABILITY],
        [problem for problem in problems if problem.name not in paper.SCALABILITY],
    )


def _many_boxes(metrics: Metrics, timing: Metrics) -> Iterator[str]:
    """Problems beyond the paper's: effort of the relational policy, and what rivals solve."""
    _, problems = _printed_and_beyond(metrics)
    problems = [problem for problem in problems if "relational" in metrics[problem.name]]
    if not problems:
        return
    cells = [metrics[problem.name] for problem in problems]
    own = [cell["relational"] for cell in cells]
    seconds = [search_time(timing[problem.name]["relational"]) for problem in problems]
    solved = [
        f"{TABLE_3[planner].label} solves "
        f"{_join([str(c[planner]['problems_solved']) for c in cells])}"
        for planner in ("relational", *RIVALS)
        if all(planner in cell for cell in cells)
    ]
    yield (
        f"On {_join([problem.name for problem in problems])} "
        f"(K = {_join([str(problem.k_min) for problem in problems])}), of "
        f"{_join([str(cell['problems']) for cell in own])} problems, {', '.join(solved)}. "
        f"Relational takes {_join([number(cell['policy_calls_mean']) for cell in own])} policy "
        f"calls and {_join([number(value, 2) for value in seconds])} s on average without the "
        "path bound."
    )


def _rivals(metrics: Metrics, timing: Metrics) -> Iterator[str]:
    """Where a rival that solves every problem has a lower mean than guided search."""
    sizes = {
        name: {planner: cell["tree_size_mean"] for planner, cell in row.items()}
        for name, row in metrics.items()
    }
    times = {
        name: {planner: search_time(cell) for planner, cell in row.items()}
        for name, row in timing.items()
    }
    for quantity, figures in (
        ("generates fewer nodes", sizes),
        ("needs less time without the path bound", times),
    ):
        beaten = list(_beaten(metrics, figures))
        if beaten:
            yield f"What {quantity} than guided search: {'; '.join(beaten)}."
        else:
            yield (
                f"No rival without a trained policy {quantity} than guided search on any problem "
                "that it solves completely."
            )


def _beaten(metrics: Metrics, figures: Mapping[str, Mapping[str, float | None]]) -> Iterator[str]:
    """Per rival: where it beats the paper's guided search, and where every guided planner that
    solves the problem in all cases.
    """
    for rival in RIVALS:
        wins, best = [], []
        for problem in compared(metrics):
            cells, values = metrics[problem.name], figures[problem.name]
            theirs = values.get(rival)
            if theirs is None or not all_solved(cells[rival]):
                continue
            if "guided" in cells and ((ours := values["guided"]) is None or theirs < ours):
                wins.append(problem.name)
            others = [
                value
                for planner in GUIDED
                if planner in cells
                and all_solved(cells[planner])
                and (value := values[planner]) is not None
            ]
            if all(theirs < value for value in others):
                best.append(problem.name)
        parts = [f"Guided on {_join(wins)}"] if wins else []
        parts += [f"every guided planner on {_join(best)}"] if best else []
        if parts:
            yield f"{TABLE_3[rival].label} (than {', than '.join(parts)})"


def _join(parts: list[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
