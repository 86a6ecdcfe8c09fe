"""JSON documents on disk: read with every fault in one line."""

import json
import math
from pathlib import Path
from typing import Any

from guided_lgp.errors import InputError

LARGEST = 256 * 2**20
"""Bytes that a document may have: 100 times those of the largest that the program writes."""


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
