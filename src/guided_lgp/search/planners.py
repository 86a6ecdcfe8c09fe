"""The planners: which searches there are, and the rows in which experiments compare them.

The experiments, the report, the command line and :func:`guided_lgp.plan` take their lists from
here. Nothing heavy is imported before a search is called.
"""

from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

from guided_lgp.errors import InputError

if TYPE_CHECKING:
    from guided_lgp.search.problem import Problem
    from guided_lgp.search.result import SearchResult


@dataclass(frozen=True)
class Search:
    """A way to search."""

    function: str
    """``module:name`` in this package, of a function of a problem."""
    summary: str
    """What it does, for the help of the command line."""
    follows_policy: bool = False
    over_sequences: bool = True
    """Whether it keeps sequences apart that lead to one state, and may begin with a given one."""
    widens: bool = False
    """Whether it asks for further instructions itself, and only where the policy has failed."""

    def plan(self, problem: "Problem") -> "SearchResult":
        """Search for a plan."""
        module, name = self.function.split(":")
        found: SearchResult = getattr(import_module(f"{__package__}.{module}"), name)(problem)
        return found


SEARCHES: Mapping[str, Search] = {
    "complete": Search(
        "complete:plan",
        "guided first, best-first where that fails",
        follows_policy=True,
        widens=True,
    ),
    "guided": Search("guided:plan", "follow the policy, as in the paper", follows_policy=True),
    "doubting": Search(
        "guided:plan_with_doubts",
        "follow the policy, but doubt what has failed",
        follows_policy=True,
    ),
    "best-first": Search(
        "best_first:plan",
        "the policy, but going back to any other action where needed",
        follows_policy=True,
    ),
    "breadth-first": Search(
        "breadth_first:plan", "without a policy, as the original LGP", over_sequences=False
    ),
    "graph": Search("graph:plan", "breadth-first over distinct states", over_sequences=False),
    "astar": Search("best_first:plan_shortest", "A* with landmark-cut, without a policy"),
    "facts": Search("best_first:plan_with_facts", "A* with facts of the geometry"),
    "facts-tuned": Search("best_first:plan_tuned", "facts, with a hand-made estimate"),
    "conflicts": Search(
        "best_first:plan_with_conflicts", "without a policy, learning from what is infeasible"
    ),
    "discrepancy": Search(
        "best_first:plan_by_discrepancy",
        "best-first by the policy alone, for one that knows the geometry",
        follows_policy=True,
    ),
    "informed": Search(
        "best_first:plan_informed", "best-first, with facts of the geometry", follows_policy=True
    ),
}
"""Every search, by the name under which users ask for it."""

DEFAULT_SEARCH = "complete"
"""The one for users who do not ask for any."""

WITHOUT_POLICY = "best-first"
"""The one where a policy cannot score all actions: complete, whatever guides it."""


PAPER = "paper"
"""The paper's policy."""
UNIFORM = "uniform"
"""The policy that knows nothing: the control that shows what best-first search owes to its bound on
the missing actions alone."""


@dataclass(frozen=True, kw_only=True)
class Planner:
    """A search with the policy that it follows: a row of the tables, a curve of the figures."""

    name: str
    """Its key in Table III."""
    label: str
    search: str
    """One of :data:`SEARCHES`."""
    policy: str = ""
    """A declared one, or empty: none."""
    adapt: bool = True
    """Objective adaptation (paper, Sec. III-A)."""
    table_1: str = ""
    """Its key in Table I; empty if it takes no part in the test of generalization."""
    table_3: bool = True
    """Whether it takes part in the comparison of scalability."""
    printed: bool = False
    """Whether the paper has figures for it there."""
    drawn: bool = False
    """Whether figures have a curve of it; tables have all."""
    headline: bool = False
    """Whether the README has one."""
    carried_out: bool = False
    """Whether, in a case of its own, its plans get paths and are carried out."""
    color: str | None = None
    """If it is not that of its policy."""
    marker: str = "D"
    linestyle: str = "-"

    @property
    def trained(self) -> bool:
        """Whether it follows a trained policy."""
        return self.policy not in ("", UNIFORM)

    @property
    def strategy(self) -> str:
        """How it follows its policy, in words."""
        if self.search == "guided":
            return "objective adaptation" if self.adapt else "default"
        return self.search

    def plan(self, problem: "Problem") -> "SearchResult":
        """Search for a plan; the problem brings the policy."""
        return SEARCHES[self.search].plan(problem)


def _default(name: str, policy: str, table_1: str) -> Planner:
    """The paper's default: greedy, every goal encoded, in Table I alone."""
    return Planner(
        name=name,
        label=f"{policy.capitalize()}, default",
        search="guided",
        policy=policy,
        adapt=False,
        table_1=table_1,
        table_3=False,
    )


def _greedy(
    name: str, label: str, policy: str, table_1: str, *, drawn: bool = False, headline: bool = False
) -> Planner:
    return Planner(
        name=name,
        label=label,
        search="guided",
        policy=policy,
        table_1=table_1,
        printed=policy == PAPER,
        drawn=drawn,
        headline=headline,
        marker="o",
        linestyle="--",
    )


def _complete(name: str, label: str, policy: str, table_1: str) -> Planner:
    return Planner(name=name, label=label, search="best-first", policy=policy, table_1=table_1)


PLANNERS: Mapping[str, Planner] = {
    planner.name: planner
    for planner in (
        Planner(
            name="breadth_first",
            label="Breadth-first",
            search="breadth-first",
            printed=True,
            drawn=True,
            headline=True,
            color="#333333",
            marker="s",
        ),
        Planner(
            name="breadth_first_graph",
            label="Graph breadth-first",
            search="graph",
            drawn=True,
            color="#E69F00",
            marker="^",
        ),
        Planner(
            name="astar",
            label="A*",
            search="astar",
            drawn=True,
            headline=True,
            color="#D55E00",
            marker="P",
        ),
        Planner(
            name="uniform_best_first",
            label="Best-first, no policy",
            search="best-first",
            policy=UNIFORM,
            table_1="uniform_best_first",
            drawn=True,
            headline=True,
            marker="v",
        ),
        _default("guided_default", PAPER, "default"),
        _greedy("guided", "Guided", PAPER, "adaptation", drawn=True),
        _complete("guided_best_first", "Guided best-first", PAPER, "best_first"),
        _default("improved_default", "improved", "improved_default"),
        _greedy("improved", "Improved", "improved", "improved_adaptation"),
        _complete("improved_best_first", "Improved best-first", "improved", "improved_best_first"),
        _greedy("relational", "Relational", "relational", "relational", drawn=True, headline=True),
        _complete(
            "relational_best_first", "Relational best-first", "relational", "relational_best_first"
        ),
    )
}
"""Every planner that the experiments compare, in the order of the tables and legends."""

CASE_PLANNERS: Mapping[str, Planner] = {
    planner.name: planner
    for planner in (
        Planner(name="no_policy", label="No policy", search="best-first", policy=UNIFORM),
        Planner(name="astar", label="A*", search="astar"),
        Planner(name="facts", label="A*, facts", search="facts"),
        Planner(name="facts_tuned", label="Facts, tuned", search="facts-tuned"),
        Planner(name="conflicts", label="Conflicts", search="conflicts"),
        Planner(
            name="relational",
            label="Relational",
            search="doubting",
            policy="full",
            carried_out=True,
        ),
        Planner(
            name="relational_best_first",
            label="Relational best-first",
            search="discrepancy",
            policy="full",
        ),
        Planner(
            name="relational_informed",
            label="Relational, informed",
            search="informed",
            policy="full",
        ),
        *(
            Planner(name=f"relational_{name}", label=label, search="doubting", policy=name)
            for name, label in (
                ("no_relative_geometry", "Relational without relative geometry"),
                ("no_sizes", "Relational without sizes"),
                ("shuffled", "Relational, shuffled labels"),
            )
        ),
    )
}
"""The planners of the cases; their policies are those of a case: the full one and its controls."""

TABLE_3 = {name: planner for name, planner in PLANNERS.items() if planner.table_3}
"""Planners of the comparison of scalability, in the order of every table and legend."""

RIVALS = tuple(name for name, planner in TABLE_3.items() if not planner.trained)
"""Of these, the ones without a trained policy."""

GUIDED = tuple(name for name, planner in TABLE_3.items() if planner.trained)
"""Of these, the ones with one."""


def the_one(which: str, fits: Callable[[Planner], object]) -> Planner:
    """The planner of the comparison of scalability that fits.

    Raises:
        InputError: none does, or more than one.
    """
    found = [planner for planner in TABLE_3.values() if fits(planner)]
    if len(found) != 1:
        names = ", ".join(planner.name for planner in found) or "none"
        raise InputError("planners.py: PLANNERS", f"{names} is {which}", "one planner")
    return found[0]


BASELINE = the_one("printed without a policy", lambda one: one.printed and not one.policy)
"""What the paper compares itself with."""
PAPERS = the_one("printed with a policy", lambda one: one.printed and one.policy)
"""What the paper proposes, with its figures."""
CONTROL = the_one("the uniform policy's", lambda one: one.policy == UNIFORM)
"""What best-first search owes to itself."""
BEST = the_one("a headline and trained", lambda one: one.headline and one.trained)
"""What this work has to show beside the paper's."""


def controls_last(planners: Iterable[Planner]) -> list[Planner]:
    """Planners in the order in which they run: trained ones, the control, those without policy."""
    return sorted(planners, key=lambda planner: (not planner.policy, not planner.trained))


TABLE_1 = {
    planner.table_1: planner for planner in controls_last(PLANNERS.values()) if planner.table_1
}
"""Planners of the test of generalization, in the order of Table I, by their keys there."""


def check_planners(policies: Collection[str]) -> None:
    """Refuse a search or a row that lacks a part, or names what nobody has declared.

    Raises:
        InputError: names the search or row, and what is known.
    """
    for name, search in SEARCHES.items():
        _require(f"planners.py: search {name}", search, "function", "summary")
    for planner in PLANNERS.values():
        where = f"planners.py: planner {planner.name}"
        _require(where, planner, "name", "label")
        if planner.search not in SEARCHES:
            fault = f"{planner.search!r} is unknown"
            raise InputError(f"{where}, search", fault, ", ".join(SEARCHES))
        if planner.policy and planner.policy not in policies:
            fault = f"{planner.policy!r} is unknown"
            raise InputError(f"{where}, policy", fault, ", ".join(policies))
        if bool(planner.policy) != SEARCHES[planner.search].follows_policy:
            fault = f"is {planner.policy!r}, which {planner.search} does not follow"
            raise InputError(f"{where}, policy", fault, ", ".join(policies))
        if not planner.policy:
            _require(where, planner, "color")


def _require(where: str, declared: object, *parts: str) -> None:
    for part in parts:
        if not getattr(declared, part):
            raise InputError(f"{where}, {part}", "is missing")
