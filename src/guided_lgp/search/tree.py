"""The logic tree and the symbolic states that its nodes share.

Equal states are stored once, so that a node costs three integers: breadth-first search reaches
4e5 nodes within a second and a few megabytes. Equal states are *not* merged as nodes.
"""

from array import array
from collections import deque
from collections.abc import Callable, Sequence

from guided_lgp.logic import Action, Objective, Skeleton, State, Symbols
from guided_lgp.logic.packed import packed_states

Transition = tuple[Action, int]
"""An applicable action and the number of the state it leads to."""


class _Numbers(dict[int, int]):
    """The numbers of packed states; one that is new gets the next, and is appended to a list."""

    def __init__(self, packed: list[int]) -> None:
        super().__init__()
        self._packed = packed

    def __missing__(self, packed: int) -> int:
        number = self[packed] = len(self._packed)
        self._packed.append(packed)
        return number


class StateSpace:
    """Symbolic states, numbered as they are discovered, and their transitions."""

    def __init__(self, symbols: Symbols, start: State) -> None:
        self._packing = packed_states(symbols)
        self._packed: list[int] = []
        self._number = _Numbers(self._packed)
        self._number[self._packing.pack(start)]
        self.expanded: dict[int, list[int]] = {}
        """Where the transitions out of the states that were expanded lead to."""
        self._predecessors: tuple[int, list[list[int]]] = 0, []

    def __len__(self) -> int:
        return len(self._packed)

    def state(self, number: int) -> State:
        """The state of a number."""
        return self._packing.unpack(self._packed[number])

    def targets(self, state: int) -> list[int]:
        """Where the transitions out of a state lead to, in the fixed order of the logic tree."""
        known = self.expanded.get(state)
        if known is None:
            packed = self._packed[state]
            found = self._packing.moves(packed).targets(packed)
            known = self.expanded[state] = list(map(self._number.__getitem__, found))
        return known

    def actions(self, state: int) -> tuple[Action, ...]:
        """The actions of the transitions out of a state, in the same order."""
        return self._packing.moves(self._packed[state]).actions

    def transitions(self, state: int) -> tuple[Transition, ...]:
        """All transitions out of a state, in the fixed order of the logic tree."""
        return tuple(zip(self.actions(state), self.targets(state), strict=True))

    def explore(self) -> None:
        """Discover every reachable state; their number is finite and small."""
        for state, _ in enumerate(self._packed):  # the list grows on the way
            self.targets(state)

    def predecessors(self) -> list[list[int]]:
        """From where a transition leads to each state, among those that were expanded."""
        counted, found = self._predecessors
        if counted != len(self.expanded):
            found = [[] for _ in range(len(self))]
            for state, targets in self.expanded.items():
                for target in targets:
                    found[target].append(state)
            self._predecessors = len(self.expanded), found
        return found

    def goal_states(self, objective: Objective) -> "GoalStates":
        """The states that satisfy an objective."""
        return GoalStates(self._packed, self._packing.goal_test(objective))


class GoalStates:
    """The numbers of the states that pass a test."""

    def __init__(self, packed: Sequence[int], test: Callable[[int], bool]) -> None:
        self._packed = packed
        self._test = test
        self._holds: list[bool] = []

    def __contains__(self, state: int) -> bool:
        while len(self._holds) <= state:
            self._holds.append(self._test(self._packed[len(self._holds)]))
        return self._holds[state]


def distances(space: StateSpace, objective: Objective) -> dict[int, int]:
    """Least number of actions to the objective, from every state that is known to reach it."""
    predecessors, goals = space.predecessors(), space.goal_states(objective)
    distance = {state: 0 for state in range(len(space)) if state in goals}
    queue = deque(distance)
    while queue:
        state = queue.popleft()
        for predecessor in predecessors[state]:
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
        targets = self.space.targets(self.state[node])
        self.state.extend(targets)
        self._parent.extend([node] * len(targets))
        self._rank.extend(range(len(targets)))
        return range(first, len(self.state))

    def skeleton(self, node: int) -> Skeleton:
        """The sequence of actions from the root to a node."""
        actions: list[Action] = []
        while node:
            parent = self._parent[node]
            actions.append(self.space.actions(self.state[parent])[self._rank[node]])
            node = parent
        return tuple(reversed(actions))
