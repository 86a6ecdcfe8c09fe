"""Running a program: errors become one line and an exit code."""

import errno
import gc
import logging
import os
import select
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import NoReturn

import typer
from typer.exceptions import TyperException

from guided_lgp.errors import InputError, WorkerError, printable, shortened


def run_program(program: Callable[[list[str]], int | None], arguments: Sequence[str]) -> NoReturn:
    """Run a program; every error becomes one line on standard error and an exit code.

    Args:
        program: is given the words of the command line; what it returns is the exit code.
        arguments: these words, and anywhere among them ``--debug`` for the traceback of an error.
    """
    _open_streams()
    debug = "--debug" in arguments
    logging.basicConfig(format="%(message)s", level=logging.WARNING)
    logging.getLogger("guided_lgp").setLevel(logging.DEBUG if debug else logging.INFO)
    try:
        code = program([word for word in arguments if word != "--debug"])
        sys.stdout.flush()
    except (InputError, TyperException) as error:
        _fail(error, 2, debug)
    except ModuleNotFoundError as error:
        _fail(_missing(error), 2, debug)
    except KeyboardInterrupt:
        sys.exit(130)
    except (BrokenPipeError, SystemExit) as error:
        if _has_been_read_enough(error):
            # What is still buffered goes nowhere, without another error.
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
            sys.exit(0)
        if isinstance(error, SystemExit):
            raise
        _fail(error, 3, debug)
    except MemoryError as error:
        _fail(error if debug else WorkerError("out of memory"), 3, debug)
    except OSError as error:
        fault = _mendable(error)
        _fail(fault or error, 2 if fault else 3, debug)
    except Exception as error:
        _fail(error, 3, debug)
    sys.exit(code)


def _mendable(error: OSError) -> InputError | None:
    """What a user can do something about, wherever it comes up."""
    where = str(error.filename or "output")
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return InputError(where, f"cannot be written: {error.strerror}")
    if error.errno in (errno.ENAMETOOLONG, errno.ELOOP):
        return InputError(where, str(error.strerror), "a file")
    return None


def _open_streams() -> None:
    """Open what the caller has closed of the three streams, on nothing.

    Else the next file that is opened would be one of them, and get what is written there.
    """
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            nothing = os.open(os.devnull, os.O_RDWR)
            if nothing != number:
                os.dup2(nothing, number)
                os.close(nothing)
            setattr(sys, name, os.fdopen(number, "w" if number else "r"))


def _has_been_read_enough(error: BaseException) -> bool:
    """Whether this comes of a reader of standard output who has gone; Typer ends with 1 then."""
    if not any(isinstance(one, BrokenPipeError) for one in (error, error.__context__)):
        return False
    output = select.poll()
    output.register(1, 0)
    return any(event & (select.POLLERR | select.POLLHUP) for _, event in output.poll(0))


def complain(line: str) -> None:
    """Write a line to standard error, if anybody reads it: the exit code says the same."""
    with suppress(BrokenPipeError):
        typer.echo(line, err=True)


@contextmanager
def lasting_imports() -> Iterator[None]:
    """Import what a command needs: cycles are not looked for in what stays to the end."""
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


@contextmanager
def within(seconds: float | None, what: str) -> Iterator[None]:
    """End the program with code 1 and one line when something takes longer; its workers with it.

    Args:
        seconds: how long it may take; None for ever.
        what: its name, for the line.
    """

    def end(*_: object) -> NoReturn:
        # No Exception, which libraries would take for a fault of their own.
        raise SystemExit(f"{what}: not finished after {seconds:g} s")

    before = signal.signal(signal.SIGALRM, end)
    signal.setitimer(signal.ITIMER_REAL, seconds or 0)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


_EXTRAS = {
    "PIL": "view",
    "dask": "cluster",
    "distributed": "cluster",
    "gymnasium": "gym",
    "rosbags": "ros",
    "viser": "view",
}
"""The extra that brings a package, where it is not ``pipeline``."""


def _missing(error: ModuleNotFoundError) -> Exception:
    """What to install for a package that the core goes without; a module of our own is a fault."""
    package = (error.name or "").partition(".")[0]
    if package in ("", "guided_lgp"):
        return error
    extra = _EXTRAS.get(package, "pipeline")
    return InputError(
        f"package {package}", "is not installed", f"pip install 'guided-lgp[{extra}]'"
    )


def _fail(error: Exception, code: int, debug: bool) -> NoReturn:
    if debug:
        raise error
    text = error.format_message() if isinstance(error, TyperException) else str(error)
    if code == 3 and not isinstance(error, WorkerError):
        text = f"internal error: {type(error).__name__}: {text}; --debug shows where"
    complain(shortened(f"error: {printable(' '.join(text.split()))}"))
    sys.exit(code)
