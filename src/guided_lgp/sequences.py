"""The tables of the enumeration: their columns, and how later stages read them."""

from collections.abc import Collection, Iterable, Mapping
from pathlib import Path

import pyarrow as pa

from guided_lgp.errors import InputError
from guided_lgp.logic import Objective, Skeleton, format_objective, parse_skeleton
from guided_lgp.scene import Scene
from guided_lgp.tables import columns_of, read_columns

STAGE = "enumerate_sequences"

VERDICTS = pa.schema(
    [
        ("configuration", pa.string()),
        ("skeleton", pa.string()),
        ("length", pa.int32()),
        ("feasible", pa.bool_()),
        ("failure_action", pa.int32()),
        ("failure_constraint", pa.string()),
        ("failure_violation", pa.float64()),
        ("states", pa.list_(pa.float64())),
    ]
)
"""``states``: for feasible sequences, positions (length + 1, symbols, 3) in m, flattened; symbols
in the order grippers, boxes, surfaces; state k: after k actions, the arms retreated."""

SHORTEST = pa.schema(
    [
        ("configuration", pa.string()),
        ("objective", pa.string()),
        ("symbolic_length", pa.int32()),
        ("length", pa.int32()),
    ]
)
"""``length``: 0 if the objective holds at the start, null if no sequence was found feasible."""

_FILLED = ("configuration", "skeleton", "feasible", "objective")
"""Columns without null."""
_REMEDY = f"the output of stage {STAGE} for the same scenes"


def read_verdicts(path: Path, *columns: str, of: Iterable[Scene] | None = None) -> pa.Table:
    """Columns of :data:`VERDICTS`.

    Args:
        path: the file.
        columns: those wanted.
        of: the scenes that the file may speak of; by default, any.

    Raises:
        InputError: the file is missing, damaged, of another version or of other scenes.
    """
    known = {} if of is None else {"configuration": {scene.name for scene in of}}
    return read_columns(path, STAGE, columns_of(VERDICTS, columns, _FILLED), known)


def feasible_sequences(path: Path, scenes: Iterable[Scene]) -> Mapping[str, tuple[Skeleton, ...]]:
    """The feasible sequences of every scene, by its name.

    Raises:
        InputError: the file is missing or damaged, or has what is no sequence.
    """
    found: dict[str, list[Skeleton]] = {scene.name: [] for scene in scenes}
    for row in read_verdicts(path, "configuration", "skeleton", "feasible").to_pylist():
        if row["feasible"] and row["configuration"] in found:
            try:
                found[row["configuration"]].append(parse_skeleton(row["skeleton"]))
            except InputError as error:
                raise InputError(f"{path}: skeleton", str(error), _REMEDY) from None
    return {name: tuple(skeletons) for name, skeletons in found.items()}


def read_shortest(
    path: Path, scenes: Iterable[Scene], objectives: Collection[Objective]
) -> Mapping[str, Mapping[str, int | None]]:
    """Shortest feasible length by scene and objective.

    Args:
        path: the file.
        scenes: those that are asked for.
        objectives: of which every scene must have a length.

    Raises:
        InputError: the file is missing, damaged or of another version, has an objective twice, or
            lacks one.
    """
    columns = columns_of(SHORTEST, ("configuration", "objective", "length"), _FILLED)
    lengths: dict[str, dict[str, int | None]] = {}
    for row in read_columns(path, STAGE, columns).to_pylist():
        known = lengths.setdefault(row["configuration"], {})
        if row["objective"] in known:
            raise InputError(str(path), "has an objective of a configuration twice", _REMEDY)
        known[row["objective"]] = row["length"]
    for scene in scenes:
        for text in map(format_objective, objectives):
            if text not in lengths.get(scene.name, {}):
                raise InputError(str(path), f"lacks {scene.name} {text}", _REMEDY)
    return lengths
