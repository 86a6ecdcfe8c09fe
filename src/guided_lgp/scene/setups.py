"""The setups of the experiments: tables, trays, boxes and where they may start (paper, Fig. 4).

The numbers are chosen so that every objective of setup a can be reached from nearly every
configuration while a good part of the action sequences cannot be carried out.
"""

from dataclasses import dataclass

from guided_lgp.scene.bodies import Table

BOX_SIZE = (0.15, 0.07, 0.10)
"""Extents (m). The fingers close across the 7 cm; on a 12 cm high box no two others could stand."""

TAB1 = Table(name="tab1", position=(0.54, 0.33, 0.60), half_extents=(0.17, 0.20))
TAB2 = Table(name="tab2", position=(0.54, -0.33, 0.60), half_extents=(0.17, 0.20))
TRAY = Table(name="tray", position=(0.53, 0.0, 0.63), half_extents=(0.16, 0.11))
"""3 cm above the tables, so that a box that overhangs the tray does not touch them."""

LOW_BOX_SIZE = (0.10, 0.06, 0.07)
"""Extents (m) of the many boxes of family e: ten of them on each other stay within reach."""

SIDE1 = Table(name="tab1", position=(0.54, 0.38, 0.60), half_extents=(0.19, 0.21))
SIDE2 = Table(name="tab2", position=(0.54, -0.38, 0.60), half_extents=(0.19, 0.21))
WIDE_TRAY = Table(name="tray", position=(0.54, 0.0, 0.63), half_extents=(0.18, 0.15))
"""Family e: both arms reach the tray and the inner edge of either table, where nothing starts."""

CLEARANCE = 0.06
"""Free space (m) that the open fingers need beside a box."""


@dataclass(frozen=True)
class Slot:
    """A place where a box may start: table, and its centre (m) with the jitter added to it."""

    table: str
    x: float
    y: float


@dataclass(frozen=True)
class Setup:
    """Symbols and start positions of one setup.

    With ``slots`` empty, boxes start anywhere on ``start_tables`` at any yaw, ``CLEARANCE``
    apart; otherwise on distinct slots of those tables in turn, their long side towards the robot.
    """

    tables: tuple[Table, ...]
    boxes: tuple[str, ...]
    start_tables: tuple[str, ...]
    slots: tuple[Slot, ...] = ()
    box_size: tuple[float, float, float] = BOX_SIZE
    jitter: float = 0.005
    """Largest displacement from a slot along each axis (m)."""
    yaw_jitter: float = 0.1
    """Largest yaw on a slot (rad)."""


_COLOURS = (
    *("red", "green", "blue", "yellow", "purple"),
    *("orange", "white", "black", "pink", "brown"),
)
_TABLES = (TAB1, TAB2, TRAY)
_SLOTS = tuple(Slot("tab1", x, y) for y in (0.19, 0.33, 0.47) for x in (0.455, 0.625))
_SIDE_SLOTS = tuple(
    Slot(table, x, side * y)
    for table, side in (("tab1", 1), ("tab2", -1))
    for y in (0.33, 0.47)
    for x in (0.42, 0.54, 0.66)
)


def _many(count: int) -> Setup:
    """Family e: boxes in turn on the outer slots of both tables."""
    tables = (SIDE1, SIDE2, WIDE_TRAY)
    return Setup(tables, _COLOURS[:count], ("tab1", "tab2"), _SIDE_SLOTS, LOW_BOX_SIZE)


SETUPS: dict[str, Setup] = {
    "a": Setup((TAB1, TAB2), _COLOURS[:3], ("tab1", "tab2")),
    "b": Setup(_TABLES, _COLOURS[:3], ("tab1",), _SLOTS),
    "c": Setup(_TABLES, _COLOURS[:4], ("tab1",), _SLOTS),
    "d": Setup(_TABLES, _COLOURS[:5], ("tab1",), _SLOTS),
    "e6": _many(6),
    "e8": _many(8),
    "e10": _many(10),
}
