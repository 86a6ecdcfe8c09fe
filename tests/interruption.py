"""Killed at any moment, the pipeline goes on to the same bytes: `make verify-interruption`.

Runs the small profile of the commit at HEAD in two fresh clones. In the second, `dvc repro` and all
processes below it are killed with SIGKILL at a random moment of every stage, several times in the
enumeration, and started again. Ends with 1 if an output differs from the undisturbed run's, or if
a finished shard of the enumeration was computed again; the clones are then kept.
"""

import os
import re
import shutil
import signal
import sys
import time
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from tempfile import mkdtemp

import numpy as np
import psutil

from determinism import TIMING, Clone, differences, outputs, render_with_times_of

SEED = 6
KILLS = {"enumerate_sequences": 4}
"""Kills by stage where there is more than one."""
BEYOND = 1.1
"""Moments are drawn from a stage's time and a bit more: then DVC stores its outputs."""
LIMIT_S = 3600
LOOK_S = 0.02


class Repro:
    """One `dvc repro`, and where it is."""

    def __init__(self, clone: Clone) -> None:
        self._log = clone.folder.with_suffix(".log")
        self._process = clone.start("dvc", "repro", log=self._log)

    def stages(self) -> Iterator[str]:
        """Each stage as soon as it starts; ends with the pipeline.

        Raises:
            RuntimeError: the pipeline failed, or hangs.
        """
        seen = 0
        end = time.monotonic() + LIMIT_S
        while time.monotonic() < end:
            code = self._process.poll()
            started = re.findall(r"Running stage '(.+)'", self._log.read_text())
            yield from started[seen:]
            seen = len(started)
            if code is not None:
                if code != 0:
                    raise RuntimeError(f"dvc repro failed:\n{self._log.read_text()}")
                return
            time.sleep(LOOK_S)
        raise RuntimeError(f"dvc repro hangs, see {self._log}")

    def kill(self) -> int:
        """Kill DVC, the stage and its workers at once; how many processes they were."""
        below = psutil.Process(self._process.pid).children(recursive=True)
        os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        return 1 + len(below)


def undisturbed(clone: Clone) -> dict[str, float]:
    """Run the pipeline to its end: the time (s) of each stage, in their order."""
    names, starts = [], []
    for stage in Repro(clone).stages():
        names.append(stage)
        starts.append(time.monotonic())
    starts.append(time.monotonic())
    return dict(zip(names, np.diff(starts).tolist(), strict=True))


def interrupted(clone: Clone, times: dict[str, float]) -> Iterator[str]:
    """Run the pipeline with kills; one line for each of them.

    Args:
        clone: without results.
        times: of the stages (s), in their order.
    """
    rng = np.random.default_rng(SEED)
    order = list(times)
    for number, target in enumerate(order):
        for delay in sorted(rng.uniform(0, BEYOND * times[target], KILLS.get(target, 1))):
            repro = Repro(clone)
            for stage in repro.stages():
                if order.index(stage) >= number:
                    time.sleep(delay)
                    yield f"{delay:.1f} s after {stage} began: killed {repro.kill()} processes"
                    break
    undisturbed(clone)


def shards(clone: Clone) -> dict[str, int]:
    """The finished shards of the enumeration, and when each was written."""
    folders = (clone.folder / "data" / ".shards").glob("*")
    return {folder.name: folder.stat().st_mtime_ns for folder in folders if not folder.suffix}


def main() -> int:
    """Run, kill, compare, report."""
    parent = Path(mkdtemp(prefix="interruption-"))
    first, second = Clone(parent / "undisturbed", 2), Clone(parent / "interrupted", 2)
    second.check_sources()
    start = time.monotonic()
    times = undisturbed(first)
    print(f"undisturbed: {time.monotonic() - start:.0f} s", flush=True)
    start = time.monotonic()
    written: defaultdict[str, set[int]] = defaultdict(set)
    kills = 0
    for kills, line in enumerate(interrupted(second, times), 1):
        print(f"{kills}: {line}", flush=True)
        for name, moment in shards(second).items():
            written[name].add(moment)
    print(f"interrupted: {time.monotonic() - start:.0f} s", flush=True)
    for name, moment in shards(second).items():
        written[name].add(moment)
    redone = [name for name, moments in written.items() if len(moments) > 1]
    render_with_times_of(first.folder, second)
    found = list(differences(first.folder, second.folder))
    for line in found:
        print(line)
    print(
        f"{kills} kills, {len(redone)} of {len(written)} finished shards computed again, "
        f"{len(outputs(first.folder))} files compared (not {TIMING}), {len(found)} differences"
    )
    if found or redone:
        print(f"the clones are kept in {parent}")
        return 1
    shutil.rmtree(parent)
    return 0


if __name__ == "__main__":
    sys.exit(main())
