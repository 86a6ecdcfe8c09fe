"""When the bounds of a scene have to give up: for users who cannot wait."""

import math
import time
from dataclasses import dataclass


class OutOfTimeError(Exception):
    """There is no verdict, because the time is up."""


@dataclass(frozen=True)
class Deadline:
    """A moment (s of ``time.perf_counter``) after which nothing is computed any more."""

    moment: float = math.inf

    @classmethod
    def after(cls, seconds: float | None) -> "Deadline":
        """So many seconds from now; never for None."""
        return cls() if seconds is None else cls(time.perf_counter() + seconds)

    @property
    def passed(self) -> bool:
        """Whether the time is up."""
        return time.perf_counter() >= self.moment

    def check(self) -> None:
        """Go on only while there is time.

        Raises:
            OutOfTimeError: the time is up.
        """
        if self.passed:
            raise OutOfTimeError


NEVER = Deadline()
"""Experiments have no limit of time, so that their results are the same anywhere."""
