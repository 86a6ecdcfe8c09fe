"""What the report says in words about its figures."""

from collections import Counter
from collections.abc import Mapping, Sequence

from guided_lgp.report import paper
from guided_lgp.report.analysis import NEW, RENAMED, SEEN
from guided_lgp.report.cells import number, percent, search_time
from guided_lgp.report.inputs import all_solved, compared
from guided_lgp.report.metrics import Metrics
from guided_lgp.report.scalability_figures import SOLVING
from guided_lgp.search.planners import BASELINE, BEST, CONTROL, PAPERS, TABLE_3

QUESTION = (
    "Can a small learned policy, which proposes the next action, take the place of exhaustive "
    "search in task and motion planning: in new scenes, for goals it has not been trained on, for "
    "longer tasks?"
)


def answers(generalization: Metrics, scalability: Metrics, timing: Metrics) -> dict[str, str]:
    """What the tables say to :data:`QUESTION`, in four sentences with their figures."""
    printed = paper.GENERALIZATION[PAPERS.table_1]
    ours, best, control = (generalization[row.table_1] for row in (PAPERS, BEST, CONTROL))
    return {
        "New scenes and goals": "With the paper's networks the plan is a shortest one in "
        f"{pair(ours)} of the problems, over all and over unseen objectives (paper: "
        f"{pair(printed)}); with the relational policy in {pair(best)}.",
        "Without a policy": "Best-first search, whose cost counts the actions still needed, finds "
        f"a shortest plan in {pair(control)} of the same problems.",
        "Size of the tree": tree(scalability, timing),
        "Longer tasks": many(scalability),
    }


def tree(metrics: Metrics, timing: Metrics) -> str:
    """How much smaller the guided tree is on the largest problem that breadth-first solves."""
    finished = [
        problem.name
        for problem in compared(metrics)
        if (cell := metrics[problem.name].get(BASELINE.name)) and all_solved(cell)
    ]
    if not finished:
        return "Breadth-first finishes no problem."
    last = finished[-1]
    compared_names = BASELINE.name, PAPERS.name
    nodes = [metrics[last][name]["tree_size_mean"] for name in compared_names]
    seconds = [search_time(timing[last][name]) for name in compared_names]
    faster = f"{seconds[0] / seconds[1]:.1f}" if seconds[0] and seconds[1] else "–"
    return (
        f"On {last}, the largest problem that breadth-first finishes, it generates "
        f"{number(nodes[0], 0)} nodes, guided search {number(nodes[1], 0)}. In time the factor is "
        f"{faster}: nodes are cheap, geometry is not."
    )


def many(metrics: Metrics) -> str:
    """How many problems beyond the paper's each planner of the figure solves."""
    beyond = [metrics[p.name] for p in compared(metrics) if p.name not in paper.SCALABILITY]
    if not beyond:
        return "No problem of more than 5 boxes was tried."
    counts = []
    for planner in SOLVING:
        cells = [cells[planner] for cells in beyond if planner in cells]
        done, given = (sum(cell[key] for cell in cells) for key in ("problems_solved", "problems"))
        counts.append(f"{TABLE_3[planner].label} {done}")
    return (
        f"Of {given} problems of 6 to 10 boxes, solved with a verified path: {'; '.join(counts)}."
    )


def pair(subsets: Metrics) -> str:
    """Shares of shortest plans over all and over unseen objectives."""
    return " / ".join(percent(subsets[subset]["shortest"]) for subset in ("all", "unseen"))


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


def _join(parts: list[str]) -> str:
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
