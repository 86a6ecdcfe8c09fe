"""Actions and goals: names with symbols, read and written as ``(grasp pr2L red)``."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from guided_lgp.errors import InputError


@dataclass(frozen=True, order=True)
class Action:
    """A high-level action a_k = (instruction, symbols) (paper, Sec. II-A)."""

    instruction: str
    symbols: tuple[str, ...]

    def __str__(self) -> str:
        return _phrase(self.instruction, self.symbols)

    @classmethod
    def parse(cls, text: str) -> "Action":
        """Read ``(instruction symbol ...)``; whether there is such an action, a domain says.

        Raises:
            InputError: the text has another form.
        """
        return cls(*_words(text, "action", "(instruction symbol ...)"))


@dataclass(frozen=True, order=True)
class Goal:
    """A goal g_j = (goal type, symbols) (paper, Sec. II-B)."""

    kind: str
    symbols: tuple[str, ...]

    def __str__(self) -> str:
        return _phrase(self.kind, self.symbols)

    @classmethod
    def parse(cls, text: str) -> "Goal":
        """Read ``(goal-type symbol ...)``; whether there is such a goal, a domain says.

        Raises:
            InputError: the text has another form.
        """
        return cls(*_words(text, "goal", "(goal-type symbol ...)"))


Skeleton = tuple[Action, ...]
"""A sequence of high-level actions a_1:K."""


def format_skeleton(actions: Iterable[Action]) -> str:
    """Write a skeleton as one line, readable by :func:`parse_skeleton`."""
    return " ".join(map(str, actions))


def parse_skeleton(text: str) -> Skeleton:
    """Read a skeleton written by :func:`format_skeleton`.

    Raises:
        InputError: one of the actions, or what is between them, cannot be read.
    """
    return tuple(Action.parse(part) for part in re.findall(r"\([^()]*\)|[^()\s]+|[()]", text))


def _phrase(name: str, symbols: tuple[str, ...]) -> str:
    return f"({' '.join((name, *symbols))})"


def _words(text: str, what: str, accepted: str) -> tuple[str, tuple[str, ...]]:
    stripped = text.strip()
    if not re.fullmatch(r"\([^()]*\)", stripped) or not stripped[1:-1].split():
        article = "an" if what[0] in "aeiou" else "a"
        raise InputError(f"{what} {text!r}", f"is not {article} {what}", accepted)
    name, *symbols = stripped[1:-1].split()
    return name, tuple(symbols)
