"""PyBullet without its greeting: on import it writes its build time to the error stream."""

import os
from collections.abc import Iterator
from contextlib import contextmanager

from guided_lgp.errors import InputError, pybullet_remedy


@contextmanager
def _silent_errors() -> Iterator[None]:
    kept = os.dup(2)
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        yield
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


try:
    with _silent_errors():
        import pybullet
except ModuleNotFoundError:
    raise InputError("PyBullet", "is not installed", pybullet_remedy()) from None

__all__ = ["pybullet"]
