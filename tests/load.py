"""Many plans in one process, many experiments in one database: the check of `make verify-load`.

Ends with 1 if memory or PyBullet clients are left behind, or if a database of many experiments
cannot be opened and added to within seconds.
"""

import gc
import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import chdir, contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

import psutil

from guided_lgp import tracking
from guided_lgp.params import Params, load_params
from guided_lgp.planning import plan
from guided_lgp.scene import load_scene
from guided_lgp.scene.bullet import pybullet
from guided_lgp.scene.world import world_of

ROOT = Path(__file__).parents[1]
PLANS, EXPERIMENTS = 500, 200
WARM_UP = 5
"""Plans after which every kind of thing that is kept has been made once."""
CLIENTS = 1024
"""As many as PyBullet can have."""
GROWTH_MB = 20.0
"""Less than one PyBullet client takes."""
LIMIT_S = 60.0
OBJECTIVES = ("(on red green)", "(held blue)", "(on red tab2)", "(held green)")

PIPELINE = """
stages:
  generate_scenes:
    cmd: cp place.json reports/training
    deps: [place.json]
    params: [generate_scenes]
    outs: [{reports/training/place.json: {cache: false}}]
"""


@dataclass(frozen=True)
class Plans:
    """What many plans in one process leave behind."""

    solved: int
    clients: int
    growth_mb: float
    """Of the memory in use, after the first few."""
    seconds: float


@dataclass(frozen=True)
class Database:
    """How long (s) it takes to use a database of many experiments."""

    runs: int
    first_s: float
    """The median over the first tenth of the experiments, each with a parent and a stage."""
    last_s: float
    """The same over the last tenth."""
    sync_s: float
    listed_s: float
    """All runs, with parameters and metrics, as the dashboard lists them."""


def many_plans(count: int) -> Plans:
    """Plan again and again in this process."""
    scene, params = load_scene(ROOT / "examples" / "three_boxes.json"), load_params()
    process = psutil.Process()
    others = _clients()  # a world that somebody else in this process keeps has a client, too
    start, before, solved = time.process_time(), 0, 0
    for number in range(count):
        objective = OBJECTIVES[number % len(OBJECTIVES)]
        other = scene.model_copy(update={"name": f"scene {number}"})  # with a world of its own
        solved += plan(other, objective, params=params).solved
        if number < WARM_UP:
            before = process.memory_info().rss
    clients = _clients() - others
    growth = (process.memory_info().rss - before) / 2**20
    return Plans(solved, clients, growth, time.process_time() - start)


def _clients() -> int:
    """How many there are, without the world of the last scene, which is kept."""
    world_of.cache_clear()
    gc.collect()
    return sum(map(pybullet.isConnected, range(CLIENTS)))


def many_experiments(count: int, folder: Path) -> Database:
    """Record the executions of many experiments in one database, then look at it.

    Args:
        count: of the experiments; each has learning curves of the size of the pipeline's.
        folder: an empty one, for a pipeline of one stage and its database.
    """
    params = load_params(ROOT / "params.yaml")
    (folder / "reports" / "training").mkdir(parents=True)
    for file in ("reports/training/place.json", "params.yaml"):
        shutil.copy(ROOT / file, folder)
    (folder / "dvc.yaml").write_text(PIPELINE)
    (folder / ".dvc").mkdir()
    (folder / ".dvc" / "config").write_text("[core]\n    no_scm = true\n    analytics = false\n")
    with chdir(folder), _environment(MLFLOW_TRACKING_URI=f"sqlite:///{folder / 'mlflow.db'}"):
        subprocess.run([sys.executable, "-m", "dvc", "repro", "-q"], check=True)
        times = [_seconds(partial(_record, f"experiment-{n}", params)) for n in range(count)]
        sync_s = _seconds(lambda: tracking.sync(params))
        runs: list[object] = []
        listed_s = _seconds(lambda: runs.extend(_all_runs()))
    tenth = max(1, count // 10)
    first_s, last_s = median(times[:tenth]), median(times[-tenth:])
    return Database(len(runs), first_s, last_s, sync_s, listed_s)


def _record(name: str, params: Params) -> None:
    with _environment(DVC_EXP_NAME=name), tracking.recorded("generate_scenes", params):
        pass


def _all_runs() -> list[object]:
    client = tracking.prepare()
    experiment = client.get_experiment_by_name(tracking.EXPERIMENT).experiment_id
    runs = client.search_runs([experiment])
    found = [*runs]
    while runs.token:
        runs = client.search_runs([experiment], page_token=runs.token)
        found += runs
    return found


def _seconds(action: Callable[[], object]) -> float:
    start = time.monotonic()
    action()
    return time.monotonic() - start


@contextmanager
def _environment(**variables: str) -> Iterator[None]:
    before = dict(os.environ)
    os.environ.update(variables)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)


def main() -> int:
    """Measure, print, judge."""
    with TemporaryDirectory() as folder:
        database = many_experiments(EXPERIMENTS, Path(folder))
    print(f"{EXPERIMENTS} experiments: {json.dumps(asdict(database))}", flush=True)
    plans = many_plans(PLANS)
    print(f"{PLANS} plans: {json.dumps(asdict(plans))}")
    good = plans.clients == 0 and plans.growth_mb < GROWTH_MB and database.runs == 2 * EXPERIMENTS
    return 0 if good and max(database.last_s, database.sync_s, database.listed_s) < LIMIT_S else 1


if __name__ == "__main__":
    sys.exit(main())
