"""The tables of the enumeration: their columns, and how later stages read them."""

from collections.abc import Mapping
from pathlib import Path

import pyarrow as pa

from guided_lgp.errors import InputError
from guided_lgp.tables import read_columns

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

_ALWAYS = ("configuration", "skeleton", "feasible", "objective")
"""Columns without null."""


def read_verdicts(path: Path, *columns: str) -> pa.Table:
    """Columns of :data:`VERDICTS`.

    Raises:
        InputError: the file is missing, damaged or of another version.
    """
    return read_columns(path, STAGE, _schema(VERDICTS, columns))


def read_shortest(path: Path) -> Mapping[str, Mapping[str, int | None]]:
    """Shortest feasible length by configuration and objective.

    Raises:
        InputError: the file is missing, damaged or of another version, or has an objective twice.
    """
    columns = _schema(SHORTEST, ("configuration", "objective", "length"))
    lengths: dict[str, dict[str, int | None]] = {}
    for row in read_columns(path, STAGE, columns).to_pylist():
        known = lengths.setdefault(row["configuration"], {})
        if row["objective"] in known:
            fault = "has an objective of a configuration twice"
            raise InputError(str(path), fault, f"the output of stage {STAGE}")
        known[row["objective"]] = row["length"]
    return lengths


def _schema(whole: pa.Schema, columns: tuple[str, ...]) -> pa.Schema:
    return pa.schema([whole.field(name).with_nullable(name not in _ALWAYS) for name in columns])
