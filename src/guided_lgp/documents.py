"""Documents on disk: read with every fault in one line, written whole or not at all."""

import fcntl
import json
import math
import os
import secrets
import stat
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from glob import escape
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from guided_lgp.errors import InputError

LARGEST = 2**31
"""Bytes that a document may have: twice those of the scenes of a million configurations."""
STANDARD_OUTPUT = Path("-")
_UNFINISHED = ".unfinished-"
_LONGEST_END = 50
"""Characters of a file's name that its unfinished copy has, too: with four bytes each, it fits."""
_LEFTOVER_S = 60.0
"""Age of a leftover: a writer locks its file within microseconds."""


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
    """Write a text in UTF-8: a file whole or not at all, a pipe or a device as it comes.

    Args:
        path: the file, whose folder is made; ``-`` is standard output.
        text: the whole content.

    Raises:
        InputError: the file cannot be written.
    """
    content = text.encode("utf-8")
    if path == STANDARD_OUTPUT:
        sys.stdout.buffer.write(content)
    elif is_stream(path):
        with _named_errors(path), path.open("wb") as stream:
            stream.write(content)
    else:
        with written_whole(path) as unfinished:
            unfinished.write_bytes(content)


def is_stream(path: Path) -> bool:
    """Whether a pipe, a device or a socket is there, of which nothing can be replaced."""
    return path.exists() and not path.is_file() and not path.is_dir()


@contextmanager
def written_whole(path: Path) -> Iterator[Path]:
    """Write a file such that nobody ever reads half of it, whatever ends the program or the disk.

    Several processes may write it: the last one's content stays, whole. A symbolic link is
    replaced, not followed. What a killed writer left is taken away by the next one.

    Args:
        path: the file; its folder is made.

    Yields:
        An empty file of this writer's own to write to, beside the target and with its suffix; it
        is on the disk when it takes the target's name.

    Raises:
        InputError: the file cannot be written: the disk is full, the folder is read-only.
    """
    end = path.name[-_LONGEST_END:]
    unfinished = path.with_name(f"{_UNFINISHED}{secrets.token_hex(8)}-{end}")
    with _named_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        _remove_leftovers(path.parent, end)
        flags = os.O_RDWR | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
        descriptor = os.open(unfinished, flags, 0o666)
        try:
            with suppress(OSError):  # of file systems without locks
                fcntl.flock(descriptor, fcntl.LOCK_EX)
            if path.is_file() and not path.is_symlink():
                os.fchmod(descriptor, stat.S_IMODE(path.stat().st_mode))
            yield unfinished
            os.fsync(descriptor)
            unfinished.replace(path)
        finally:
            with suppress(OSError):
                unfinished.unlink(missing_ok=True)
            os.close(descriptor)


def _remove_leftovers(folder: Path, end: str) -> None:
    """Remove what killed writers of a file left: old enough to be locked, and nobody's lock."""
    for file in folder.glob(f"{_UNFINISHED}*-{escape(end)}"):
        with suppress(OSError):
            if time.time() - file.lstat().st_mtime > _LEFTOVER_S and _is_free(file):
                file.unlink()


def _is_free(file: Path) -> bool:
    descriptor = os.open(file, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    finally:
        os.close(descriptor)
    return True


@contextmanager
def _named_errors(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise InputError(str(path), f"cannot be written: {error.strerror or error}") from error
