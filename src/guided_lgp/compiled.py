"""C code, compiled once per content."""

import ctypes
import fcntl
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path

from guided_lgp.errors import InputError

_FLAGS = ("-O2", "-fPIC", "-shared", "-fno-math-errno")


def cache_folder() -> Path:
    """Where compiled code is kept: ``$XDG_CACHE_HOME/guided-lgp``."""
    return Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "guided-lgp"


def load_compiled(name: str, source: str) -> ctypes.CDLL | None:
    """The library made of C code, or None if it is not there and no compiler works.

    The file's name depends on the content, and it is put in place atomically. Of several processes
    that need it, one compiles and the others wait.

    Args:
        name: what the file's name begins with.
        source: the code.

    Raises:
        InputError: the cache folder cannot be written.
    """
    digest = sha256("\n".join((source, sys.platform, *_FLAGS)).encode()).hexdigest()[:16]
    target = cache_folder() / f"{name}-{digest}.so"
    if not target.exists():
        commands = list(_compilers())
        if not commands:
            return None
        try:
            target.parent.mkdir(parents=True, exist_ok=True)
            with _alone(target.with_suffix(".lock")):
                if not target.exists() and not _make(source, commands, target):
                    return None
        except OSError as error:
            fault = error.strerror or "cannot be written"
            raise InputError(str(target.parent), fault, "a writable $XDG_CACHE_HOME") from None
    return ctypes.CDLL(str(target))


def _compilers() -> Iterator[list[str]]:
    """Commands to try: the system's C compiler, then the one of the package ``ziglang``."""
    for name in ("cc", "gcc", "clang"):
        path = shutil.which(name)
        if path is not None:
            yield [path]
    if find_spec("ziglang") is not None:
        yield [sys.executable, "-m", "ziglang", "cc"]


@contextmanager
def _alone(file: Path) -> Iterator[None]:
    """Wait until no other process is in here; the lock of one that dies ends with it.

    Where the file system has no locks, nobody waits and the last one's result stays.
    """
    with file.open("w") as stream:
        with suppress(OSError):
            fcntl.flock(stream, fcntl.LOCK_EX)
        yield


def _make(source: str, commands: list[list[str]], target: Path) -> bool:
    """Whether one of the compilers makes the library."""
    with tempfile.TemporaryDirectory(dir=target.parent) as folder:
        code, library = Path(folder) / "code.c", Path(folder) / "code.so"
        code.write_text(source, encoding="utf-8")
        if not any(_compile(command, code, library) for command in commands):
            return False
        library.replace(target)
    return True


def _compile(command: list[str], code: Path, library: Path) -> bool:
    arguments = [*command, *_FLAGS, "-o", str(library), str(code), "-lm"]
    try:
        finished = subprocess.run(arguments, capture_output=True, timeout=600, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return finished.returncode == 0
