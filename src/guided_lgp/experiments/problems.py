"""The scalability problems: Table II, and family e beyond it, with their objectives spelled out."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise, permutations, product

from guided_lgp.logic import Goal, Objective, Symbols

Boxes = Sequence[str]


@dataclass(frozen=True)
class ProblemClass:
    """A row of Table II, or of family e."""

    name: str
    setup: str
    target: str
    k_min: int
    """Least number of actions, by the logic alone."""
    objectives: Callable[[Boxes], list[Objective]]
    """The objectives, given the boxes of the setup."""
    reduced: bool = False
    """Starred in the paper: planners without a policy get fewer tables."""

    def unguided_symbols(self, symbols: Symbols) -> Symbols:
        """The symbols for planners without a policy."""
        if not self.reduced:
            return symbols
        return symbols.restricted(table=("tray", "tab2"))


def tower(boxes: Boxes, table: str | None = None) -> Objective:
    """Boxes on each other, the first one at the top; the last one on a table, if given."""
    goals = [Goal("on", (upper, lower)) for upper, lower in pairwise(boxes)]
    return tuple(goals if table is None else [*goals, Goal("on", (boxes[-1], table))])


def _stacks_of_three(boxes: Boxes) -> list[Objective]:
    """The ordered towers, and two boxes beside each other on the third."""
    pairs = [
        (Goal("on", (first, below)), Goal("on", (second, below)))
        for below in boxes
        for first, second in combinations([box for box in boxes if box != below], 2)
    ]
    return [tower(order) for order in permutations(boxes)] + pairs


def _towers_on_tray(boxes: Boxes) -> list[Objective]:
    """Six orders, evenly spread over all of them."""
    orders = list(permutations(boxes))
    return [tower(order, "tray") for order in orders[:: len(orders) // 6]]


def _assignment(supports: Mapping[str, str]) -> Objective:
    return tuple(Goal("on", (box, support)) for box, support in supports.items())


def _spread(boxes: Boxes, on_tray: Sequence[str]) -> Objective:
    return _assignment({box: "tray" if box in on_tray else "tab2" for box in boxes})


def _every_assignment(boxes: Boxes) -> list[Objective]:
    return [
        _assignment(dict(zip(boxes, tables, strict=True)))
        for tables in product(("tray", "tab2"), repeat=len(boxes))
    ]


def _two_on_tray(boxes: Boxes) -> list[Objective]:
    """Two boxes on the tray, the others on tab2: six choices, evenly spread over all."""
    pairs = list(combinations(boxes, 2))
    return [_spread(boxes, pairs[index * len(pairs) // 6]) for index in range(6)]


def _many_boxes(boxes: Boxes) -> list[Objective]:
    """Towers, splits over the supports, and both; one goal per box, and every box must move.

    Boxes start in turn on tab1 and on tab2, none on the tray.
    """
    left, right = boxes[::2], boxes[1::2]
    third, quarter = len(boxes) // 3, len(boxes) // 4
    across = dict.fromkeys(left[-quarter:], "tab2") | dict.fromkeys(right[-quarter:], "tab1")
    split = {box: across.get(box, "tray") for box in boxes}
    stacked = {left[0]: right[-1], right[0]: left[-1]}
    return [
        tower(boxes, "tray"),
        tower(left, "tray") + tower(right, "tray"),
        tower(right[:third], "tab1")
        + tower(left[:third], "tab2")
        + tower((*left[third:], *right[third:]), "tray"),
        _assignment(split),
        _assignment(split | stacked),
        tuple(goal for pair in zip(left, right, strict=True) for goal in tower(pair, "tray")),
    ]


PROBLEMS = (
    ProblemClass("a.1", "a", "stack boxes on table", 4, _stacks_of_three),
    ProblemClass("b.1", "b", "place boxes on tray/tab2", 6, _every_assignment, reduced=True),
    ProblemClass("b.2", "b", "stack boxes on tray", 6, _towers_on_tray),
    ProblemClass("c.1", "c", "place boxes on tray/tab2", 8, _two_on_tray, reduced=True),
    ProblemClass("c.2", "c", "stack boxes on tray", 8, _towers_on_tray),
    ProblemClass("d.1", "d", "place boxes on tray/tab2", 10, _two_on_tray, reduced=True),
    ProblemClass("d.2", "d", "stack boxes on tray", 10, _towers_on_tray),
    ProblemClass("e.6", "e6", "towers, splits and both", 12, _many_boxes),
    ProblemClass("e.8", "e8", "towers, splits and both", 16, _many_boxes),
    ProblemClass("e.10", "e10", "towers, splits and both", 20, _many_boxes),
)
