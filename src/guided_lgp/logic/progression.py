"""Which actions a state allows, and the states they lead to."""

from bisect import insort
from collections.abc import Iterable
from functools import lru_cache

from guided_lgp.logic.actions import Action
from guided_lgp.logic.domain import Domain
from guided_lgp.logic.packed import packed_states
from guided_lgp.logic.state import State
from guided_lgp.logic.symbols import Symbols

_KEPT = 4096
"""Successors that are kept: what is asked for comes from the same few states again and again."""


def applicable_actions(state: State, symbols: Symbols) -> tuple[Action, ...]:
    """The children of a node in their fixed order; see ``ground_instructions``."""
    packed = packed_states(symbols)
    return packed.moves(packed.pack(state)).actions


def successor(state: State, action: Action) -> State:
    """The state after an applicable action; what stands on the body moves with it."""
    return _successor(state, state.domain, action)


@lru_cache(_KEPT)
def _successor(state: State, domain: Domain, action: Action) -> State:
    """The same; states of different domains may be equal."""
    ground = domain.bind(action)
    support = [edge for edge in state.support if edge[0] != ground.body]
    held = [edge for edge in state.held if edge[0] != ground.body]
    insort(held if ground.into_hand else support, (ground.body, ground.parent))
    return State(tuple(support), tuple(held), ground.facts_after(state), domain)


def progress(state: State, actions: Iterable[Action]) -> State:
    """The state after a sequence of applicable actions."""
    for action in actions:
        state = successor(state, action)
    return state


def are_applicable(actions: Iterable[Action], state: State, symbols: Symbols) -> bool:
    """Whether every action of a sequence can be carried out in its turn."""
    for action in actions:
        if action not in applicable_actions(state, symbols):
            return False
        state = successor(state, action)
    return True
