"""Files that a command is to write: refused before the work begins, not after it."""

import os
import stat
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from guided_lgp.documents import STANDARD_OUTPUT, is_stream
from guided_lgp.errors import InputError

_NAMING = ("mesh", "model")
"""Fields of a scene that can name a file."""


def destinations(
    options: Mapping[str, Path | None], inputs: Iterable[Path]
) -> dict[str, Path | None]:
    """Where the files of a command go: symbolic links are followed.

    Args:
        options: the file that each option names, if it does.
        inputs: files that the command reads, and folders of such files.

    Raises:
        InputError: a file cannot be written, is one of the inputs, or is named twice.
    """
    found: dict[str, Path | None] = {}
    read = list(inputs)
    for option, file in options.items():
        target = None if file is None else _destination(f"{option} {file}", file)
        if target is not None:
            _require_no_input(f"{option} {file}", target, read)
            for other, taken in found.items():
                if taken == target and not target.is_char_device():
                    raise InputError(f"{option} {file}", f"is also the file of {other}")
        found[option] = target
    return found


def named_files(document: Any, folder: Path) -> Iterator[Path]:
    """The files that a scene names: its meshes and its robot's.

    Args:
        document: what was read, whether it is a scene or not.
        folder: where it was.
    """
    rest = [document]
    while rest:
        part = rest.pop()
        if isinstance(part, list):
            rest += part
        elif isinstance(part, dict):
            rest += part.values()
            names = (part.get(key) for key in _NAMING)
            yield from (folder / name for name in names if isinstance(name, str))


def _destination(where: str, file: Path) -> Path:
    """The file itself, behind all links, which can be written."""
    if file == STANDARD_OUTPUT:
        return file
    target = _followed(where, file)
    if target.is_dir():
        raise InputError(where, "is a folder, or no name at all", "a file")
    if not target.parent.is_dir():
        raise InputError(where, "its folder does not exist", "a file in an existing folder")
    if not _can_be_written(target):
        raise InputError(where, "cannot be written: Permission denied")
    return target


def _can_be_written(target: Path) -> bool:
    """Whether this process, as who it acts, may fill a stream, or replace a file in its folder."""
    place = target if is_stream(target) else target.parent
    effective = os.access in os.supports_effective_ids
    if not os.access(place, os.W_OK, effective_ids=effective):
        return False
    if place == target or not target.exists() or not place.stat().st_mode & stat.S_ISVTX:
        return True
    # In a sticky folder, such as /tmp, files are replaced by their owner, the folder's, or root.
    return os.geteuid() in (0, target.stat().st_uid, place.stat().st_uid)


def _followed(where: str, file: Path) -> Path:
    try:
        target = file.resolve()
        with suppress(FileNotFoundError):
            target.lstat()
    except (OSError, RuntimeError, ValueError) as error:  # the last two: a loop of links, a NUL
        fault = getattr(error, "strerror", None) or "is no name of a file"
        raise InputError(where, f"cannot be written: {fault}") from None
    return target


def _require_no_input(where: str, target: Path, inputs: Iterable[Path]) -> None:
    if target == STANDARD_OUTPUT or not target.is_file():
        return
    for file in inputs:
        above = (target, *target.parents)
        if _exists(file) and any(place.samefile(file) for place in above):
            raise InputError(where, f"is read by this command: {file}", "another file")


def _exists(file: Path) -> bool:
    try:
        return file.exists()
    except OSError:  # too long a name
        return False
