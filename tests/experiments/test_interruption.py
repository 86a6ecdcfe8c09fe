"""Killed at random moments, the enumeration goes on to the same bytes.

The whole pipeline under DVC, at more moments: `make verify-interruption`.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

from guided_lgp.scene import generate

SHARDS = 5
KILLS = 3
SEED = 1

STAGE = """
from pathlib import Path
from guided_lgp.experiments import enumerate_sequences as stage
from guided_lgp.params import load_params

class Announced(stage.SceneBounds):
    def __init__(self, scene, params):
        print(scene.name, flush=True)
        super().__init__(scene, params)

stage.SceneBounds = Announced
params = load_params(Path({params!r}))
serial = params.parallel.model_copy(update=dict(workers=1))
stage.run(params.model_copy(update=dict(parallel=serial)), Path.cwd())
"""


class Stage:
    """The stage in a process of its own; names the configurations that it starts."""

    def __init__(self, root: Path) -> None:
        params = Path(__file__).parents[1] / "params.yaml"
        self._process = subprocess.Popen(
            [sys.executable, "-c", STAGE.format(params=str(params))],
            cwd=root,
            env=os.environ | {"OMP_NUM_THREADS": "1"},
            stdout=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        assert self._process.stdout is not None
        self._names = self._process.stdout
        self._first = self._names.readline()

    def kill(self, delay: float) -> list[str]:
        """The configurations started before the kill, so many seconds after the first."""
        time.sleep(delay)
        os.killpg(self._process.pid, signal.SIGKILL)
        return self._started()

    def finish(self) -> list[str]:
        started = self._started()
        assert self._process.returncode == 0
        return started

    def _started(self) -> list[str]:
        started = [self._first, *self._names]
        self._process.wait()
        self._names.close()
        return [line.strip() for line in started if line]


def make_root(folder: Path) -> Path:
    for split, count in (("training", SHARDS - 2), ("test", 2)):
        generate("a", count, 9, split).save(folder / "data" / "scenes" / f"{split}.json")
    return folder


def written(root: Path) -> dict[str, bytes]:
    files = (root / "data").rglob("*")
    return {str(file.relative_to(root)): file.read_bytes() for file in files if file.is_file()}


def test_a_kill_costs_at_most_the_shard_in_progress(tmp_path: Path) -> None:
    whole, broken = make_root(tmp_path / "whole"), make_root(tmp_path / "broken")
    undisturbed = Stage(whole)
    start = time.monotonic()
    assert len(undisturbed.finish()) == SHARDS
    duration = time.monotonic() - start

    started = []
    for delay in np.random.default_rng(SEED).uniform(0, 0.5 * duration, KILLS):
        started += Stage(broken).kill(float(delay))
    started += Stage(broken).finish()
    assert len(set(started)) == SHARDS
    assert len(started) <= SHARDS + KILLS
    assert written(broken) == written(whole)
