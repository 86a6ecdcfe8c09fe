"""Processes killed inside the windows in which a file or folder is written.

A window opens when an unfinished file or folder is made and closes when it takes its name. In a
child process the calls around it are replaced by ones that end the process with SIGKILL.
"""

import multiprocessing
import os
import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from unittest.mock import patch

from guided_lgp import documents
from hostility.figures import Counted

MOMENTS = ("opened", "half", "written", "synced")
"""When an unfinished file is there and empty; half written; written and not synced; synced and
without its name. A folder has but the first and the last."""
_UNFINISHED = ".unfinished-"


@dataclass
class Windows:
    """Counts the moments inside windows and kills this process at one of them."""

    target: int
    """Which one, from 0; beyond the last one, nothing happens."""
    report: int
    """A descriptor on which the moment is told before the kill."""
    passed: int = 0
    _files: dict[int, str] = field(default_factory=dict)
    """The unfinished files that are open, by their descriptor."""

    def reach(self, moment: str, path: str) -> None:
        """Kill this process if this is the moment."""
        if self.passed == self.target:
            if moment == "half":
                os.truncate(path, Path(path).stat().st_size // 2)
            os.write(self.report, moment.encode())
            os.kill(os.getpid(), signal.SIGKILL)
        self.passed += 1

    @contextmanager
    def watched(self) -> Iterator[None]:
        """Put the hooks in place."""
        open_, fsync, rename, replace, mkdir = os.open, os.fsync, os.rename, os.replace, os.mkdir

        def opening(path: Any, flags: int, *rest: Any, **options: Any) -> int:
            descriptor = open_(path, flags, *rest, **options)
            if flags & os.O_EXCL and _is_unfinished(path):
                self._files[descriptor] = os.fspath(path)
                self.reach("opened", os.fspath(path))
            return descriptor

        def syncing(descriptor: int) -> None:
            path = self._files.get(descriptor)
            if path is not None:
                self.reach("half", path)
                self.reach("written", path)
            fsync(descriptor)

        def making(path: Any, *rest: Any, **options: Any) -> None:
            mkdir(path, *rest, **options)
            if _is_unfinished(path):
                self.reach("opened", os.fspath(path))

        def before(call: Callable[..., None]) -> Callable[..., None]:
            def naming(source: Any, target: Any, **options: Any) -> None:
                if _is_unfinished(source) and not _is_unfinished(target):
                    self.reach("synced", os.fspath(source))
                call(source, target, **options)

            return naming

        with (
            patch.object(os, "open", opening),
            patch.object(os, "fsync", syncing),
            patch.object(os, "mkdir", making),
            patch.object(os, "rename", before(rename)),
            patch.object(os, "replace", before(replace)),
        ):
            yield


def _is_unfinished(path: Any) -> bool:
    """Whether a path leads through an unfinished file or folder."""
    if not isinstance(path, str | os.PathLike):
        return False
    return any(part.startswith(_UNFINISHED) for part in Path(os.fsdecode(path)).parts)


@dataclass(frozen=True)
class Kill:
    """What came of one attempt to kill."""

    moment: str
    """Empty if the work ended before it."""
    code: int | None


def killed(work: Callable[[], object], target: int) -> Kill:
    """Work in a child process that is killed at one moment inside its windows."""
    reader, writer = os.pipe()

    def run() -> None:
        with Windows(target, writer).watched():
            work()

    child = multiprocessing.get_context("fork").Process(target=run)
    child.start()
    os.close(writer)
    with os.fdopen(reader) as told:
        moment = told.read()
    child.join()
    return Kill(moment, child.exitcode)


@dataclass
class Figures(Counted):
    """How many kills were inside a window, and after how many something was damaged."""

    inside_window: int = 0
    in_stages: int = 0
    damaged: int = 0


@dataclass(frozen=True)
class Writer:
    """Something that writes files below a folder: the same bytes for the same version."""

    name: str
    work: Callable[[Path, int], object]

    def kill_everywhere(self, folder: Path, figures: Figures) -> None:
        """Kill it at every moment, over nothing and over an older version; let it go on."""
        older, expected = (self._made(folder / f"{version}", version) for version in (0, 1))
        for target in range(_MOST):
            ended = False
            for name, before in (("new", {}), ("old", older)):
                place = folder / f"{name}-{target}"
                if before:
                    self._made(place, 0)
                place.mkdir(exist_ok=True)
                kill = killed(lambda at=place: self.work(at, 1), target)
                ended |= not kill.moment
                if kill.moment:
                    self._go_on(place, kill, before, expected, figures)
            if ended:
                return

    def _made(self, place: Path, version: int) -> dict[str, bytes]:
        place.mkdir(parents=True)
        self.work(place, version)
        return contents(place)

    def _go_on(
        self,
        place: Path,
        kill: Kill,
        before: dict[str, bytes],
        expected: dict[str, bytes],
        figures: Figures,
    ) -> None:
        figures.inside_window += 1
        found, where = contents(place), f"{self.name}, {kill.moment}"
        torn = {name for name in found if found[name] not in (expected.get(name), before.get(name))}
        if torn or before.keys() - found.keys():
            figures.fault("damaged", f"{where}: torn {torn}, lost {before.keys() - found.keys()}")
        with patch.object(documents, "_LEFTOVER_S", -1.0):
            self.work(place, 1)
        if contents(place) != before | expected:
            figures.fault("damaged", f"{where}: does not go on to the same bytes")
        left = [entry.name for entry in place.rglob(f"{_UNFINISHED}*")]
        if left:
            figures.fault("damaged", f"{where}: leaves {left}")


_MOST = 200
"""Moments of one writer, if it does not end before."""


def contents(folder: Path) -> dict[str, bytes]:
    """The finished files below a folder; locks have no content."""
    files = sorted(file for file in folder.rglob("*") if file.is_file())
    return {
        str(file.relative_to(folder)): file.read_bytes()
        for file in files
        if file.suffix != ".lock" and not _is_unfinished(file)
    }


def kill_a_stage(
    run: Callable[[Path], object], root: Path, targets: Sequence[int], figures: Figures
) -> None:
    """Kill a stage at one moment after the other, then let it end.

    Args:
        run: runs it in this process.
        root: the folder of the pipeline.
        targets: the moments, counted anew after every kill.
        figures: gets the kills.
    """
    for target in targets:
        kill = killed(lambda: run(root), target)
        if kill.moment:
            figures.inside_window += 1
            figures.in_stages += 1
    run(root)


def compare(undisturbed: Path, killed_often: Path, figures: Figures) -> None:
    """Count the files of stages that are not those of an undisturbed run."""
    expected, found = contents(undisturbed), contents(killed_often)
    for name in sorted(expected.keys() | found.keys()):
        if expected.get(name) != found.get(name) and ".shards" not in name:
            figures.fault("damaged", f"{name} is another after kills")
