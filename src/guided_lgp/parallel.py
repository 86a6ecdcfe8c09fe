"""Fan-out inside a stage: the same code on one machine or on a Dask cluster."""

import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import closing, contextmanager
from itertools import islice
from typing import Any, TypeVar

from guided_lgp.errors import InputError, WorkerError
from guided_lgp.params import Parallel

Task = TypeVar("Task")
Result = TypeVar("Result")

SCHEDULER_VARIABLE = "DASK_SCHEDULER_ADDRESS"
SCHEDULER_TIMEOUT_S = 10.0
MILESTONES = 10
"""Lines of progress that one fan-out writes where there is no terminal."""
WATCH_S = 0.5
"""Time between two looks at whether the parent process is there."""

WORKERLESS_S = 120.0
"""How long tasks wait for a Dask worker where there is none."""
LOOK_S = 0.01
"""Time between two looks at whether a Dask task has finished."""
AHEAD = 10_000
"""Tasks that a Dask scheduler is given at a time: more than workers, and few enough to keep."""

logger = logging.getLogger(__name__)

_Arguments = tuple[Callable[..., Any], Any, str]
_KILLED = "{}: a worker process was killed, most often for lack of memory"


def run(
    function: Callable[[Task], Result],
    tasks: Sequence[Task],
    settings: Parallel,
    description: str,
) -> list[Result]:
    """Apply a function to every task; the results come in the order of the tasks.

    Args:
        function: importable, and a function of its task alone: results do not depend on how many
            workers there are.
        tasks: picklable arguments.
        settings: back end and number of workers; each worker has one thread.
        description: a few words for the progress display.

    Raises:
        InputError: the back end is not installed or cannot be reached.
        WorkerError: a task failed, or a worker was killed.
    """
    return list(stream(function, tasks, settings, description))


def stream(
    function: Callable[[Task], Result],
    tasks: Sequence[Task],
    settings: Parallel,
    description: str,
) -> Iterator[Result]:
    """Like :func:`run`, but each result is available as soon as all before it are."""
    calls = (
        (function, task, f"{description}: task {number} of {len(tasks)}")
        for number, task in enumerate(tasks, 1)
    )
    on = _on_dask if settings.backend == "dask" else _on_loky
    workers = min(settings.workers, max(len(tasks), 1))
    with (
        progress(len(tasks), description) as advance,
        closing(on(calls, workers, description)) as results,
    ):
        for result in results:
            advance()
            yield result


def _on_loky(
    calls: Iterator[_Arguments], workers: int, description: str
) -> Generator[Any, None, None]:
    import joblib
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    with joblib.parallel_config(
        "loky",
        max_nbytes=None,  # arrays go through pipes: files of them would outlive a kill
        inner_max_num_threads=1,
        initializer=end_with_parent,
        initargs=(os.getpid(), signal.SIGKILL),
    ):
        pool = joblib.Parallel(n_jobs=workers, return_as="generator")
    try:
        with closing(pool(joblib.delayed(_call)(*call) for call in calls)) as results:
            yield from results
    except TerminatedWorkerError as error:
        raise WorkerError(_KILLED.format(description)) from error


def _on_dask(
    calls: Iterator[_Arguments], workers: int, description: str
) -> Generator[Any, None, None]:
    """Results in order. Not through joblib, which waits for ever for a task that kills workers."""
    with _dask_client(workers) as client:
        from dask.distributed import CancelledError, KilledWorker, as_completed

        finished = as_completed(loop=client.loop)
        numbers: dict[Any, int] = {}
        results: dict[int, Any] = {}
        submitted = yielded = 0
        try:
            while True:
                for call in islice(calls, AHEAD - len(numbers)):
                    future = client.submit(_call, *call, pure=False)
                    numbers[future] = submitted
                    submitted += 1
                    finished.add(future)
                if not numbers:
                    return
                _await(finished, client, description)
                future = next(finished)
                results[numbers.pop(future)] = future.result()
                while yielded in results:
                    yield results.pop(yielded)
                    yielded += 1
        except (KilledWorker, CancelledError) as error:
            raise WorkerError(_KILLED.format(description)) from error


def _await(finished: Any, client: Any, description: str) -> None:
    """Return when a task has finished; give up where there are no workers for long."""
    last = time.monotonic()
    while not finished.has_ready():
        if client.scheduler_info()["workers"]:
            last = time.monotonic()
        elif time.monotonic() - last > WORKERLESS_S:
            raise WorkerError(f"{description}: no Dask worker for {WORKERLESS_S:.0f} s")
        time.sleep(LOOK_S)


def end_with_parent(parent: int, number: signal.Signals) -> None:
    """Make this process end when its parent has died, whatever ended that.

    Nobody waits for its results any more, and nothing else tells it: a worker would finish its
    task, and a stage whose DVC was killed all of them.

    Args:
        parent: process id of the parent, which may be dead by now.
        number: signal that this process is to receive.
    """

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(WATCH_S)
        os.kill(os.getpid(), number)

    threading.Thread(target=watch, name="end with parent", daemon=True).start()


def _call(function: Callable[[Task], Result], task: Task, label: str) -> Result:
    try:
        return function(task)
    except InputError:
        raise
    except Exception as error:
        reason = ": ".join(filter(None, (type(error).__name__, str(error))))
        raise WorkerError(f"{label} failed: {reason}") from error


def _dask_client(workers: int) -> Any:
    try:
        from dask.distributed import Client
    except ImportError:
        raise InputError(
            "params.yaml: parallel.backend",
            "dask is not installed",
            "loky, or install the extra: pip install 'guided-lgp[cluster]'",
        ) from None
    address = os.environ.get(SCHEDULER_VARIABLE)
    if not address:
        return Client(n_workers=workers, threads_per_worker=1, dashboard_address=None)
    try:
        return Client(address, timeout=SCHEDULER_TIMEOUT_S)
    except (OSError, ValueError) as error:
        raise InputError(SCHEDULER_VARIABLE, f"no scheduler at {address}: {error}") from None


@contextmanager
def progress(total: int, description: str) -> Iterator[Callable[[], None]]:
    """Show how far something is: a bar on a terminal, a line per milestone elsewhere.

    Yields:
        A function to call once per finished step.
    """
    if not sys.stderr.isatty():
        yield _Milestones(total, description).advance
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
    from rich.progress import TimeRemainingColumn as Remaining

    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn()
    with Progress(*columns, TimeElapsedColumn(), Remaining(), console=Console(stderr=True)) as bar:
        task = bar.add_task(description, total=total)
        yield lambda: bar.advance(task)


class _Milestones:
    """Progress for a log file: one line per tenth of the steps."""

    def __init__(self, total: int, description: str) -> None:
        self._total = total
        self._description = description
        self._done = 0
        self._start = time.monotonic()

    def advance(self) -> None:
        self._done += 1
        before = MILESTONES * (self._done - 1) // self._total
        if MILESTONES * self._done // self._total > before:
            elapsed = time.monotonic() - self._start
            logger.info("%s: %d/%d, %.0f s", self._description, self._done, self._total, elapsed)
