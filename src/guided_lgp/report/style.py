"""Names and colours that tables, figures and pages share."""

PLANNERS = {
    "breadth_first": "Breadth-first",
    "guided": "Guided",
    "guided_best_first": "Guided best-first",
    "relational": "Relational",
    "breadth_first_graph": "Graph breadth-first",
    "astar": "A*",
}
"""Planners of the comparison of scalability, in the order of every table and legend."""

PLANNER_COLORS = {
    "breadth_first": "#555555",
    "guided": "#0072B2",
    "guided_best_first": "#009E73",
    "relational": "#CC79A7",
    "breadth_first_graph": "#E69F00",
    "astar": "#D55E00",
}
"""Colours that readers with colour-blindness can tell apart (Okabe and Ito)."""

PLANNER_MARKERS = {
    "breadth_first": "s",
    "guided": "o",
    "guided_best_first": "D",
    "relational": "v",
    "breadth_first_graph": "^",
    "astar": "P",
}

VARIANTS = {
    "default": "Default",
    "adaptation": "Objective adaptation",
    "best_first": "Best-first + adaptation",
    "relational": "Relational",
}
"""Planners of the test of generalization, in the order of Table I."""

NETWORKS = {"instruction": "μ_ins", "grasp": "μ_grasp", "place": "μ_place"}
"""The three networks of the hierarchical policy."""
