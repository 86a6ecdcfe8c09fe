"""The logic tree and the symbolic states that its nodes share.

Equal states are stored once, so that a node costs three integers: breadth-first search reaches
4e5 nodes within a second and a few megabytes. Equal states are *not* merged as nodes.
"""

from array import array
from collections import deque

from guided_lgp.logic import (
    Action,
    Objective,
    Skeleton,
    State,
    Symbols,
    applicable_actions,
    satisfied,
    successor,
)

Transition = tuple[Action, int]
"""An applicable action and the number of the state it leads to."""


class StateSpace:
    """Symbolic states, numbered as they are discovered, and their transitions."""

    def __init__(self, symbols: Symbols, start: State) -> None:
        self._symbols = symbols
        self._number = {start: 0}
        self.states = [start]
        self.expanded: dict[int, tuple[Transition, ...]] = {}
        """Transitions out of the states that were expanded."""

    def transitions(self, state: int) -> tuple[Transition, ...]:
        """All transitions out of a state, in the fixed order of the logic tree."""
        known = self.expanded.get(state)
        if known is None:
            origin = self.states[state]
            known = tuple(
                (action, self._discover(successor(origin, action)))
                for action in applicable_actions(origin, self._symbols)
            )
            self.expanded[state] = known
        return known

    def _discover(self, state: State) -> int:
        number = self._number.setdefault(state, len(self.states))
        if number == len(self.states):
            self.states.append(state)
        return number

    def explore(self) -> None:
        """Discover every reachable state; their number is finite and small."""
        for state, _ in enumerate(self.states):  # the list grows on the way
            self.transitions(state)


class GoalStates:
    """The numbers of the states that satisfy an objective."""

    def __init__(self, space: StateSpace, objective: Objective) -> None:
        self._states = space.states
        self._objective = objective
        self._holds: list[bool] = []

    def __contains__(self, state: int) -> bool:
        while len(self._holds) <= state:
            self._holds.append(satisfied(self._states[len(self._holds)], self._objective))
        return self._holds[state]


def distances(space: StateSpace, objective: Objective) -> dict[int, int]:
    """Least number of actions to the objective, from every state that is known to reach it."""
    predecessors: dict[int, list[int]] = {}
    for state, transitions in space.expanded.items():
        for _, target in transitions:
            predecessors.setdefault(target, []).append(state)
    goals = GoalStates(space, objective)
    distance = {state: 0 for state, _ in enumerate(space.states) if state in goals}
    queue = deque(distance)
    while queue:
        state = queue.popleft()
        for predecessor in predecessors.get(state, ()):
            if predecessor not in distance:
                distance[predecessor] = distance[state] + 1
                queue.append(predecessor)
    return distance


class LogicTree:
    """Nodes 0, 1, ... in the order of their generation; 0 is the root."""

    def __init__(self, symbols: Symbols, start: State) -> None:
        self.space = StateSpace(symbols, start)
        self.state = array("i", [0])
        """Number of each node's symbolic state."""
        self._parent = array("i", [-1])
        self._rank = array("h", [0])

    def __len__(self) -> int:
        return len(self.state)

    def expand(self, node: int) -> range:
        """Generate the children of a node."""
        first = len(self.state)
        targets = [target for _, target in self.space.transitions(self.state[node])]
        self.state.extend(targets)
        self._parent.extend([node] * len(targets))
        self._rank.extend(range(len(targets)))
        return range(first, len(self.state))

    def skeleton(self, node: int) -> Skeleton:
        """The sequence of actions from the root to a node."""
        actions: list[Action] = []
        while node:
            parent = self._parent[node]
            actions.append(self.space.transitions(self.state[parent])[self._rank[node]][0])
            node = parent
        return tuple(reversed(actions))
