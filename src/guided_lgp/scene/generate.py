"""Random configurations of the setups."""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import combinations, cycle
from pathlib import Path

import numpy as np

from guided_lgp.documents import read_json, write_json
from guided_lgp.errors import InputError
from guided_lgp.scene.bodies import Box, Table
from guided_lgp.scene.footprints import footprint, gap, inset
from guided_lgp.scene.model import Scene, parse_scene
from guided_lgp.scene.setups import CLEARANCE, SETUPS, Setup

_VERSION = 1
_MAX_DRAWS = 10_000
_SLOT_GAP = 0.005
"""Least distance (m) between boxes on neighbouring slots, where no finger goes."""


@dataclass(frozen=True)
class GeneratedScenes:
    """Configurations of one setup, and how many draws the acceptance test rejected."""

    setup: str
    scenes: tuple[Scene, ...]
    rejected: int

    def save(self, path: Path) -> None:
        """Write the scenes as JSON, the same bytes for the same scenes."""
        document = {
            "version": _VERSION,
            "setup": self.setup,
            "rejected": self.rejected,
            "scenes": [scene.model_dump(mode="json") for scene in self.scenes],
        }
        write_json(path, document)


def load_scenes(path: Path) -> GeneratedScenes:
    """Read what :meth:`GeneratedScenes.save` wrote.

    Raises:
        InputError: the file is missing, of another version, or one of its fields has a fault.
    """
    where, origin = str(path), "the output of stage generate_scenes"
    document = read_json(path, origin)
    version = document.get("version") if isinstance(document, dict) else None
    if version != _VERSION:
        fault = f"is of version {version!r}"
        raise InputError(where, fault, f"version {_VERSION}, from stage generate_scenes")
    setup, listed, rejected = (document.get(key) for key in ("setup", "scenes", "rejected"))
    if not isinstance(setup, str) or setup not in SETUPS:
        raise InputError(f"{where}: setup", f"unknown setup {setup!r}", ", ".join(SETUPS))
    if not isinstance(listed, list) or not listed:
        raise InputError(f"{where}: scenes", "is not a list of at least one scene", origin)
    if type(rejected) is not int or rejected < 0:
        raise InputError(f"{where}: rejected", "is not a number of scenes", origin)
    scenes = tuple(
        parse_scene(scene, f"{where}: scenes.{index}") for index, scene in enumerate(listed)
    )
    return GeneratedScenes(setup, scenes, rejected)


def generate(
    setup: str,
    count: int,
    seed: int,
    prefix: str,
    accept: Callable[[Scene], bool] = lambda scene: True,
) -> GeneratedScenes:
    """Draw configurations of a setup.

    Each configuration has a random stream of its own, so that asking for more of them leaves the
    earlier ones as they were.

    Args:
        setup: one of :data:`guided_lgp.scene.setups.SETUPS`.
        count: how many.
        seed: of the random streams.
        prefix: of the scenes' names, ``prefix-000`` onwards.
        accept: a draw for which this returns False is counted and drawn again.

    Raises:
        InputError: unknown setup, or no acceptable configuration in 10,000 draws.
    """
    if setup not in SETUPS:
        raise InputError("setup", f"unknown setup {setup!r}", ", ".join(SETUPS))
    drawn = [
        _draw_accepted(SETUPS[setup], f"{prefix}-{index:03d}", _stream(setup, seed, index), accept)
        for index in range(count)
    ]
    return GeneratedScenes(
        setup, tuple(scene for scene, _ in drawn), sum(rejected for _, rejected in drawn)
    )


def _stream(setup: str, seed: int, index: int) -> np.random.Generator:
    entropy = (seed, sorted(SETUPS).index(setup))
    return np.random.default_rng(np.random.SeedSequence(entropy, spawn_key=(index,)))


def _draw_accepted(
    setup: Setup, name: str, rng: np.random.Generator, accept: Callable[[Scene], bool]
) -> tuple[Scene, int]:
    rejected = 0
    for _ in range(_MAX_DRAWS):
        boxes = _draw_on_slots(setup, rng) if setup.slots else _draw_anywhere(setup, rng)
        if boxes is None:
            continue
        scene = Scene(name=name, tables=setup.tables, boxes=boxes)
        if accept(scene):
            return scene, rejected
        rejected += 1
    raise InputError(f"scene {name}", f"no acceptable configuration in {_MAX_DRAWS} draws")


def _draw_anywhere(setup: Setup, rng: np.random.Generator) -> tuple[Box, ...] | None:
    """Boxes wholly on a random start table each, at any yaw; None if two are too close."""
    boxes = []
    for name in setup.boxes:
        table = _table(setup, str(rng.choice(setup.start_tables)))
        offset = rng.uniform(-1, 1, 2) * table.half_extents
        x, y = np.array(table.position[:2]) + offset
        box = _box(setup, name, table.name, x, y, rng.uniform(-np.pi / 2, np.pi / 2))
        if np.min(inset(footprint(table), footprint(box))) < 0:
            return None
        boxes.append(box)
    return tuple(boxes) if _apart(boxes, CLEARANCE) else None


def _draw_on_slots(setup: Setup, rng: np.random.Generator) -> tuple[Box, ...] | None:
    """Boxes on distinct random slots of the start tables in turn; None if two are too close."""
    shuffled = [setup.slots[index] for index in rng.permutation(len(setup.slots))]
    slots = {table: [s for s in shuffled if s.table == table] for table in setup.start_tables}
    boxes = []
    for name, table in zip(setup.boxes, cycle(setup.start_tables)):
        slot = slots[table].pop(0)
        dx, dy = rng.uniform(-setup.jitter, setup.jitter, 2)
        yaw = rng.uniform(-setup.yaw_jitter, setup.yaw_jitter)
        boxes.append(_box(setup, name, slot.table, slot.x + dx, slot.y + dy, yaw))
    return tuple(boxes) if _apart(boxes, _SLOT_GAP) else None


def _box(setup: Setup, name: str, table: str, x: float, y: float, yaw: float) -> Box:
    size = setup.box_size
    z = _table(setup, table).position[2] + size[2] / 2
    position = (round(float(x), 6), round(float(y), 6), round(z, 6))
    return Box(name=name, size=size, position=position, yaw=round(float(yaw), 6), on=table)


def _table(setup: Setup, name: str) -> Table:
    return next(table for table in setup.tables if table.name == name)


def _apart(boxes: list[Box], clearance: float) -> bool:
    return all(
        gap(footprint(one), footprint(other)) >= clearance for one, other in combinations(boxes, 2)
    )
