"""Whatever dies, the enumeration goes on to the same bytes.

The whole pipeline under DVC, killed at more moments: `make verify-interruption`.
"""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from threading import Thread

import numpy as np
import pytest
from dask.distributed import LocalCluster

from guided_lgp.experiments import enumerate_sequences
from guided_lgp.params import load_params
from guided_lgp.scene import generate

SMALL = Path(__file__).parents[1] / "params.yaml"
SHARDS = 5
KILLS = 3
SEED = 1

STAGE = """
import sys
from pathlib import Path
from guided_lgp.experiments import enumerate_sequences as stage
from guided_lgp.params import load_params

class Announced(stage.SceneBounds):
    def __init__(self, scene, params):
        print(scene.name, flush=True)
        super().__init__(scene, params)

stage.SceneBounds = Announced
params = load_params(Path(sys.argv[1]))
serial = params.parallel.model_copy(update=dict(workers=1))
stage.run(params.model_copy(update=dict(parallel=serial)), Path.cwd())
"""


class Stage:
    """The stage in a process of its own; names the configurations that it starts."""

    def __init__(self, root: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", STAGE, str(SMALL)],
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
        """All configurations that it started."""
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


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, bytes], float]:
    """What the stage writes, and how long it takes (s) from its first configuration on."""
    root = make_root(tmp_path_factory.mktemp("undisturbed"))
    stage = Stage(root)
    start = time.monotonic()
    assert len(stage.finish()) == SHARDS
    return written(root), time.monotonic() - start


def test_a_kill_costs_at_most_the_shard_in_progress(
    undisturbed: tuple[dict[str, bytes], float], tmp_path: Path
) -> None:
    expected, duration = undisturbed
    root = make_root(tmp_path)
    started = []
    for delay in np.random.default_rng(SEED).uniform(0, 0.5 * duration, KILLS):
        started += Stage(root).kill(float(delay))
    started += Stage(root).finish()
    assert len(set(started)) == SHARDS
    assert len(started) <= SHARDS + KILLS
    assert written(root) == expected


def kill_after_the_first_shard(worker: subprocess.Popen[bytes], shards: Path) -> None:
    end = time.monotonic() + 60
    while time.monotonic() < end and not any(not folder.suffix for folder in shards.glob("*")):
        time.sleep(0.02)
    worker.kill()


def test_a_dask_cluster_that_loses_a_worker_writes_the_same_bytes(
    undisturbed: tuple[dict[str, bytes], float], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    root = make_root(tmp_path)
    params = load_params(SMALL)
    on_dask = params.parallel.model_copy(update={"backend": "dask"})
    words = [sys.executable, "-m", "distributed.cli.dask_worker", "--no-nanny", "--no-dashboard"]
    with LocalCluster(n_workers=0, dashboard_address=None) as cluster:
        monkeypatch.setenv("DASK_SCHEDULER_ADDRESS", cluster.scheduler_address)
        command = [*words, "--nthreads", "1", cluster.scheduler_address]
        environment = os.environ | {"OMP_NUM_THREADS": "1"}
        workers = [
            subprocess.Popen(command, env=environment, stderr=subprocess.DEVNULL) for _ in range(2)
        ]
        killer = Thread(
            target=kill_after_the_first_shard, args=(workers[0], root / "data" / ".shards")
        )
        killer.start()
        enumerate_sequences.run(params.model_copy(update={"parallel": on_dask}), root)
        killer.join()
        assert workers[0].wait() == -signal.SIGKILL
        assert workers[1].poll() is None
        workers[1].terminate()
        workers[1].wait()
    assert written(root) == undisturbed[0]
