"""Names and colours that tables, figures, pages and replays share."""

import zlib

from matplotlib.colors import to_rgb

PLANNERS = {
    "breadth_first": "Breadth-first",
    "guided": "Guided",
    "guided_best_first": "Guided, best-first",
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

_BOX_COLORS = {
    "red": "#C8443C",
    "green": "#4C9A50",
    "blue": "#3D6FB6",
    "yellow": "#E3B93C",
    "orange": "#E08A3C",
    "purple": "#8A63A8",
    "pink": "#D98BA8",
    "cyan": "#4FA9B5",
    "white": "#EDEDED",
    "black": "#333333",
}


def box_color(name: str) -> str:
    """The colour of a box: the one it is named after, or one chosen by its name."""
    palette = list(_BOX_COLORS.values())
    return _BOX_COLORS.get(name, palette[zlib.crc32(name.encode()) % len(palette)])


def box_rgb(name: str) -> tuple[int, int, int]:
    """:func:`box_color` as three numbers from 0 to 255."""
    red, green, blue = (round(255 * channel) for channel in to_rgb(box_color(name)))
    return red, green, blue
