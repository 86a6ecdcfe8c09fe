"""The figures of a stage, read from the JSON files that it has written."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from guided_lgp.documents import read_json
from guided_lgp.paths import METRICS

SUMMARY = METRICS / "summary.json"
"""What the parent run has, too: a comparison of these runs draws a chart per figure."""


def flatten(values: Mapping[str, Any], separator: str = ".", prefix: str = "") -> dict[str, Any]:
    """Nested mappings as one level, the names of the levels joined by a separator."""
    flat: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, Mapping):
            flat |= flatten(value, separator, f"{prefix}{name}{separator}")
        else:
            flat[f"{prefix}{name}"] = value
    return flat


def read_metrics(file: Path) -> dict[str, list[float]]:
    """The numbers of a JSON file by name; a list of numbers is a curve over epochs.

    MLflow groups its charts by what stands before the last slash of a name.
    """
    document = read_json(file)
    metrics = {}
    for path, value in flatten(document if isinstance(document, dict) else {}, "/").items():
        name = "/".join(part for part in path.split("/") if part not in ("sub_policies", "curves"))
        values = value if isinstance(value, list) else [value]
        measured = name not in ("version", "seed")
        if measured and values and all(_is_number(item) for item in values):
            metrics[name] = [float(item) for item in values]
    return metrics


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def files(path: Path) -> list[Path]:
    """The files of a folder, or the file itself; none if there is nothing."""
    if path.is_dir():
        return sorted(file for file in path.rglob("*") if file.is_file())
    return [path] if path.is_file() else []
