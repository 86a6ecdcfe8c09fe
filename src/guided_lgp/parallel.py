"""Fan-out inside a stage: the same code on one machine or on a Dask cluster."""

import logging
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
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

logger = logging.getLogger(__name__)


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
    with ExitStack() as stack:
        advance = stack.enter_context(progress(len(tasks), description))
        for result in _results(function, tasks, settings, description, stack):
            advance()
            yield result


def _results(
    function: Callable[[Task], Result],
    tasks: Sequence[Task],
    settings: Parallel,
    description: str,
    stack: ExitStack,
) -> Iterator[Result]:
    import joblib
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    workers = min(settings.workers, max(len(tasks), 1))
    backend: dict[str, Any] = {
        "backend": "loky",
        "inner_max_num_threads": 1,
        "initializer": end_with_parent,
        "initargs": (os.getpid(), signal.SIGKILL),
    }
    if settings.backend == "dask":
        stack.enter_context(_dask_client(workers))
        backend, workers = {"backend": "dask"}, -1
    with joblib.parallel_config(**backend):
        pool = joblib.Parallel(n_jobs=workers, return_as="generator")
    labels = (
        f"{description}: task {number} of {len(tasks)}" for number in range(1, len(tasks) + 1)
    )
    calls = (joblib.delayed(_call)(function, *pair) for pair in zip(tasks, labels, strict=True))
    try:
        yield from stack.enter_context(closing(pool(calls)))
    except TerminatedWorkerError as error:
        raise WorkerError(
            f"{description}: a worker process was killed, most often for lack of memory"
        ) from error


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
        raise WorkerError(f"{label} failed: {type(error).__name__}: {error}") from error


def _dask_client(workers: int) -> Any:
    try:
        from dask.distributed import Client
    except ImportError:
        raise InputError(
            "params.yaml: parallel.backend",
            "dask is not installed",
            "loky, or install the extra: pip install 'guided-lgp[dask]'",
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
