"""Tables on disk: written whole or not at all, refused if of another version."""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType

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


def columns_of(schema: pa.Schema, names: Collection[str], filled: Collection[str]) -> pa.Schema:
    """Some columns of a table, for :func:`read_columns`.

    Args:
        schema: of the whole table.
        names: the columns, in this order.
        filled: those without null.
    """
    return pa.schema([schema.field(name).with_nullable(name not in filled) for name in names])


def read_columns(
    path: Path,
    stage: str,
    columns: pa.Schema,
    known: Mapping[str, Collection[str]] = MappingProxyType({}),
) -> pa.Table:
    """Read columns of a Parquet file, of these types and, unless they may be, without null.

    Args:
        path: the file.
        stage: the stage that makes it, for the message.
        columns: those wanted.
        known: the values that a column may have, where these are names.

    Raises:
        InputError: the file is missing, damaged or of another version, or has other types or
            unknown names.
    """
    remedy = f"the output of stage {stage}"
    with _readable(path, remedy) as parquet:
        table = parquet(columns.names)
        for column in columns:
            found = table.schema.field(column.name).type
            if not pa.types.is_null(found) and _kind(found) != _kind(column.type):
                fault = f"has {found} in the column {column.name!r}, not {column.type}"
                raise InputError(str(path), fault, remedy)
        table = table.cast(columns)
        table.validate(full=True)  # strings that are no UTF-8, for instance
    for name, accepted in known.items():
        for value in table[name].unique().to_pylist():
            if value is not None and value not in accepted:
                raise InputError(f"{path}: {name}", f"unknown {value!r}", remedy)
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
def _readable(path: Path, remedy: str) -> Iterator[Callable[[Sequence[str]], pa.Table]]:
    """A function that reads columns; what goes wrong is one line.

    Raises:
        InputError: see above.
    """

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
