"""Fan-out: order, independence of the number of workers, errors, Dask."""

import logging
import os
import pickle
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import dask
import numpy as np
import psutil
import pytest
from numpy.typing import NDArray

from guided_lgp import parallel
from guided_lgp.errors import InputError, WorkerError
from guided_lgp.parallel import run, stream
from guided_lgp.params import Parallel

ONE = Parallel(backend="loky", workers=1)
TWO = Parallel(backend="loky", workers=2)


def square(number: int) -> int:
    return number * number


def slow_first(number: int) -> int:
    time.sleep(0.3 if number == 0 else 0.0)
    return number


def blas_threads(_: int) -> str | None:
    return os.environ.get("OMP_NUM_THREADS")


def fail_at_two(number: int) -> int:
    if number == 2:
        raise ZeroDivisionError("no such number")
    return number


def bad_input(_: int) -> int:
    raise InputError("scene.json: boxes.0", "floats 2 cm above tab1", "a box that stands")


def die(_: int) -> int:
    os._exit(1)


def total(array: NDArray[np.int64]) -> int:
    assert not isinstance(array, np.memmap)
    return int(array.sum())


def exhaust_memory(_: int) -> int:
    before = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (2**33, before[1]))
    try:
        return len(bytearray(2**34))
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)


def announce(folder: Path) -> int:
    """Leave a file named by the process, and take a while."""
    (folder / f"{os.getpid()}").touch()
    time.sleep(0.5)
    return len(folder.name)


def keep_busy(folder: Path) -> None:
    """Leave a file named by the process, then compute for a minute."""
    (folder / str(os.getpid())).touch()
    end = time.monotonic() + 60
    while time.monotonic() < end:
        pass


# A shell that starts the tests in the background has them, and all below, ignore SIGINT.
FAN_OUT = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
from pathlib import Path
from test_parallel import keep_busy
from guided_lgp.parallel import run
from guided_lgp.params import Parallel
run(keep_busy, 2 * [Path({folder!r})], Parallel(backend={backend!r}, workers=2), "busy")
"""
STAGE = """
from guided_lgp.cli import end_with_dvc
end_with_dvc()
"""
STUDY = """
import runpy, sys
from guided_lgp.studies import train
train.train = lambda root, case: exec({fan_out!r}, {{}})
sys.argv[1:] = ["train", "paper"]
runpy.run_path({script!r}, run_name="__main__")
"""
STUDIES = Path(__file__).parents[1] / "studies" / "run.py"
STARTER = "import subprocess, sys; subprocess.run([sys.executable, '-c', sys.argv[1]])"


def start(folder: Path, *words: str) -> tuple[subprocess.Popen[bytes], list[psutil.Process]]:
    """Start Python with a fan-out of `keep_busy` below it, and wait until that is under way."""
    process = subprocess.Popen(
        [sys.executable, "-c", *words],
        env=os.environ | {"PYTHONPATH": str(Path(__file__).parent)},
        stderr=subprocess.DEVNULL,
    )
    wait_until(lambda: len(list(folder.iterdir())) == 2, 30)
    return process, psutil.Process(process.pid).children(recursive=True)


def wait_until(condition: Callable[[], bool], limit: float) -> None:
    end = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.05)


def gone(process: psutil.Process) -> bool:
    return not process.is_running() or process.status() == psutil.STATUS_ZOMBIE


@pytest.mark.parametrize("settings", [ONE, TWO])
def test_results_come_in_the_order_of_the_tasks(settings: Parallel) -> None:
    assert run(square, range(7), settings, "squares") == [0, 1, 4, 9, 16, 25, 36]
    assert run(slow_first, range(5), settings, "sleep") == list(range(5))


def test_no_tasks_no_results() -> None:
    assert run(square, [], TWO, "nothing") == []


def test_a_stream_can_be_left_early() -> None:
    results: Iterator[int] = stream(square, range(100), TWO, "squares")
    assert [next(results) for _ in range(3)] == [0, 1, 4]
    results.close()  # type: ignore[attr-defined]
    assert run(square, range(3), TWO, "squares") == [0, 1, 4]


def test_each_worker_has_one_thread() -> None:
    assert set(run(blas_threads, range(4), TWO, "threads")) == {"1"}


@pytest.mark.parametrize("settings", [ONE, TWO])
def test_a_failing_task_is_named_in_one_line(settings: Parallel) -> None:
    with pytest.raises(WorkerError) as caught:
        run(fail_at_two, range(4), settings, "enumerate")
    expected = "enumerate: task 3 of 4 failed: ZeroDivisionError: no such number"
    assert str(caught.value) == expected


@pytest.mark.parametrize("settings", [ONE, TWO])
def test_bad_input_stays_bad_input(settings: Parallel) -> None:
    with pytest.raises(InputError, match=r"scene\.json: boxes\.0: floats 2 cm above tab1"):
        run(bad_input, range(3), settings, "check")


def test_input_errors_survive_pickling() -> None:
    error = InputError("a.json", "is not JSON", "JSON")
    assert str(pickle.loads(pickle.dumps(error))) == "a.json: is not JSON (accepted: JSON)"


def test_a_killed_worker_is_reported() -> None:
    with pytest.raises(WorkerError, match="a worker process was killed"):
        run(die, range(2), TWO, "solve")


def test_a_worker_without_memory_is_reported() -> None:
    with pytest.raises(WorkerError, match=r"solve: task \d of 2 failed: MemoryError$"):
        run(exhaust_memory, range(2), TWO, "solve")


def test_large_arguments_leave_no_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A worker gets arrays of many megabytes through its pipe: nothing is left after a kill."""
    monkeypatch.setenv("JOBLIB_TEMP_FOLDER", str(tmp_path))
    arrays = [np.full(10**6, number) for number in range(3)]
    assert run(total, arrays, TWO, "sum") == [0, 10**6, 2 * 10**6]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
@pytest.mark.parametrize("backend", ["loky", "dask"])
def test_workers_end_with_the_process_that_started_them(
    backend: str, number: signal.Signals, tmp_path: Path
) -> None:
    parent, below = start(tmp_path, FAN_OUT.format(folder=str(tmp_path), backend=backend))
    assert {int(file.name) for file in tmp_path.iterdir()} <= {process.pid for process in below}
    parent.send_signal(number)
    assert parent.wait(60) != 0
    wait_until(lambda: all(map(gone, below)), 60)


@pytest.mark.parametrize("kind", ["pipeline", "studies"])
def test_a_stage_and_its_workers_end_with_the_process_that_runs_stages(
    kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("DVC_STAGE", "stage")
    fan_out = FAN_OUT.format(folder=str(tmp_path), backend="loky")
    study = STUDY.format(fan_out=fan_out, script=str(STUDIES))
    runner, below = start(tmp_path, STARTER, STAGE + fan_out if kind == "pipeline" else study)
    runner.kill()
    runner.wait(60)
    wait_until(lambda: all(map(gone, below)), 30)  # half as long as the tasks would take


def test_progress_in_a_pipe_is_a_line_per_milestone(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.INFO, logger="guided_lgp"):
        run(square, range(40), ONE, "squares")
    lines = [record.getMessage() for record in caplog.records]
    assert len(lines) == 10
    assert lines[0].startswith("squares: 4/40")
    assert lines[-1].startswith("squares: 40/40")


def test_dask_gives_the_same_results(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DASK_SCHEDULER_ADDRESS", raising=False)
    settings = Parallel(backend="dask", workers=2)
    assert run(square, range(7), settings, "squares") == run(square, range(7), TWO, "squares")


def test_a_task_that_kills_dask_workers_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DASK_SCHEDULER_ADDRESS", raising=False)
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 0}),
        pytest.raises(WorkerError, match="a worker process was killed"),
    ):
        run(die, range(2), Parallel(backend="dask", workers=1), "solve")


def test_a_dask_cluster_behaves_like_the_workers_of_one_machine(
    machines: list[subprocess.Popen[bytes]], monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = Parallel(backend="dask", workers=1)
    for ahead in (parallel.AHEAD, 2):
        monkeypatch.setattr(parallel, "AHEAD", ahead)
        assert run(slow_first, range(5), settings, "sleep") == list(range(5))
    assert run(square, [], settings, "nothing") == []
    with pytest.raises(WorkerError, match="enumerate: task 3 of 4 failed: ZeroDivisionError"):
        run(fail_at_two, range(4), settings, "enumerate")
    with pytest.raises(InputError, match="floats 2 cm above tab1"):
        run(bad_input, range(3), settings, "check")
    results = stream(square, range(100), settings, "squares")
    assert [next(results) for _ in range(3)] == [0, 1, 4]
    results.close()  # type: ignore[attr-defined]


def test_a_dask_cluster_goes_on_without_a_worker_and_ends_without_any(
    machines: list[subprocess.Popen[bytes]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    settings = Parallel(backend="dask", workers=1)
    results = stream(announce, 10 * [tmp_path], settings, "announce")
    assert next(results) == len(tmp_path.name)
    wait_until(lambda: len(list(tmp_path.iterdir())) == 2, 30)
    machines[0].kill()
    assert list(results) == 9 * [len(tmp_path.name)]

    monkeypatch.setattr(parallel, "WORKERLESS_S", 1.0)
    machines[1].kill()
    with pytest.raises(WorkerError, match="announce: no Dask worker for 1 s"):
        run(announce, 2 * [tmp_path], settings, "announce")


def test_dask_without_its_extra_is_bad_input(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "dask.distributed", None)
    with pytest.raises(InputError, match="dask is not installed"):
        run(square, range(3), Parallel(backend="dask", workers=1), "squares")


def test_an_unreachable_dask_scheduler_is_bad_input(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DASK_SCHEDULER_ADDRESS", "tcp://127.0.0.1:1")
    monkeypatch.setattr(parallel, "SCHEDULER_TIMEOUT_S", 0.2)
    with pytest.raises(InputError, match=r"no scheduler at tcp://127\.0\.0\.1:1"):
        run(square, range(3), Parallel(backend="dask", workers=1), "squares")
