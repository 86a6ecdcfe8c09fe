"""Stage enumerate_sequences: all shortest feasible sequences of every configuration.

Each configuration is a shard that its worker writes as soon as it is done, outside the outputs
that DVC deletes before it starts the stage: after a kill, only the shards in progress are redone.
The name of a shard is a digest of all that it depends on, with the sources that dvc.yaml lists for
the stage. The shards stay until another run does not need them: DVC can be killed after the stage
has ended. A shard whose files are not those that were written is computed again.
"""

import gc
import json
import logging
import os
from collections.abc import Iterable, Iterator, Set
from contextlib import contextmanager
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

import numpy as np
import pyarrow as pa

from guided_lgp import parallel
from guided_lgp.bounds.results import CoarseResult
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.documents import made_whole, remove, write_text
from guided_lgp.errors import InputError
from guided_lgp.logic import (
    format_objective,
    format_skeleton,
    one_goal_objectives,
    two_goal_objectives,
)
from guided_lgp.params import BoundsParams, EnumerateSequences, Params
from guided_lgp.paths import PIPELINE, SCENES, SEQUENCES
from guided_lgp.scene import Scene, load_scenes
from guided_lgp.search.enumerate import Enumeration, enumerate_sequences
from guided_lgp.search.observation import observe_all, start
from guided_lgp.sequences import SHORTEST, STAGE, VERDICTS
from guided_lgp.sources import source_digest
from guided_lgp.tables import read_columns, write_table

SPLITS = ("training", "test")
_PARTS = {"verdicts": VERDICTS, "shortest": SHORTEST}
"""The tables of a shard."""
_DIGESTS = "digests.txt"

logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Task:
    """One configuration, and where its shard goes."""

    scene: Scene
    bounds: BoundsParams
    limits: EnumerateSequences
    sources: str
    """Digest of the code that a verdict depends on."""
    folder: Path

    @property
    def shard(self) -> Path:
        """Folder of the shard; there once it is complete."""
        content = [
            self.scene.model_dump(mode="json"),
            self.bounds.model_dump(),
            self.limits.model_dump(),
            self.sources,
        ]
        return self.folder / sha256(json.dumps(content).encode()).hexdigest()[:24]


def run(params: Params, root: Path) -> None:
    """Write ``data/sequences/{training,test}.parquet`` and ``{training,test}_shortest.parquet``."""
    folder = root / SEQUENCES.parent / ".shards"
    splits = {name: load_scenes(root / SCENES / f"{name}.json").scenes for name in SPLITS}
    sources = source_digest(PIPELINE, STAGE)
    given = params.bounds, params.enumerate_sequences, sources, folder
    tasks = {name: [Task(scene, *given) for scene in scenes] for name, scenes in splits.items()}
    whole = [task for split in tasks.values() for task in split]
    _remove_others(folder, {task.shard for task in whole})
    parallel.run(write_shard, whole, params.parallel, "enumerate")
    for name, split in tasks.items():
        for part, suffix in (("verdicts", ""), ("shortest", "_shortest")):
            table = pa.concat_tables(
                read_columns(task.shard / f"{part}.parquet", STAGE, _PARTS[part]) for task in split
            )
            write_table(root / SEQUENCES / f"{name}{suffix}.parquet", table)
            logger.info("%s %s: %d rows", name, part, len(table))


def _remove_others(folder: Path, shards: Set[Path]) -> None:
    """Remove what earlier runs left: shards of other content, and shards half-written."""
    for found in folder.iterdir() if folder.is_dir() else ():
        if found not in shards:
            remove(found)


def write_shard(task: Task) -> None:
    """Enumerate one configuration, unless that has been done before."""
    if _is_whole(task.shard):
        return
    if os.path.lexists(task.shard):
        logger.warning("%s is damaged and computed again", task.shard)
        remove(task.shard)
    try:
        with _everything_kept():
            _enumerate(task)
    except InputError:
        if not _is_whole(task.shard):  # else a worker that was thought lost has been faster
            raise


@contextmanager
def _everything_kept() -> Iterator[None]:
    """Do not look for cycles, over and over, in verdicts that all stay to the end."""
    gc.disable()
    try:
        yield
    finally:
        gc.enable()


def _enumerate(task: Task) -> None:
    symbols = task.scene.symbols
    found = enumerate_sequences(
        task.scene.state,
        symbols,
        one_goal_objectives(symbols) + two_goal_objectives(symbols),
        SceneBounds(task.scene, task.bounds),
        task.limits.max_length,
        task.limits.slack,
    )
    with made_whole(task.shard) as shard:
        write_table(shard / "verdicts.parquet", verdict_table(task.scene, found))
        write_table(shard / "shortest.parquet", shortest_table(task.scene, found))
        write_text(shard / _DIGESTS, _digests(shard))


def _is_whole(shard: Path) -> bool:
    """Whether a shard has the content that was written."""
    try:
        return (shard / _DIGESTS).read_text(encoding="ascii") == _digests(shard)
    except (OSError, UnicodeDecodeError):
        return False


def _digests(shard: Path) -> str:
    """A line for each table of a shard."""
    contents = {part: (shard / f"{part}.parquet").read_bytes() for part in _PARTS}
    return "".join(f"{sha256(content).hexdigest()} {part}\n" for part, content in contents.items())


def verdict_table(scene: Scene, found: Enumeration) -> pa.Table:
    """One row per verdict of the coarse bound."""
    rows, states = [], _states(scene, found.verdicts)
    for verdict in found.verdicts:
        failure = verdict.failure
        known = failure is not None and np.isfinite(failure.violation)
        rows.append(
            {
                "configuration": scene.name,
                "skeleton": format_skeleton(verdict.skeleton),
                "length": len(verdict.skeleton),
                "feasible": verdict.feasible,
                "failure_action": failure.action if failure else None,
                "failure_constraint": failure.constraint if failure else None,
                "failure_violation": failure.violation if failure and known else None,
                "states": next(states) if verdict.feasible else None,
            }
        )
    return pa.Table.from_pylist(rows, schema=VERDICTS)


def shortest_table(scene: Scene, found: Enumeration) -> pa.Table:
    """One row per objective."""
    rows = [
        {
            "configuration": scene.name,
            "objective": format_objective(objective),
            "symbolic_length": found.symbolic[objective],
            "length": length,
        }
        for objective, length in found.shortest.items()
    ]
    return pa.Table.from_pylist(rows, schema=SHORTEST)


def _states(scene: Scene, verdicts: Iterable[CoarseResult]) -> Iterator[list[float]]:
    """What is where at the start of each feasible sequence and after each of its actions."""
    feasible = [verdict for verdict in verdicts if verdict.feasible]
    first = start(scene)
    keyframes = [k for verdict in feasible for k in (first, *verdict.after_action)]
    seen = iter(observe_all(scene, keyframes) if keyframes else ())
    for verdict in feasible:
        positions = [list(next(seen).values()) for _ in range(1 + len(verdict.skeleton))]
        yield np.array(positions).ravel().tolist()
