"""C code, compiled once per content, machine and compiler."""

import ctypes
import logging
import os
import platform
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from guided_lgp.cache import is_whole, made, private_folder

_FLAGS = (
    *("-O2", "-fPIC", "-shared", "-fno-semantic-interposition"),
    *("-fno-math-errno", "-ffp-contract=off"),
)
"""Optimised, calls within a library too, but not so that a sum depends on the machine."""
_PRELUDE = """\
#include <stdlib.h>
#if defined(__x86_64__) && defined(__GLIBC__) && defined(__GNUC__) && !defined(__clang__)
#define WIDEST __attribute__((target_clones("avx512f", "avx2", "default")))
#define INLINE inline __attribute__((always_inline))
#else
#define WIDEST
#define INLINE inline
#endif
"""
"""A function that is marked WIDEST, with the INLINE ones in it, is there once for each width of the
processor's vectors: one library for all machines, and the same results on all of them."""
_LONGEST = 120.0
"""Seconds that a compiler may take; the first run of ziglang's takes a quarter of it."""
_PROBE = "guided_lgp_probe"
_CHECK = """
import ctypes, sys
library, name, answer = sys.argv[1:]
sys.exit(getattr(ctypes.CDLL(library), name)() != int(answer))
"""
"""Run in a process of its own: half a library ends the process that opens it."""

logger = logging.getLogger(__name__)


def load_compiled(name: str, source: str) -> ctypes.CDLL | None:
    """The library made of C code; see :func:`load_generated`.

    Args:
        name: what the file's name begins with.
        source: the code.
    """
    return load_generated(name, source, lambda: source)


def load_generated(name: str, key: str, generate: Callable[[], str]) -> ctypes.CDLL | None:
    """The library made of C code, or None if it is not there and no compiler works.

    It lies in the private cache, is opened only if its content is the one that was written, and
    was written only after it had answered a probe.

    Args:
        name: what the file's name begins with.
        key: another for other code.
        generate: gives the code, where it has to be compiled.

    Raises:
        InputError: the cache folder cannot be used.
    """
    digest = sha256("\n".join((_PRELUDE, key, sys.platform, *_FLAGS)).encode()).hexdigest()
    answer = int(digest[:6], 16)

    def code() -> str:
        return f"{_PRELUDE}{generate()}\nint {_PROBE}(void) {{ return {answer}; }}\n"

    commands = list(_compilers())
    file = _any_made(name, digest) if not commands else None
    if commands:
        entry = f"{name}-{platform.machine()}-{_identity(commands[0])}-{digest[:16]}.so"
        file = made(entry, lambda folder: _make(code(), commands, answer, folder))
    return None if file is None else ctypes.CDLL(str(file))


def address(array: NDArray[Any] | None) -> ctypes.c_void_p:
    """Where a contiguous array begins; null for none.

    By the buffer of what may be written, which is five times faster than by ``array.ctypes``.
    """
    if array is None or not array.size:
        return _NULL
    try:
        return ctypes.c_void_p(ctypes.addressof(_read(array)))
    except TypeError:  # it may not be written
        return ctypes.c_void_p(array.ctypes.data)


_read: Callable[[NDArray[Any]], ctypes.c_char] = ctypes.c_char.from_buffer  # type: ignore[assignment]
_NULL = ctypes.c_void_p(None)


def _compilers() -> Iterator[list[str]]:
    """Commands to try: the system's C compiler, then the one of the package ``ziglang``."""
    for name in ("cc", "gcc", "clang"):
        path = shutil.which(name)
        if path is not None:
            yield [path]
    if find_spec("ziglang") is not None:
        yield [sys.executable, "-P", "-m", "ziglang", "cc"]  # not one of the current folder


def _identity(command: Sequence[str]) -> str:
    """Another for another compiler or version of it, without running it."""
    path = Path(command[0]).resolve()
    found = path.stat()
    words = (str(path), str(found.st_size), str(found.st_mtime_ns), *command[1:])
    return sha256("\n".join(words).encode()).hexdigest()[:8]


def _any_made(name: str, digest: str) -> Path | None:
    """A library that a compiler has made which is gone by now."""
    found = private_folder().glob(f"{name}-{platform.machine()}-*-{digest[:16]}.so")
    return next(filter(is_whole, sorted(found)), None)


def _make(
    source: str, commands: Sequence[Sequence[str]], answer: int, folder: Path
) -> bytes | None:
    """The library of the first compiler whose library works."""
    _announce()
    code, library = folder / "code.c", folder / "code.so"
    code.write_text(source, encoding="utf-8")
    check = [sys.executable, "-I", "-S", "-c", _CHECK, str(library), _PROBE, str(answer)]
    for command in commands:
        arguments = [*command, *_FLAGS, "-o", str(library), str(code), "-lm"]
        if _runs(arguments) and _runs(check):
            return library.read_bytes()
        logger.warning("%s makes no library that works", " ".join(command))
    return None


@cache
def _announce() -> None:
    """Tell who waits for the first plan of an installation why, once."""
    logger.info("compiling the solver for this robot and machine, once")


def _runs(arguments: Sequence[str]) -> bool:
    """Whether a program ends well and in time; with it end all that it has started."""
    quiet = subprocess.DEVNULL
    try:
        process = subprocess.Popen(
            arguments, stdin=quiet, stdout=quiet, stderr=quiet, start_new_session=True
        )
    except OSError:
        return False
    try:
        return process.wait(_LONGEST) == 0
    except subprocess.TimeoutExpired:
        logger.warning("%s has not ended after %g s", arguments[0], _LONGEST)
        return False
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
