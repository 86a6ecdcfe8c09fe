"""Names and colours that tables, figures and pages share."""

from dataclasses import dataclass

POLICIES = {
    "paper": "Paper's networks",
    "improved": "Improved networks",
    "relational": "Relational policy",
    "uniform": "No policy (control)",
}
"""The policies, in the order of every table; the last one finds all actions equally good."""

PLANNERS = {
    "breadth_first": "Breadth-first",
    "breadth_first_graph": "Graph breadth-first",
    "astar": "A*",
    "uniform_best_first": "Best-first, no policy",
    "guided": "Guided",
    "guided_best_first": "Guided best-first",
    "improved": "Improved",
    "improved_best_first": "Improved best-first",
    "relational": "Relational",
    "relational_best_first": "Relational best-first",
}
"""Planners of the comparison of scalability, in the order of every table and legend."""

RIVALS = ("breadth_first", "breadth_first_graph", "astar", "uniform_best_first")
"""Planners without a trained policy."""

GUIDED = tuple(name for name in PLANNERS if name not in RIVALS)
"""Planners with one."""

POLICY_COLORS = {"paper": "#0072B2", "improved": "#009E73", "relational": "#CC79A7"}
"""Colours that readers with colour-blindness can tell apart (Okabe and Ito)."""

_GREEDY, _BEST_FIRST = {"marker": "o", "linestyle": "--"}, {"marker": "D"}
PLANNER_STYLES = {
    "breadth_first": {"color": "#333333", "marker": "s"},
    "breadth_first_graph": {"color": "#E69F00", "marker": "^"},
    "astar": {"color": "#D55E00", "marker": "P"},
    "uniform_best_first": {"color": "#56B4E9", "marker": "v"},
    "guided": {"color": POLICY_COLORS["paper"], **_GREEDY},
    "guided_best_first": {"color": POLICY_COLORS["paper"], **_BEST_FIRST},
    "improved": {"color": POLICY_COLORS["improved"], **_GREEDY},
    "improved_best_first": {"color": POLICY_COLORS["improved"], **_BEST_FIRST},
    "relational": {"color": POLICY_COLORS["relational"], **_GREEDY},
    "relational_best_first": {"color": POLICY_COLORS["relational"], **_BEST_FIRST},
}
"""A colour per policy, dashed where the search is greedy."""


@dataclass(frozen=True)
class Variant:
    """A planner of the test of generalization."""

    policy: str
    search: str


VARIANTS = {
    "default": Variant("paper", "default"),
    "adaptation": Variant("paper", "objective adaptation"),
    "best_first": Variant("paper", "best-first"),
    "improved_default": Variant("improved", "default"),
    "improved_adaptation": Variant("improved", "objective adaptation"),
    "improved_best_first": Variant("improved", "best-first"),
    "relational": Variant("relational", "objective adaptation"),
    "relational_best_first": Variant("relational", "best-first"),
    "uniform_best_first": Variant("uniform", "best-first"),
}
"""Planners of the test of generalization, in the order of Table I."""

NETWORKS = {"instruction": "μ_ins", "grasp": "μ_grasp", "place": "μ_place"}
"""The three networks of the paper's hierarchical policy."""
