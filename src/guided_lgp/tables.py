"""Tables on disk: written whole or not at all, refused if of another version."""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from guided_lgp.documents import written_whole
from guided_lgp.errors import InputError

_VERSION = b"1"
_KEY = b"guided_lgp"


def write_table(path: Path, table: pa.Table) -> None:
    """Write a Parquet file, each page with its checksum.

    Raises:
        InputError: the file cannot be written.
    """
    stamped = table.replace_schema_metadata({_KEY: _VERSION})
    with written_whole(path) as unfinished:
        pq.write_table(stamped, unfinished, write_page_checksum=True)


def read_table(path: Path, stage: str, columns: Sequence[str]) -> list[dict[str, Any]]:
    """Read columns of a Parquet file as one dictionary per row.

    Args:
        path: the file.
        stage: the stage that makes it, for the message.
        columns: those wanted.

    Raises:
        InputError: the file is missing, damaged or of another version.
    """
    with _readable(path, stage) as parquet:
        rows: list[dict[str, Any]] = parquet(columns).to_pylist()
    return rows


def read_columns(path: Path, stage: str, columns: pa.Schema) -> pa.Table:
    """Read columns of a Parquet file, of these types and, unless they may be, without null.

    Raises:
        InputError: the file is missing, damaged or of another version, or has other types.
    """
    with _readable(path, stage) as parquet:
        table = parquet(columns.names)
        for column in columns:
            found = table.schema.field(column.name).type
            if not pa.types.is_null(found) and _kind(found) != _kind(column.type):
                fault = f"has {found} in the column {column.name!r}, not {column.type}"
                raise InputError(str(path), fault, f"the output of stage {stage}")
        table = table.cast(columns)
        table.validate(full=True)  # strings that are no UTF-8, for instance
    return table


def _kind(column: pa.DataType) -> str:
    """What a column holds, whatever its width; Arrow would convert one kind to another."""
    kinds = {
        "text": pa.types.is_string(column) or pa.types.is_large_string(column),
        "numbers": pa.types.is_integer(column) or pa.types.is_floating(column),
        "lists": pa.types.is_list(column) or pa.types.is_large_list(column),
    }
    return next((kind for kind, holds in kinds.items() if holds), str(column))


@contextmanager
def _readable(path: Path, stage: str) -> Iterator[Callable[[Sequence[str]], pa.Table]]:
    """A function that reads columns; what goes wrong is one line.

    Raises:
        InputError: see above.
    """
    remedy = f"the output of stage {stage}"

    def read(columns: Sequence[str]) -> pa.Table:
        version = (pq.read_schema(path).metadata or {}).get(_KEY)
        if version != _VERSION:
            raise InputError(str(path), "is of another version", remedy)
        table = pq.read_table(path, columns=list(columns), page_checksum_verification=True)
        if missing := set(columns) - set(table.column_names):
            raise InputError(str(path), f"has no column {min(missing)!r}", remedy)
        return table

    try:
        yield read
    except InputError:
        raise
    except (OSError, ValueError, KeyError, pa.ArrowException) as error:
        missing = isinstance(error, FileNotFoundError)
        fault = "is missing" if missing else f"cannot be read: {' '.join(str(error).split())}"
        raise InputError(str(path), fault, remedy) from None
