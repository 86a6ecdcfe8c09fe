"""Which actions a state allows, and the states they lead to."""

from collections.abc import Iterable, Iterator

from guided_lgp.logic.actions import Action
from guided_lgp.logic.state import State
from guided_lgp.logic.symbols import Symbols


def applicable_actions(state: State, symbols: Symbols) -> Iterator[Action]:
    """The children of a node in their fixed order: grippers, then boxes or tables as declared."""
    for gripper in symbols.grippers:
        box = state.held_by(gripper)
        if box is None:
            for candidate in symbols.boxes:
                if state.holder(candidate) is None:
                    yield Action("grasp", (gripper, candidate))
        else:
            barred = {box, *state.carried_by(box)}
            for table in symbols.tables:
                if table not in barred:
                    yield Action("place", (gripper, box, table))


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
