"""The order of files, and a Dask cluster whose workers can be killed."""

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from dask.distributed import LocalCluster

LONGEST = (
    "test_pipeline.py",
    "test_stage_sources.py",
    "test_cases.py",
    "test_documentation.py",
    "test_hostile.py",
    "test_plans.py",
    "test_interruption.py",
)
"""What takes longest comes first, so that no worker is left alone with it at the end."""


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Begin with the longest files."""
    ranks = {name: rank for rank, name in enumerate(LONGEST)}
    items.sort(key=lambda item: ranks.get(item.path.name, len(ranks)))


@pytest.fixture
def machines(monkeypatch: pytest.MonkeyPatch) -> Iterator[list[subprocess.Popen[bytes]]]:
    """Two Dask workers that nobody restarts, as on two machines, and their scheduler."""
    words = [sys.executable, "-m", "distributed.cli.dask_worker", "--no-nanny", "--no-dashboard"]
    here = {"OMP_NUM_THREADS": "1", "PYTHONPATH": str(Path(__file__).parent)}
    with LocalCluster(n_workers=0, dashboard_address=None) as cluster:
        command = [*words, "--nthreads", "1", cluster.scheduler_address]
        workers = [
            subprocess.Popen(command, env=os.environ | here, stderr=subprocess.DEVNULL)
            for _ in range(2)
        ]
        monkeypatch.setenv("DASK_SCHEDULER_ADDRESS", cluster.scheduler_address)
        try:
            cluster.wait_for_workers(2, timeout=60)
            yield workers
        finally:
            for worker in workers:
                worker.kill()
                worker.wait()
