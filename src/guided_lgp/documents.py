"""Documents on disk: read with every fault in one line, written whole or not at all."""

import json
import math
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from guided_lgp.errors import InputError

LARGEST = 2**31
"""Bytes that a document may have: twice those of the scenes of a million configurations."""


def read_json(path: Path, accepted: str = "") -> Any:
    """Read a JSON document; numbers are finite, unlike those that :mod:`json` lets through.

    Args:
        path: the file.
        accepted: where such a file comes from, for the message.

    Raises:
        InputError: the file is missing, too large, not UTF-8 or not JSON.
    """
    where = str(path)
    try:
        with path.open("rb") as stream:
            content = stream.read(LARGEST + 1)  # not the file's size: devices and pipes have none
    except OSError as error:
        raise InputError(where, error.strerror or "cannot be read", accepted) from None
    if len(content) > LARGEST:
        raise InputError(where, f"is larger than {LARGEST // 2**20} MiB", accepted)
    try:
        text = content.decode("utf-8")
        return json.loads(text, parse_float=_finite, parse_constant=_finite)
    except UnicodeDecodeError as error:
        raise InputError(where, f"is not UTF-8 at byte {error.start}", accepted) from None
    except RecursionError:
        raise InputError(where, "is nested too deeply", accepted) from None
    except ValueError as error:
        raise InputError(where, f"is not JSON: {error}", accepted) from None


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text[:20]} is not a finite number")
    return value


def first_fault(error: ValidationError, where: str) -> InputError:
    """The first fault that pydantic found in a document, in one line with its field."""
    first = error.errors()[0]
    field = ".".join(str(part) for part in first["loc"])
    message = first["msg"].removeprefix("Value error, ")  # what our own validators say
    return InputError(f"{where}: {field}" if field else where, message)


def write_json(path: Path, document: Any) -> None:
    """Write a JSON document, the same bytes for the same content.

    Args:
        path: the file; its folder is made.
        document: what :mod:`json` can write, numbers finite.

    Raises:
        InputError: the file cannot be written.
    """
    write_text(path, json.dumps(document, indent=1, allow_nan=False) + "\n")


def write_text(path: Path, text: str) -> None:
    """Write a text in UTF-8.

    Args:
        path: the file; its folder is made.
        text: the whole content.

    Raises:
        InputError: the file cannot be written.
    """
    with written_whole(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8")


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Write a file such that nobody ever reads half of it, whatever ends the program or the disk.

    Args:
        path: the file; its folder is made. One process at a time writes it.

    Yields:
        The name to write to, beside the file and with its suffix; renamed at the end. After a
        kill it stays, and the next writer uses it again.

    Raises:
        InputError: the file cannot be written: the disk is full, the folder is read-only.
    """
    unfinished = path.with_name(f".unfinished-{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield unfinished
        unfinished.replace(path)
    except OSError as error:
        with suppress(OSError):
            unfinished.unlink(missing_ok=True)
        raise InputError(str(path), f"cannot be written: {error.strerror or error}") from error
