"""Results that survive a kill: one file per task, named after all that it depends on."""

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any, Generic, TypeVar

from guided_lgp import parallel
from guided_lgp.documents import read_json, write_json
from guided_lgp.errors import InputError
from guided_lgp.params import Parallel
from guided_lgp.paths import CASES
from guided_lgp.sources import source_digest

Task = TypeVar("Task")


@dataclass(frozen=True)
class _Kept(Generic[Task]):
    function: Callable[[Task], Any]
    task: Task
    file: Path


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
            other.unlink()
    parallel.run(_write, kept, settings, description)
    return [read_json(one.file, description) for one in kept]


def _write(kept: _Kept[Any]) -> None:
    try:
        read_json(kept.file, "")
    except InputError:
        write_json(kept.file, kept.function(kept.task))


def _name(content: Any, sources: str) -> str:
    text = json.dumps([content, sources], sort_keys=True)
    return sha256(text.encode()).hexdigest()[:24] + ".json"
