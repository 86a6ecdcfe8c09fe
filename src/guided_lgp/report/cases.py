"""The cases beside the paper's: the report shows them without depending on them."""

from collections.abc import Mapping

from guided_lgp.report.cells import NONE, number, percent
from guided_lgp.report.metrics import Metrics
from guided_lgp.report.table import Record, Table
from guided_lgp.search.planners import CASE_PLANNERS

TITLES = {"rows": "Crowded rows", "rows_decoys": "Rows with decoys"}
QUESTION = (
    "On the paper's problems the goals alone tell what to do next. Where boxes stand side by side, "
    "a taller neighbour leaves no room for the fingers and has to make way first, which no symbol "
    "says. Is a policy that sees sizes and gaps, trained on three boxes, worth more there than the "
    "best searches without one?"
)
_HALF = 0.5
_COLUMNS = ("solved, %", "worst", "calls", "infeasible", "failed")
"""Of one size."""


def table(name: str, sizes: Mapping[str, Metrics]) -> Table:
    """Problems solved within the limit and calls to a plan, by planner and size."""
    rows: list[tuple[str, ...]] = []
    records: list[Record] = []
    for planner, row in CASE_PLANNERS.items():
        cells = [sizes[size].get(planner) for size in sizes]
        if not any(cells):
            continue
        rows.append((row.label, *(text for cell in cells for text in _texts(cell))))
        records += [
            {"case": name, "size": size, "planner": planner, **cell}
            for size, cell in zip(sizes, cells, strict=True)
            if cell
        ]
    return Table(
        name=f"case_{name}",
        title=f"{TITLES.get(name, name)}: plans within 100 calls of the coarse bound",
        columns=("Planner", *_COLUMNS * len(sizes)),
        groups=(("", 1), *((f"{size} boxes", len(_COLUMNS)) for size in sizes)),
        rows=tuple(rows),
        notes=(
            "Trained on three boxes. Share of scenes times trainings, and of the worst training; "
            "calls of the coarse bound to a plan, means over the solved, and those of them with a "
            "verdict against the sequence; failed: sequences that reach the goals and that the "
            "bound refused. Questions about parts of a scene, from which facts and conflicts come, "
            "are calls like any other.",
            _carried_out(sizes),
        ),
        records=records,
    )


def _texts(cell: Metrics | None) -> tuple[str, ...]:
    if cell is None:
        return (NONE,) * len(_COLUMNS)
    per_training = cell["problems"] / cell["trainings"]
    return (
        percent(cell["solved"] / cell["problems"]),
        percent(cell["solved_min"] / per_training),
        number(cell["calls_mean"], 1),
        number(cell["infeasible_calls_mean"], 1),
        number(cell["failed_candidates_mean"], 1),
    )


def _carried_out(sizes: Mapping[str, Metrics]) -> str:
    found = []
    for size, planners in sizes.items():
        for name in ("relational", "relational_best_first"):
            cell = planners.get(name)
            if cell and cell["path_verified_share"] is not None:
                paths = percent(cell["path_verified_share"])
                physics = percent(cell["physics_share"])
                label = CASE_PLANNERS[name].label.lower()
                found.append(f"{size} boxes, {label}: {paths} and {physics}")
    return (
        "Of the plans of the first training, the share with a verified path, and of these the "
        f"share that reaches its goals under gravity: {'; '.join(found)}."
    )


def answers(compared: Metrics) -> list[str]:
    """What learning is worth against the best rival without it, size by size."""
    return [f"{TITLES.get(name, name)}: {_sentence(sizes)}" for name, sizes in compared.items()]


def _sentence(sizes: Mapping[str, Metrics]) -> str:
    texts = []
    for size, ratios in sizes.items():
        counted, given = ratios["with_facts"], ratios["facts_given"]
        rival, free = (CASE_PLANNERS[one["rival"]].label for one in (counted, given))
        texts.append(
            f"{size} boxes: {number(counted['calls'], 1)} calls against "
            f"{number(counted['rival_calls'], 1)} of the best rival ({rival}), "
            f"{_interval(counted)}; were its facts there already, against "
            f"{number(given['rival_calls'], 1)} ({free}), {_interval(given)}"
        )
    return f"{'; '.join(texts)}. {_verdict(sizes)}"


def _interval(ratio: Metrics) -> str:
    return f"{ratio['ratio']:.2f} of them ({ratio['low']:.2f} to {ratio['high']:.2f})"


def _verdict(sizes: Mapping[str, Metrics]) -> str:
    more = [size for size, one in sizes.items() if one["with_facts"]["ratio"] > _HALF]
    as_good = [size for size, one in sizes.items() if one["facts_given"]["ratio"] > _HALF]
    half = (
        "The policy needs at most half the calls at every size."
        if not more
        else f"The policy needs more than half the calls with {_listed(more)} boxes."
    )
    if as_good:
        half += (
            " Where the facts cost nothing, because many problems are solved in one scene, a "
            "search that knows them needs fewer than twice the calls of the policy with "
            f"{_listed(as_good)} boxes: then learning is a convenience, not a necessity."
        )
    return half


def _listed(names: list[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
