"""Whatever dies, enumeration and evaluation go on to the same bytes.

The whole pipeline under DVC, killed at more moments: `make verify-interruption`.
"""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from threading import Thread

import numpy as np
import pytest
from dask.distributed import Client

from guided_lgp.experiments import enumerate_sequences, evaluate_generalization
from guided_lgp.params import Params, load_params
from guided_lgp.scene import generate

SMALL = Path(__file__).parents[1] / "params.yaml"
MODELS = Path(__file__).parents[2] / "models"
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
    files = root.rglob("*")
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
    if within_a_minute(lambda: any(not folder.suffix for folder in shards.glob("*"))):
        worker.kill()


def kill_at_work(worker: subprocess.Popen[bytes]) -> None:
    """Kill a worker when both have had their task for a second."""
    with Client(os.environ["DASK_SCHEDULER_ADDRESS"]) as client:
        at_work = within_a_minute(lambda: all(client.processing().values()))
    if at_work:
        time.sleep(1)
        worker.kill()


def within_a_minute(condition: Callable[[], bool]) -> bool:
    end = time.monotonic() + 60
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.02)
    return False


def test_an_enumeration_on_dask_that_loses_a_worker_writes_the_same_bytes(
    undisturbed: tuple[dict[str, bytes], float],
    machines: list[subprocess.Popen[bytes]],
    tmp_path: Path,
) -> None:
    root = make_root(tmp_path)
    killer = Thread(
        target=kill_after_the_first_shard, args=(machines[0], root / "data" / ".shards")
    )
    killer.start()
    enumerate_sequences.run(on_dask(load_params(SMALL)), root)
    killer.join()
    assert machines[0].wait(60) == -signal.SIGKILL
    assert machines[1].poll() is None
    assert written(root) == undisturbed[0]


def test_an_evaluation_on_dask_that_loses_a_worker_writes_the_same_bytes(
    undisturbed: tuple[dict[str, bytes], float],
    machines: list[subprocess.Popen[bytes]],
    tmp_path: Path,
) -> None:
    params = load_params(SMALL)
    short = params.evaluate_generalization.model_copy(update={"max_depth": 2, "max_paths": 1})
    params = params.model_copy(update={"evaluate_generalization": short})
    loky, dask = tmp_path / "loky", tmp_path / "dask"
    for root in (loky, dask):
        for name, content in undisturbed[0].items():
            (root / name).parent.mkdir(parents=True, exist_ok=True)
            (root / name).write_bytes(content)
        shutil.copytree(MODELS, root / "models")
    evaluate_generalization.run(params, loky)
    killer = Thread(target=kill_at_work, args=(machines[0],))
    killer.start()
    evaluate_generalization.run(on_dask(params), dask)
    killer.join()
    assert machines[0].wait(60) == -signal.SIGKILL
    assert machines[1].poll() is None
    files = written(dask)
    assert {"data/evaluation/generalization.parquet", "reports/metrics/generalization.json"} <= set(
        files
    )
    assert files == written(loky)


def on_dask(params: Params) -> Params:
    parallel = params.parallel.model_copy(update={"backend": "dask"})
    return params.model_copy(update={"parallel": parallel})
