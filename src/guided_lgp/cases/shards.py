"""Results that survive a kill: one file per task, named after all that it depends on."""

import json
import logging
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, Generic, TypeVar

from pydantic import BaseModel

from guided_lgp import parallel
from guided_lgp.documents import read_json, remove, write_json
from guided_lgp.errors import InputError
from guided_lgp.faults import validated
from guided_lgp.params import Parallel
from guided_lgp.paths import CASES
from guided_lgp.sources import source_digest

Task = TypeVar("Task")

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class _Kept(Generic[Task]):
    function: Callable[[Task], Any]
    task: Task
    file: Path


class _Document(BaseModel):
    """A result, with the digest of what was written."""

    digest: str
    result: Any


def run_kept(
    function: Callable[[Task], Any],
    tasks: Iterable[tuple[Task, Any]],
    folder: Path,
    settings: Parallel,
    stage: str,
    description: str,
) -> list[Any]:
    """Apply a function to every task, unless its result is there already.

    Args:
        function: importable; gives something that JSON can hold.
        tasks: each with what its result depends on, beside the sources.
        folder: for the results; what is there of other tasks is removed.
        settings: back end and workers.
        stage: of ``cases/dvc.yaml``, whose sources results depend on.
        description: a few words for the progress display.
    """
    sources = source_digest(CASES, stage)
    kept = [_Kept(function, task, folder / _name(content, sources)) for task, content in tasks]
    wanted = {one.file for one in kept}
    for other in folder.iterdir() if folder.is_dir() else ():
        if other not in wanted:
            remove(other)
    parallel.run(_write, kept, settings, description)
    return [read_kept(one.file) for one in kept]


def _write(kept: _Kept[Any]) -> None:
    """Compute a result, unless it is there whole."""
    try:
        read_kept(kept.file)
    except InputError:
        if os.path.lexists(kept.file):
            logger.warning("%s is damaged and computed again", kept.file)
            remove(kept.file)
        write_kept(kept.file, kept.function(kept.task))


def write_kept(file: Path, result: Any) -> None:
    """Keep a result, with its digest."""
    write_json(file, {"digest": _digest(result), "result": result})


def read_kept(file: Path) -> Any:
    """A result that was kept.

    Raises:
        InputError: the file is missing or damaged.
    """
    document = validated(_Document.model_validate, read_json(file), str(file))
    if document.digest != _digest(document.result):
        raise InputError(str(file), "is damaged: its digest is another")
    return document.result


def _digest(content: Any) -> str:
    return sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _name(content: Any, sources: str) -> str:
    return _digest([content, sources])[:24] + ".json"
