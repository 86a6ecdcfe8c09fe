"""Errors that a user can mend."""


class InputError(ValueError):
    """Bad input: one line that names the file, the field, the fault and what is accepted.

    The command line prints the message and exits with code 2.
    """

    def __init__(self, where: str, fault: str, accepted: str = "") -> None:
        message = f"{where}: {fault}"
        super().__init__(f"{message} (accepted: {accepted})" if accepted else message)
