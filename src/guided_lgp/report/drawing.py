"""The look of all figures, and how they are saved."""

from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from guided_lgp.documents import written_whole

WIDTH = 4.2
"""Width of a figure (in): on a telephone, which shows 3.7 in, its letters are still legible."""

STYLE: dict[Any, Any] = {
    "font.family": "STIXGeneral",
    "mathtext.fontset": "stix",
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.labelsize": 9.0,
    "legend.fontsize": 8.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.5,
    "lines.linewidth": 1.3,
    "lines.markersize": 4.5,
    "legend.frameon": False,
    "figure.constrained_layout.use": True,
    "svg.fonttype": "path",
    "svg.hashsalt": "guided-lgp",
    "savefig.dpi": 200,
}
"""Matplotlib's settings for every figure."""


@mpl.rc_context(STYLE)
def save(figure: Figure, folder: Path, name: str) -> None:
    """Write ``name.png`` and ``name.svg``; the same figure gives the same bytes."""
    with written_whole(folder / f"{name}.png") as file:
        figure.savefig(file, metadata={"Software": None})
    figure.set_layout_engine("none")  # keep the layout, which takes longer than drawing
    with written_whole(folder / f"{name}.svg") as file:
        figure.savefig(file, metadata={"Date": None, "Creator": None})


def subplots(
    rows: int, columns: int, width: float, height: float, **options: Any
) -> tuple[Figure, Any]:
    """A figure with a grid of axes, of a size in inches."""
    figure = Figure(figsize=(width, height))
    return figure, figure.subplots(rows, columns, squeeze=False, **options)
