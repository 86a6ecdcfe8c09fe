"""States packed into one integer each, and their successors: for searches over many states.

A packed state has a field for the parent of everything movable, then one for what each gripper
holds, then the number of the set of facts. Grippers and facts are the *mode*: which actions apply
follows from it for the greatest part, so that it is worked out once per mode; conditions on the
rest of the tree are tested per state.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache

from guided_lgp.logic.actions import Action, Goal
from guided_lgp.logic.domain import GroundInstruction
from guided_lgp.logic.grounding import ground_instructions
from guided_lgp.logic.state import Fact, GroundAtom, State
from guided_lgp.logic.symbols import Symbols

Test = Callable[[Sequence[int]], bool]
"""A condition on the parents of everything movable."""

TREE = ("on", "clear", "carries")
"""The predicates that the mode does not decide."""


@dataclass(frozen=True)
class Moves:
    """Applicable actions in their fixed order, and what each does to a packed state."""

    actions: tuple[Action, ...]
    changes: tuple[tuple[int, int], ...]
    """The bits that each action keeps, and those that it sets."""

    def targets(self, state: int) -> list[int]:
        """The states that the actions lead to."""
        return [state & keep | put for keep, put in self.changes]


@dataclass(frozen=True)
class _Choices:
    """What one mode may allow."""

    actions: tuple[GroundInstruction, ...]
    changes: tuple[tuple[int, int], ...]
    tests: tuple[Test, ...]
    needed: tuple[tuple[tuple[int, bool], ...], ...]
    """The results of tests that each action needs."""
    moves: dict[tuple[bool, ...], Moves] = field(default_factory=dict)
    """By the results of all tests."""

    def given(self, results: tuple[bool, ...]) -> Moves:
        """What applies with these results of the tests."""
        known = self.moves.get(results)
        if known is None:
            chosen = [
                (one.action, change)
                for one, change, needed in zip(self.actions, self.changes, self.needed, strict=True)
                if all(results[test] == wanted for test, wanted in needed)
            ]
            known = Moves(tuple(a for a, _ in chosen), tuple(c for _, c in chosen))
            self.moves[results] = known
        return known


class PackedStates:
    """The packed states over some symbols."""

    def __init__(self, symbols: Symbols) -> None:
        self._symbols = symbols
        self._bodies, grippers = symbols.movable, symbols.grippers
        others = (name for name in symbols.names if name not in {*self._bodies, *grippers})
        self._names = (*self._bodies, *grippers, *others)
        self._number = {name: number for number, name in enumerate(self._names)}
        self._width = len(self._names).bit_length()
        self._field = (1 << self._width) - 1
        fields = (*self._bodies, *grippers)
        self._shift = {name: self._width * number for number, name in enumerate(fields)}
        self._shifts = [self._shift[body] for body in self._bodies]
        self._mode_shift = self._width * len(self._bodies)
        self._facts_shift = self._width * len(fields)
        self._facts: list[tuple[Fact, ...]] = []
        self._choices: dict[int, _Choices] = {}

    def pack(self, state: State) -> int:
        """The packed form of a state."""
        packed = self._facts_number(state.facts) << self._facts_shift
        for body, parent in (*state.support, *state.held):
            packed |= self._number[parent] << self._shift[body]
        for body, gripper in state.held:
            packed |= self._number[body] + 1 << self._shift[gripper]
        return packed

    def unpack(self, packed: int) -> State:
        """The state of a packed form."""
        parents = [self._names[number] for number in self._parents(packed)]
        pairs = dict(zip(self._bodies, parents, strict=True))
        held = {body: p for body, p in pairs.items() if p in self._symbols.grippers}
        support = {body: p for body, p in pairs.items() if body not in held}
        return self._symbols.domain.state(support, held, self._facts[packed >> self._facts_shift])

    def moves(self, packed: int) -> Moves:
        """The actions that a state allows, in their fixed order, and their effects."""
        mode = packed >> self._mode_shift
        choices = self._choices.get(mode)
        if choices is None:
            choices = self._choices[mode] = self._work_out(mode)
        if not choices.tests:
            return choices.given(())
        parents = self._parents(packed)
        return choices.given(tuple([test(parents) for test in choices.tests]))

    def goal_test(self, goals: Sequence[Goal]) -> Callable[[int], bool]:
        """Whether all goals hold in a packed state."""
        domain = self._symbols.domain
        atoms = [atom for goal in goals for atom in domain.conditions(goal)]
        wanted, put = self._placed(atoms)
        tests = [(self._test(atom), not atom.negated) for atom in atoms if atom.predicate in TREE]
        modal = [atom for atom in atoms if atom.predicate not in TREE]
        modes: dict[int, bool] = {}

        def holds(packed: int) -> bool:
            if packed & wanted != put:  # most states, at once
                return False
            mode = packed >> self._mode_shift
            if mode not in modes:
                modes[mode] = all(atom.holds_in(self._mode(mode)) for atom in modal)
            if not modes[mode]:
                return False
            parents = self._parents(packed)
            return all(test(parents) == truth for test, truth in tests)

        return holds

    def _placed(self, atoms: Sequence[GroundAtom]) -> tuple[int, int]:
        """The bits that say what some bodies are on, and their values where atoms hold."""
        wanted = put = 0
        for atom in atoms:
            if atom.predicate == "on" and not atom.negated:
                body, parent = atom.symbols
                wanted |= self._field << self._shift[body]
                put |= self._number[parent] << self._shift[body]
        return wanted, put

    def _parents(self, packed: int) -> list[int]:
        field = self._field
        return [packed >> shift & field for shift in self._shifts]

    def _facts_number(self, facts: tuple[Fact, ...]) -> int:
        if facts not in self._facts:
            self._facts.append(facts)
        return self._facts.index(facts)

    def _mode(self, mode: int) -> State:
        """What the mode alone tells of its states: a state in which nothing stands."""
        packed = mode << self._mode_shift
        held = {}
        for gripper in self._symbols.grippers:
            if content := packed >> self._shift[gripper] & self._field:
                held[self._names[content - 1]] = gripper
        return self._symbols.domain.state({}, held, self._facts[packed >> self._facts_shift])

    def _work_out(self, mode: int) -> _Choices:
        """The actions whose conditions on the mode hold, and their conditions on the tree."""
        state = self._mode(mode)
        tests: dict[GroundAtom, int] = {}
        actions, needed = [], []
        for one in ground_instructions(self._symbols):
            tree = [atom for atom in one.precondition if atom.predicate in TREE]
            rest = [atom for atom in one.precondition if atom.predicate not in TREE]
            if all(atom.holds_in(state) for atom in rest):
                actions.append(one)
                numbers = (tests.setdefault(abs(atom), len(tests)) for atom in tree)
                wanted = (not atom.negated for atom in tree)
                needed.append(tuple(zip(numbers, wanted, strict=True)))
        return _Choices(
            tuple(actions),
            tuple(self._change(one, state) for one in actions),
            tuple(map(self._test, tests)),
            tuple(needed),
        )

    def _change(self, one: GroundInstruction, state: State) -> tuple[int, int]:
        """The bits that an action keeps and those that it sets, in states of a mode."""
        cleared = self._field << self._shift[one.body]
        put = self._number[one.parent] << self._shift[one.body]
        holder = state.holder(one.body)
        if holder is not None:
            cleared |= self._field << self._shift[holder]
        if one.into_hand:
            cleared |= self._field << self._shift[one.parent]
            put |= self._number[one.body] + 1 << self._shift[one.parent]
        if not one.facts:
            return ~cleared, put
        put |= self._facts_number(one.facts_after(state)) << self._facts_shift
        return ((1 << self._facts_shift) - 1) & ~cleared, put

    def _test(self, atom: GroundAtom) -> Test:
        """The test of an atom, regardless of its negation."""
        first, *others = (self._number[name] for name in atom.symbols)
        match atom.predicate:
            case "on":
                return lambda parents: parents[first] == others[0]
            case "clear":
                return lambda parents: first not in parents
        return _carries(first, others[0], len(self._bodies))


def _carries(body: int, other: int, bodies: int) -> Test:
    """Whether one is the other or below it; what is not a body is the end of a chain."""

    def test(parents: Sequence[int]) -> bool:
        link = other
        while link != body:
            if link >= bodies:
                return False
            link = parents[link]
        return True

    return test


@lru_cache(maxsize=64)
def packed_states(symbols: Symbols) -> PackedStates:
    """The packed states over some symbols, worked out as they are met."""
    return PackedStates(symbols)
