"""What comes of an input: accepted, refused in one line, a foreign exception, or too slow."""

import logging
import multiprocessing
import resource
import signal
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import NoReturn

import psutil

from guided_lgp.errors import InputError

ACCEPTED, REFUSED, FOREIGN, SLOW = "accepted", "refused", "foreign", "slow"
LIMIT_S = 5.0
"""CPU time of one input."""
HANG_S = 600.0
"""Wall clock after which a process that does nothing is killed: others may have the machine."""
_LOOK_S = 1.0
LONGEST = 1200
"""Characters of a refusal; the command line shortens it once more."""

Try = Callable[[int], object]
"""Reads the input of a number; raises InputError where it refuses it."""


class TooSlow(BaseException):
    """Not an Exception, which a reader could take for its own."""


@dataclass
class Verdicts:
    """Outcomes of inputs, and what was said about those that ended badly."""

    counts: Counter[str] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)

    def add(self, outcome: str, fault: str = "") -> None:
        """Count one."""
        self.counts[outcome] += 1
        if fault:
            self.faults.append(fault)

    def figures(self) -> dict[str, int]:
        """How many were tried, and how many of them had each outcome."""
        outcomes = {name: self.counts[name] for name in (ACCEPTED, REFUSED, FOREIGN, SLOW)}
        return {"tried": sum(outcomes.values()), **outcomes}


def outcome_of(attempt: Try, number: int) -> tuple[str, str]:
    """The outcome of one input, and the fault if there is one."""
    try:
        with _cpu_limit():
            attempt(number)
    except InputError as error:
        line = str(error)
        one_line = line.isprintable() and len(line) <= LONGEST
        return (REFUSED, "") if one_line else (FOREIGN, f"{number}: no line: {line[:200]!r}")
    except TooSlow:
        return SLOW, f"{number}: took {LIMIT_S:g} s"
    except (Exception, SystemExit, KeyboardInterrupt) as error:
        return FOREIGN, f"{number}: {type(error).__name__}: {' '.join(str(error).split())[:300]}"
    return ACCEPTED, ""


@contextmanager
def _cpu_limit() -> Iterator[None]:
    def end(*_: object) -> NoReturn:
        raise TooSlow

    before = signal.signal(signal.SIGPROF, end)
    signal.setitimer(signal.ITIMER_PROF, LIMIT_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def judge(attempt: Try, numbers: Sequence[int]) -> Verdicts:
    """Judge inputs in child processes, since one may end the process that reads it."""
    found = Verdicts()
    rest = list(numbers)
    while rest:
        rest = _judge_until_death(attempt, rest, found)
    return found


def _judge_until_death(attempt: Try, numbers: list[int], found: Verdicts) -> list[int]:
    """Judge in one child; returns the numbers that its death has left."""
    context = multiprocessing.get_context("fork")
    receiver, sender = context.Pipe(duplex=False)
    child = context.Process(target=_judge_here, args=(attempt, numbers, sender))
    child.start()
    sender.close()
    done = 0
    while done < len(numbers):
        try:
            hangs = not _answers(receiver, child.pid)
            outcome, fault = (SLOW, f"{numbers[done]}: hangs") if hangs else receiver.recv()
        except EOFError:
            child.join()
            outcome, fault = FOREIGN, f"{numbers[done]}: died with {child.exitcode}"
            hangs = True
        found.add(outcome, fault)
        done += 1
        if hangs:
            child.kill()
            break
    child.join()
    return numbers[done:]


def _answers(receiver: Connection, pid: int) -> bool:
    """Whether a child says something before it has taken too long; some answer no signal."""
    process, end = psutil.Process(pid), time.monotonic() + HANG_S
    before = sum(process.cpu_times()[:2])
    while not receiver.poll(min(_LOOK_S, HANG_S)):
        worked = sum(process.cpu_times()[:2]) - before
        if worked > 4 * LIMIT_S or time.monotonic() > end:
            return False
    return True


def _judge_here(attempt: Try, numbers: list[int], sender: Connection) -> None:
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    logging.disable()  # of warnings, which would come a thousand times
    for number in numbers:
        sender.send(outcome_of(attempt, number))
    sender.close()


def within(seconds: float, condition: Callable[[], bool]) -> bool:
    """Whether a condition comes true in time."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if condition():
            return True
        time.sleep(0.02)
    return False
