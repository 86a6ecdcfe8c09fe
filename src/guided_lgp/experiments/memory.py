"""Peak memory of one piece of work within a process."""

import resource
from contextlib import suppress
from pathlib import Path

_STATUS = Path("/proc/self/status")
_RESET = Path("/proc/self/clear_refs")


def reset_peak() -> None:
    """Start to measure: on Linux the kernel forgets the process's peak."""
    with suppress(OSError):  # another system, or a container that forbids it
        _RESET.write_text("5", encoding="ascii")


def peak_mb() -> float:
    """Highest resident memory (MB) of this process since :func:`reset_peak`.

    Libraries included. Where the kernel cannot reset it, the peak since the process started.
    """
    if _STATUS.exists():
        for line in _STATUS.read_text(encoding="ascii").splitlines():
            if line.startswith("VmHWM:"):
                return int(line.split()[1]) / 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
