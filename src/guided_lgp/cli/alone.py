"""One run of a stage at a time in a clone."""

import os
import platform
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import quote

from guided_lgp.cache import lock_at_once
from guided_lgp.errors import InputError

PATIENCE_S = 5.0
"""How long the second waits: a run that is being ended needs a moment for it."""
_LOOK_S = 0.1


@contextmanager
def alone(root: Path, stage: str) -> Iterator[None]:
    """Run a stage while no other process runs it in this clone.

    The lock of a process that dies ends with it. There is none where there is no clone, or where
    the file system has no locks.

    Args:
        root: the clone.
        stage: its name in dvc.yaml, such as ``train_policy@place``.

    Raises:
        InputError: another process runs it; the message names that process.
    """
    if not (root / ".dvc").is_dir():
        yield
        return
    file = root / ".dvc" / "tmp" / "guided-lgp" / f"{quote(stage, safe='@')}.lock"
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC
        descriptor = os.open(file, flags, 0o666)
    except OSError as error:
        raise InputError(str(file), f"cannot be locked: {error.strerror}") from None
    try:
        _lock(descriptor, stage)
        yield
    finally:
        os.close(descriptor)


def _lock(descriptor: int, stage: str) -> None:
    """Take the lock and leave this process's name in it."""
    until = time.monotonic() + PATIENCE_S
    while not lock_at_once(descriptor):
        if time.monotonic() > until:
            holder = os.pread(descriptor, 200, 0).decode(errors="replace").strip()
            fault = f"runs already in this clone: {holder or 'process unknown'}"
            raise InputError(stage, fault, "one run at a time")
        time.sleep(_LOOK_S)
    os.ftruncate(descriptor, 0)
    os.pwrite(descriptor, f"process {os.getpid()} on {platform.node()}\n".encode(), 0)
