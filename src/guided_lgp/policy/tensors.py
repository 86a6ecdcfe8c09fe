"""Arrays on disk: safetensors, written whole or not at all, refused if damaged."""

from collections.abc import Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from safetensors import SafetensorError
from safetensors.numpy import load, save

from guided_lgp.documents import written_whole
from guided_lgp.errors import InputError

Arrays = Mapping[str, NDArray[Any]]
Shape = tuple[int | str, ...]
"""The size of every axis; a name stands for any size, the same wherever it stands."""
Limits = tuple[ArrayLike, ArrayLike]
"""The least number, and the first one that is too large; of the last axis, or of all."""


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


def read_arrays(
    path: Path, declared: Mapping[str, tuple[type, Shape]], remedy: str, digest: str | None = None
) -> tuple[dict[str, NDArray[Any]], dict[str, int]]:
    """Read arrays of which all is declared, and no others.

    Args:
        path: the file.
        declared: type and shape of each.
        remedy: what is accepted, for the message.
        digest: as for :func:`read_tensors`.

    Returns:
        The arrays, and the sizes that the names in their shapes stand for.

    Raises:
        InputError: see :func:`read_tensors`; or an array is missing, too many, of another type or
            shape, or not finite.
    """
    arrays, sizes = read_tensors(path, remedy, digest), dict[str, int]()
    if arrays.keys() != declared.keys():
        raise InputError(str(path), f"has the arrays {', '.join(sorted(arrays))}", remedy)
    for name, (kind, shape) in declared.items():
        array = arrays[name]
        if array.dtype != kind or not _fits(array.shape, shape, sizes):
            fault = f"are {array.dtype} of shape {array.shape}"
            raise InputError(f"{path}: {name}", fault, remedy)
        if not np.isfinite(array).all():
            raise InputError(f"{path}: {name}", "are not all finite", remedy)
    return arrays, sizes


def _fits(found: tuple[int, ...], shape: Shape, sizes: dict[str, int]) -> bool:
    """Whether a shape is the declared one; names that are new get their sizes."""
    return len(found) == len(shape) and all(
        size == (sizes.setdefault(wanted, size) if isinstance(wanted, str) else wanted)
        for size, wanted in zip(found, shape, strict=True)
    )


def require_range(path: Path, arrays: Arrays, limits: Mapping[str, Limits], remedy: str) -> None:
    """Refuse numbers that stand for nothing.

    Args:
        path: the file, for the message.
        arrays: by name.
        limits: of some of them.
        remedy: what is accepted, for the message.

    Raises:
        InputError: an array has a number outside.
    """
    for name, (least, end) in limits.items():
        if ((arrays[name] < least) | (arrays[name] >= end)).any():
            raise InputError(f"{path}: {name}", "are out of range", remedy)


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
