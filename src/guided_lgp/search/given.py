"""Sequences of actions that a user gives."""

from pathlib import Path

from guided_lgp.documents import read_json, read_text
from guided_lgp.errors import InputError
from guided_lgp.logic import (
    Skeleton,
    State,
    Symbols,
    applicable_actions,
    format_skeleton,
    parse_skeleton,
    successor,
)
from guided_lgp.logic.pddl import read_plan


def read_skeleton(given: str | Skeleton, symbols: Symbols, start: State) -> Skeleton:
    """Actions as they are, as text, or in a file: a plan, or one action a line.

    Raises:
        InputError: the file cannot be read, or an action is none, or not applicable.
    """
    skeleton = _read(given, symbols) if isinstance(given, str) else given
    state = start
    for number, action in enumerate(skeleton, 1):
        symbols.domain.bind(action)
        possible = list(applicable_actions(state, symbols))
        if action not in possible:
            fault = f"action {number}, {action}, is not applicable"
            raise InputError("skeleton", fault, format_skeleton(possible))
        state = successor(state, action)
    return skeleton


def _read(given: str, symbols: Symbols) -> Skeleton:
    if given.lstrip().startswith("("):
        return parse_skeleton(given)
    file = Path(given)
    if file.suffix == ".json":
        document = read_json(file, "a plan as written by guided-lgp plan --out")
        actions = document.get("actions") if isinstance(document, dict) else None
        if not isinstance(actions, list):
            raise InputError(f"{file}: actions", "are missing", "a plan, or one action a line")
        return parse_skeleton(" ".join(map(str, actions)))
    return read_plan(read_text(file, "a file, or actions such as (grasp pr2L red)"), symbols)
