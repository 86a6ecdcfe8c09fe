"""A private folder for what is made once per machine: compiled code, ready robot files.

Nothing of it is trusted that another user could have put there, and nothing whose content is not
the one that was written: such an entry is made again. Only the folders above are trusted.
"""

import fcntl
import logging
import os
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from pathlib import Path

from guided_lgp.documents import remove, written_whole
from guided_lgp.errors import InputError

ACCEPTED = "a writable $XDG_CACHE_HOME of one's own"
_OTHERS = stat.S_IWGRP | stat.S_IWOTH
_DIGEST, _LOCK, _UNFINISHED = ".sha256", ".lock", ".unfinished-"

logger = logging.getLogger(__name__)


def cache_folder() -> Path:
    """Where it is: ``$XDG_CACHE_HOME/guided-lgp``; a relative path there does not count.

    Raises:
        InputError: there is no home either, or a relative one: never the current folder.
    """
    base = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return (base if base.is_absolute() else _home() / ".cache") / "guided-lgp"


def _home() -> Path:
    with suppress(RuntimeError):  # nobody knows where
        home = Path.home()
        if home.is_absolute():
            return home
    raise InputError("$XDG_CACHE_HOME", "is not set, and there is no home", ACCEPTED)


def private_folder() -> Path:
    """The folder, made if need be, such that nobody else can write to it.

    Raises:
        InputError: it cannot be made, is a symbolic link or belongs to another user.
    """
    folder = cache_folder()
    with _named_errors(folder):
        with suppress(FileExistsError):
            folder.parent.mkdir(parents=True, exist_ok=True)
            folder.mkdir(mode=0o700)
        found = folder.lstat()
        if not stat.S_ISDIR(found.st_mode):
            raise InputError(str(folder), "is not a folder", ACCEPTED)
        if found.st_uid != os.geteuid():
            raise InputError(str(folder), "belongs to another user", ACCEPTED)
        if stat.S_IMODE(found.st_mode) != 0o700:
            folder.chmod(0o700)
    return folder


def kept(name: str, content: bytes) -> Path:
    """The file of this name, written unless it has this content already.

    Raises:
        InputError: the folder cannot be used.
    """
    file = private_folder() / name
    if not is_whole(file) or _content(file) != content:
        with _named_errors(file.parent), _locked(file):
            _store(file, content)
    return file


def made(name: str, make: Callable[[Path], bytes | None]) -> Path | None:
    """The file of this name, made unless it is whole; one process makes it, the others wait.

    Args:
        name: of the file; the same for the same content.
        make: what makes the content, or nothing; it may use the empty folder that it gets.

    Raises:
        InputError: the folder cannot be used.
    """
    file = private_folder() / name
    if is_whole(file):
        return file
    with _named_errors(file.parent), _locked(file):
        if is_whole(file):  # made by the process that this one has waited for
            return file
        prefix = f"{_UNFINISHED}{name}-"
        for leftover in file.parent.glob(f"{prefix}*"):  # of a process that was killed
            remove(leftover)
        with tempfile.TemporaryDirectory(prefix=prefix, dir=file.parent) as folder:
            content = make(Path(folder))
        if content is None:
            return None
        _store(file, content)
    return file


def is_whole(file: Path) -> bool:
    """Whether a file that was made is there with the content that was written."""
    content = _content(file)
    return (
        content is not None and _content(_digest_of(file)) == sha256(content).hexdigest().encode()
    )


def damaged() -> list[Path]:
    """Entries of the folder that are not what was written, unless a process makes them just now."""
    folder = private_folder()
    with _named_errors(folder):
        names = {entry.name.removesuffix(_DIGEST) for entry in folder.iterdir()}
        found = sorted(folder / name for name in names if _is_entry(name))
        return [file for file in found if not is_whole(file) and _nobody_makes(file)]


def mend() -> list[Path]:
    """Remove damaged entries, which are made again when they are needed.

    Whole ones stay: other processes are about to open them.

    Raises:
        InputError: the folder cannot be used.
    """
    found = damaged()
    for file in found:
        with _named_errors(file.parent), _locked(file):
            if not is_whole(file):  # another process has not been faster
                remove(file)
                remove(_digest_of(file))
    return found


def _is_entry(name: str) -> bool:
    return not name.startswith(_UNFINISHED) and not name.endswith(_LOCK)


def _digest_of(file: Path) -> Path:
    return file.with_name(f"{file.name}{_DIGEST}")


def _content(file: Path) -> bytes | None:
    """What is in a plain file that this user alone can write to; None of any other."""
    try:
        descriptor = os.open(file, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC)
    except OSError:
        return None
    found = os.fstat(descriptor)
    mine = stat.S_ISREG(found.st_mode) and found.st_uid == os.geteuid()
    if not mine or found.st_mode & _OTHERS:
        os.close(descriptor)
        return None
    with os.fdopen(descriptor, "rb") as stream, suppress(OSError):
        return stream.read()
    return None


def _store(file: Path, content: bytes) -> None:
    """Put a file in place, its digest first; says so where something else was there."""
    if os.path.lexists(file):
        logger.warning("%s is damaged and made again", file)
    _put(_digest_of(file), sha256(content).hexdigest().encode())
    _put(file, content)


def _put(file: Path, content: bytes) -> None:
    """Put a file in place whole, instead of whatever is there."""
    if file.is_dir() and not file.is_symlink():
        remove(file)
    with written_whole(file) as unfinished:
        unfinished.write_bytes(content)
        unfinished.chmod(0o600)


@contextmanager
def _locked(file: Path) -> Iterator[None]:
    """Wait until no other process makes this file; the lock of one that dies ends with it.

    Where the file system has no locks, nobody waits and the last one's result stays.
    """
    descriptor = _open_lock(file)
    try:
        with suppress(OSError):
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)


def _nobody_makes(file: Path) -> bool:
    descriptor = _open_lock(file)
    try:
        return lock_at_once(descriptor)
    finally:
        os.close(descriptor)


def lock_at_once(descriptor: int) -> bool:
    """Lock a file unless another process has; where there are no locks, nobody else has."""
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return True
    return True


def _open_lock(file: Path) -> int:
    """The descriptor of the file that is locked; whatever else has its place is removed."""
    lock = file.with_name(f"{file.name}{_LOCK}")
    if lock.is_symlink() or lock.is_dir():
        remove(lock)
    return os.open(
        lock, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, 0o600
    )


@contextmanager
def _named_errors(folder: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        fault = error.strerror or "cannot be written"
        raise InputError(str(folder), fault, ACCEPTED) from None
