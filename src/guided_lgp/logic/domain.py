"""Actions, goals and symbolic states of the pick-and-place domain (DESIGN §2).

The rules are the permissive ones of the original LGP: placing on a box that another gripper holds
and grasping a box with others on top are legal; geometry decides whether they are feasible.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

from guided_lgp.errors import InputError
from guided_lgp.logic.symbols import Symbols


@dataclass(frozen=True, order=True)
class Action:
    """A high-level action a_k = (instruction, symbols) (paper, Sec. II-A)."""

    instruction: Literal["grasp", "place"]
    gripper: str
    box: str
    table: str | None = None

    def __str__(self) -> str:
        return f"({' '.join(filter(None, (self.instruction, self.gripper, self.box, self.table)))})"

    @classmethod
    def parse(cls, text: str) -> "Action":
        """Read ``(grasp gripper box)`` or ``(place gripper box table)``.

        Raises:
            InputError: the text has another form.
        """
        match _words(text):
            case ["grasp", gripper, box]:
                return cls("grasp", gripper, box)
            case ["place", gripper, box, table]:
                return cls("place", gripper, box, table)
        raise InputError(
            f"action {text!r}", "is not an action", "(grasp gripper box), (place gripper box table)"
        )


@dataclass(frozen=True, order=True)
class Goal:
    """A goal g_j = (goal type, symbols) (paper, Sec. II-B)."""

    kind: Literal["held", "on"]
    box: str
    table: str | None = None

    def __str__(self) -> str:
        return f"({' '.join(filter(None, (self.kind, self.box, self.table)))})"

    @classmethod
    def parse(cls, text: str) -> "Goal":
        """Read ``(held box)`` or ``(on box table)``.

        Raises:
            InputError: the text has another form.
        """
        match _words(text):
            case ["held", box]:
                return cls("held", box)
            case ["on", box, table]:
                return cls("on", box, table)
        raise InputError(f"goal {text!r}", "is not a goal", "(held box), (on box table)")


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


@dataclass(frozen=True)
class State:
    """What holds what and what stands on what.

    ``support`` maps every box that stands to what it stands on; ``held`` maps every box that is
    held to its gripper. Both are sorted tuples of pairs, so that equal states compare equal.
    """

    support: tuple[tuple[str, str], ...]
    held: tuple[tuple[str, str], ...] = ()

    @classmethod
    def of(cls, support: Mapping[str, str], held: Mapping[str, str] | None = None) -> "State":
        """Build a state from dictionaries."""
        return cls(tuple(sorted(support.items())), tuple(sorted((held or {}).items())))

    def holder(self, box: str) -> str | None:
        """The gripper that holds the box, if any."""
        return next((gripper for held, gripper in self.held if held == box), None)

    def held_by(self, gripper: str) -> str | None:
        """The box that the gripper holds, if any."""
        return next((box for box, holder in self.held if holder == gripper), None)

    def support_of(self, box: str) -> str | None:
        """What the box stands on; None while it is held."""
        return next((table for standing, table in self.support if standing == box), None)

    def standing_on(self, table: str) -> tuple[str, ...]:
        """The boxes that stand directly on a table or box, sorted."""
        return tuple(box for box, support in self.support if support == table)

    def carried_by(self, table: str) -> tuple[str, ...]:
        """The boxes that stand on a table or box directly or through others."""
        direct = self.standing_on(table)
        return direct + tuple(box for below in direct for box in self.carried_by(below))

    def satisfies(self, goal: Goal) -> bool:
        """Whether the goal holds in this state."""
        if goal.kind == "held":
            return self.holder(goal.box) is not None
        return self.support_of(goal.box) == goal.table


def applicable_actions(state: State, symbols: Symbols) -> Iterator[Action]:
    """The children of a node in their fixed order: grippers, then boxes or tables as declared."""
    for gripper in symbols.grippers:
        box = state.held_by(gripper)
        if box is None:
            for candidate in symbols.boxes:
                if state.holder(candidate) is None:
                    yield Action("grasp", gripper, candidate)
        else:
            barred = {box, *state.carried_by(box)}
            for table in symbols.tables:
                if table not in barred:
                    yield Action("place", gripper, box, table)


def successor(state: State, action: Action) -> State:
    """The state after an applicable action; what stands on the box moves with it."""
    if action.instruction == "grasp":
        support = tuple(pair for pair in state.support if pair[0] != action.box)
        return State(support, tuple(sorted((*state.held, (action.box, action.gripper)))))
    assert action.table is not None
    support = tuple(sorted((*state.support, (action.box, action.table))))
    return State(support, tuple(pair for pair in state.held if pair[0] != action.box))


def progress(state: State, actions: Iterable[Action]) -> State:
    """The state after a sequence of applicable actions."""
    for action in actions:
        state = successor(state, action)
    return state


def _words(text: str) -> list[str]:
    stripped = text.strip()
    if not (stripped.startswith("(") and stripped.endswith(")")):
        return []
    return stripped[1:-1].split()
