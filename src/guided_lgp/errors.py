"""Errors that a user can mend."""


class InputError(ValueError):
    """Bad input: one line that names the file, the field, the fault and what is accepted.

    The command line prints the message and exits with code 2. Characters that do not print are
    shown as escapes, so that names in a file cannot break the line or reach the terminal.
    """

    def __init__(self, where: str, fault: str, accepted: str = "") -> None:
        super().__init__(where, fault, accepted)  # all of them, so that it survives pickling

    def __str__(self) -> str:
        where, fault, accepted = self.args
        text = f"{where}: {fault} (accepted: {accepted})" if accepted else f"{where}: {fault}"
        return "".join(c if c.isprintable() else repr(c)[1:-1] for c in text)


class WorkerError(RuntimeError):
    """A task failed in a worker process; the message is one line, the cause has the traceback."""
