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
_COLUMNS = ("solved", "worst", "calls", "infeasible", "failed")
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
            carried_out(sizes),
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


def carried_out(sizes: Mapping[str, Metrics]) -> str:
    """How many of the plans have a verified path, and reach their goals under gravity."""
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


def comparison(compared: Mapping[str, Metrics]) -> Table:
    """Calls of the policy against those of the best search without one, by case and size."""
    rows = [
        (
            TITLES.get(name, name),
            size,
            number(ratios["with_facts"]["calls"], 1),
            *_against(ratios["with_facts"]),
            *_against(ratios["facts_given"]),
        )
        for name, sizes in compared.items()
        for size, ratios in sizes.items()
    ]
    return Table(
        name="cases_compared",
        title="What learning is worth: calls of the coarse bound to a plan",
        columns=("Case", "Boxes", "calls", *_AGAINST * 2),
        groups=(("", 2), ("Policy", 1), ("Best search without", 3), ("Its facts for free", 3)),
        rows=tuple(rows),
        notes=(
            "The policy, searched best-first, against the best search without learning; the policy "
            "is not charged for its training. Means over scenes; a search without a plan counts as "
            "100 calls. Share: the policy's calls as a share of the rival's, with an interval of "
            "95 % over scenes. Facts for free: the rival's questions about parts of a scene are "
            "not counted, as where many problems are solved in one scene.",
        ),
        labels=1,
    )


_AGAINST = ("calls", "planner", "share")


def _against(ratio: Metrics) -> tuple[str, ...]:
    interval = f"{ratio['ratio']:.2f} ({ratio['low']:.2f} to {ratio['high']:.2f})"
    return number(ratio["rival_calls"], 1), CASE_PLANNERS[ratio["rival"]].label, interval


def headline(sizes: Metrics) -> str:
    """The calls of the policy and of the best rival, for all sizes of a case in one sentence."""
    counted = [one["with_facts"] for one in sizes.values()]
    ours, rivals = (", ".join(number(one[key], 1) for one in counted) for key in _CALLS)
    return (
        f"a policy trained on three boxes needs {ours} calls of the coarse bound to a plan of "
        f"{', '.join(sizes)} boxes, the best search without learning {rivals}."
    )


_CALLS = ("calls", "rival_calls")


def answers(compared: Mapping[str, Metrics]) -> dict[str, str]:
    """Case by case, whether learning is worth it."""
    return {TITLES.get(name, name): _verdict(sizes) for name, sizes in compared.items()}


def _verdict(sizes: Mapping[str, Metrics]) -> str:
    half, more = _apart(sizes, "with_facts")
    _, convenient = _apart(sizes, "facts_given")
    amount, where = "at most" if half else "more than", "at every size"
    if half and more:
        where = f"with {_listed(half)} boxes, and more with {_listed(more)}"
    text = f"The policy needs {amount} half the calls of the best search without one {where}."
    if unclear := [size for size, ratios in sizes.items() if _spans_one(ratios["with_facts"])]:
        text += f" With {_listed(unclear)} boxes the interval does not tell who needs fewer."
    if convenient:
        text += (
            " Where many problems share a scene, so that its facts cost nothing, a search that "
            f"knows them needs less than twice the policy's calls with {_listed(convenient)} "
            "boxes: learning is a convenience there, not a necessity."
        )
    return text


def _spans_one(ratio: Metrics) -> bool:
    return bool(ratio["low"] <= 1 <= ratio["high"])


def _apart(sizes: Mapping[str, Metrics], counted: str) -> tuple[list[str], list[str]]:
    """The sizes at which the policy needs at most half of the rival's calls, and the others."""
    enough = {size: ratios[counted]["ratio"] <= _HALF for size, ratios in sizes.items()}
    return [size for size in sizes if enough[size]], [size for size in sizes if not enough[size]]


def _listed(names: list[str]) -> str:
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
