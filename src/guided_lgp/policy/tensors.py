"""Arrays on disk: safetensors, written whole or not at all, refused if damaged."""

from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from guided_lgp.documents import written_whole
from guided_lgp.errors import InputError

Arrays = Mapping[str, NDArray[Any]]


def write_tensors(path: Path, arrays: Arrays) -> str:
    """Write arrays by name; the same bytes for the same arrays.

    Returns:
        The SHA-256 digest of the file.
    """
    content = save({name: np.ascontiguousarray(array) for name, array in arrays.items()})
    with written_whole(path) as unfinished:
        unfinished.write_bytes(content)
    return sha256(content).hexdigest()


def read_tensors(path: Path, remedy: str, digest: str | None = None) -> dict[str, NDArray[Any]]:
    """Read what :func:`write_tensors` wrote.

    Args:
        path: the file.
        remedy: what is accepted, for the message.
        digest: the SHA-256 digest that the file shall have, if it is known.

    Raises:
        InputError: the file is missing or damaged, or has numbers of a type that NumPy lacks.
    """
    try:
        content = path.read_bytes()
    except OSError as error:
        missing = isinstance(error, FileNotFoundError)
        raise InputError(str(path), "is missing" if missing else "cannot be read", remedy) from None
    if digest not in (None, sha256(content).hexdigest()):
        raise InputError(str(path), "is damaged: its digest is another", remedy)
    try:
        arrays: dict[str, NDArray[Any]] = load(content)
    except (SafetensorError, KeyError, TypeError, AttributeError, ValueError):
        # All but the first: a type of numbers that NumPy does not have, such as bfloat16.
        raise InputError(str(path), "is damaged", remedy) from None
    return arrays


def read_weights(path: Path, remedy: str) -> dict[str, NDArray[np.float32]]:
    """Read the weights of a network.

    Raises:
        InputError: see :func:`read_tensors`; or one of them is not of finite numbers of 32 bits.
    """
    weights = read_tensors(path, remedy)
    for name, array in weights.items():
        if array.dtype != np.float32 or not np.isfinite(array).all():
            raise InputError(f"{path}: {name}", "is not of finite numbers of 32 bits", remedy)
    return weights
