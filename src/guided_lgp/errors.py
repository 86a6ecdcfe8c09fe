"""Errors that a user can mend."""

import sys

LONGEST = 300
"""Characters of a line that says what is wrong."""


def shortened(text: str) -> str:
    """The text, or its beginning and its end, which name the place and what is accepted."""
    begin, end = LONGEST * 2 // 3, LONGEST // 3 - len(" … ")
    return text if len(text) <= LONGEST else f"{text[:begin]} … {text[-end:]}"


def printable(text: str) -> str:
    """The text with escapes for the characters that do not print."""
    return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


class InputError(ValueError):
    """Bad input: one line that names the file, the field, the fault and what is accepted.

    The command line prints the message and exits with code 2. Characters that do not print are
    shown as escapes, so that names in a file cannot break the line or reach the terminal.
    """

    def __init__(self, where: str, fault: str, accepted: str = "") -> None:
        super().__init__(where, fault, accepted)  # all of them, so that it survives pickling

    def __str__(self) -> str:
        where, fault, accepted = self.args
        fault = shortened(fault)
        text = f"{where}: {fault} (accepted: {accepted})" if accepted else f"{where}: {fault}"
        return printable(text)


def pybullet_remedy(version: tuple[int, int] = sys.version_info[:2]) -> str:
    """What to do where PyBullet is missing: it has no wheels for Python 3.12 and newer."""
    if version < (3, 12):
        return "pip install pybullet"
    return "pip install pybullet (compiles it with a C++ compiler), or Python 3.10 or 3.11"


class WorkerError(RuntimeError):
    """A task failed in a worker process; the message is one line, the cause has the traceback."""
