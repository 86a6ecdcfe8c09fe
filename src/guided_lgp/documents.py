"""Documents on disk: read with every fault in one line, written whole or not at all."""

import fcntl
import json
import math
import os
import re
import secrets
import shutil
import stat
import sys
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from glob import escape
from pathlib import Path
from typing import Any, BinaryIO

import yaml

from guided_lgp.errors import InputError
from guided_lgp.strict_yaml import load_yaml, lone_surrogate

LARGEST = 2**31
"""Bytes that a document may have: twice those of the scenes of a million configurations."""
LARGEST_YAML = 2**20
"""Bytes of what people write: PyYAML takes up to ten seconds for so many."""
_BLOCK = 2**20
_SURROGATE = r"\\u[dD][89a-fA-F]"
STANDARD_OUTPUT = Path("-")
_UNFINISHED = ".unfinished-"
_LONGEST_END = 50
"""Characters of a file's name that its unfinished copy has, too: with four bytes each, it fits."""
_LEFTOVER_S = 60.0
"""Age of a leftover: a writer locks its file within microseconds."""


def read_text(path: Path, accepted: str = "", largest: int = LARGEST) -> str:
    """Read a text in UTF-8, of which there may be no end: devices and pipes have none.

    Args:
        path: the file.
        accepted: where such a file comes from, for the message.
        largest: bytes that it may have.

    Raises:
        InputError: the file is missing, too large or not UTF-8.
    """
    where = str(path)
    try:
        with path.open("rb") as stream:
            content = _beginning(stream, largest)
    except OSError as error:
        raise InputError(where, error.strerror or "cannot be read", accepted) from None
    except ValueError:  # a NUL, or half a pair of surrogates
        raise InputError(where, "is no name of a file", accepted) from None
    if len(content) > largest:
        raise InputError(where, f"is larger than {largest // 2**20} MiB", accepted)
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(where, f"is not UTF-8 at byte {error.start}", accepted) from None


def read_json(path: Path, accepted: str = "") -> Any:
    """Read a JSON document; numbers are finite, unlike those that :mod:`json` lets through.

    Args:
        path: the file.
        accepted: where such a file comes from, for the message.

    Raises:
        InputError: the file is missing, too large, not UTF-8 or not JSON.
    """
    return parse_json(read_text(path, accepted, LARGEST), str(path), accepted)


def parse_json(text: str, where: str, accepted: str = "") -> Any:
    """A JSON document in a text, as strictly.

    Args:
        text: the document.
        where: its name, for the message.
        accepted: where it comes from.

    Raises:
        InputError: it is none.
    """
    try:
        document = json.loads(
            text,
            parse_float=_finite,
            parse_int=_whole,
            parse_constant=_finite,
            object_pairs_hook=_without_duplicates,
        )
        return _in_unicode(document) if re.search(_SURROGATE, text) else document
    except RecursionError:
        raise InputError(where, "is nested too deeply", accepted) from None
    except ValueError as error:
        raise InputError(where, f"is not JSON: {error}", accepted) from None


def _beginning(stream: BinaryIO, largest: int) -> bytes:
    """What is in a stream, or a bit more than it may have.

    The size of the file does not tell: devices and pipes have none. Neither is all of it asked for
    at once, for which Python would take as much memory.
    """
    content = bytearray()
    while len(content) <= largest and (block := stream.read(_BLOCK)):
        content += block
    return bytes(content)


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text[:20]} is not a finite number")
    return value


def _whole(text: str) -> int:
    _finite(text)  # neither NumPy nor most of the models take an integer beyond a float
    return int(text)


def _without_duplicates(pairs: Iterable[tuple[Any, Any]]) -> dict[Any, Any]:
    """A mapping of pairs, each key once.

    Raises:
        ValueError: a key comes twice: which value counts, only its reader would know.
    """
    found: dict[Any, Any] = {}
    for key, value in pairs:
        if key in found:
            raise ValueError(f"has the key {key!r:.40} twice")
        found[key] = value
    return found


def _in_unicode(document: Any) -> Any:
    """The document, whose strings can be written again: no half of a pair of surrogates."""
    try:
        json.dumps(document, ensure_ascii=False).encode("utf-8")
    except UnicodeEncodeError as error:
        raise lone_surrogate(error) from None
    return document


def read_yaml(path: Path, accepted: str = "") -> Any:
    """Read a YAML document as strictly as :func:`read_json`.

    Args:
        path: the file.
        accepted: what such a file holds, for the message.

    Raises:
        InputError: the file is missing, not YAML, or has a key twice.
    """
    where, text = str(path), read_text(path, accepted, LARGEST_YAML)
    try:
        return load_yaml(text)
    except RecursionError:
        raise InputError(where, "is nested too deeply", accepted) from None
    except (yaml.YAMLError, ValueError, LookupError, AttributeError, OverflowError) as error:
        # PyYAML raises the last four for values that do not fit their tag, such as 2024-13-45.
        raise InputError(where, f"is not YAML: {' '.join(str(error).split())}", accepted) from None


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
                os.fchmod(descriptor, path.stat().st_mode & 0o777 | stat.S_IWUSR)
            yield unfinished
            os.fsync(descriptor)
            unfinished.replace(path)
        finally:
            with suppress(OSError):
                unfinished.unlink(missing_ok=True)
            os.close(descriptor)


def copy_whole(source: Path, target: Path) -> None:
    """Copy all files of a folder into another one, each whole or not at all.

    Raises:
        InputError: a file cannot be written.
    """
    for file in sorted(source.rglob("*")):
        if file.is_file():
            with written_whole(target / file.relative_to(source)) as unfinished:
                shutil.copyfile(file, unfinished)


@contextmanager
def made_whole(folder: Path) -> Iterator[Path]:
    """Make a folder such that nobody ever sees half of it, whatever ends the program.

    Args:
        folder: is not there, or is empty.

    Yields:
        The path of a folder to make, of the same name.

    Raises:
        InputError: the folder cannot be made, or is there with something in it.
    """
    with _named_errors(folder), unfinished_beside(folder) as own:
        yield own / folder.name
        (own / folder.name).rename(folder)


@contextmanager
def unfinished_beside(path: Path) -> Iterator[Path]:
    """A folder of this writer's own, for what will get its name when it is whole.

    It is gone at the end; what a killed writer left is taken away by the next one.

    Args:
        path: what is made; its folder is made, too.

    Raises:
        OSError: it cannot be made.
    """
    end = path.name[-_LONGEST_END:]
    path.parent.mkdir(parents=True, exist_ok=True)
    _remove_leftovers(path.parent, end)
    own = path.with_name(f"{_UNFINISHED}{secrets.token_hex(8)}-{end}")
    own.mkdir()
    descriptor = os.open(own, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        with suppress(OSError):  # of file systems without locks
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield own
    finally:
        with suppress(OSError):
            remove(own)
        os.close(descriptor)


def remove(entry: Path) -> None:
    """Remove a file, a link or a whole folder, if it is there; links are not followed.

    Raises:
        OSError: it cannot be removed.
    """
    if entry.is_dir() and not entry.is_symlink():
        shutil.rmtree(entry)
    else:
        entry.unlink(missing_ok=True)


def _remove_leftovers(folder: Path, end: str) -> None:
    """Remove what killed writers left: old enough to be locked, and nobody's lock."""
    for entry in folder.glob(f"{_UNFINISHED}*-{escape(end)}"):
        with suppress(OSError):
            if time.time() - entry.lstat().st_mtime > _LEFTOVER_S and _is_free(entry):
                remove(entry)


def _is_free(entry: Path) -> bool:
    descriptor = os.open(entry, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
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
