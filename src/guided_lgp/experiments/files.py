"""Tables on disk: written whole or not at all, refused if of another version."""

from collections.abc import Sequence
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
    remedy = f"the output of stage {stage}"
    try:
        version = (pq.read_schema(path).metadata or {}).get(_KEY)
        if version != _VERSION:
            raise InputError(str(path), "is of another version", remedy)
        table = pq.read_table(path, columns=list(columns), page_checksum_verification=True)
        if missing := set(columns) - set(table.column_names):
            raise InputError(str(path), f"has no column {min(missing)!r}", remedy)
        rows: list[dict[str, Any]] = table.to_pylist()
    except InputError:
        raise
    except (OSError, ValueError, KeyError, pa.ArrowException) as error:
        fault = "is missing" if isinstance(error, FileNotFoundError) else "cannot be read"
        raise InputError(str(path), fault, remedy) from None
    return rows
