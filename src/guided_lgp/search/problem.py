"""What a planner is given."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from guided_lgp.bounds.deadline import NEVER, Deadline
from guided_lgp.logic import (
    Objective,
    Skeleton,
    Symbols,
    progress,
    satisfied,
    successor,
    validate_objective,
)
from guided_lgp.params import SearchLimits
from guided_lgp.scene import Scene
from guided_lgp.search.bounds import Bounds, NoParts, Parts
from guided_lgp.search.policy import Policy


@dataclass(frozen=True)
class Problem:
    """A task, the bounds that judge its sequences, and what guides the search.

    Raises:
        InputError: the objective is contradictory, unknown or already satisfied.
    """

    scene: Scene
    objective: Objective
    limits: SearchLimits
    bounds: Bounds
    policy: Policy | None = None
    """For the planners that follow one."""
    adapt: bool = True
    """Objective adaptation: the policy sees only the goals that do not hold yet (Sec. III-A)."""
    restriction: Symbols | None = None
    """The symbols that actions may name, if not all of the scene."""
    parts: Parts = field(default_factory=NoParts)
    """For the searches that make use of it."""

    misplaced: Mapping[str, frozenset[str]] = field(default_factory=dict)
    """Bodies that every plan moves, whatever the symbols say, since the goals ask for places; for
    each, the bodies that stand there at the start."""
    prefix: Skeleton = ()
    """With which every plan begins; for the searches over a tree of sequences."""
    candidates: int = 1
    """How many plans to compare, at most: the shortest, and of these the fastest, is the result."""
    deadline: Deadline = NEVER
    """When the search ends, for users."""
    widened: Callable[[], "Problem | None"] = lambda: None
    """The same task with further instructions, if one of its goals needs them."""

    def __post_init__(self) -> None:
        state = progress(self.scene.state, self.prefix)
        if not self.prefix or not satisfied(state, self.objective):
            validate_objective(self.objective, self.symbols, state)

    def moved(self, skeleton: Skeleton) -> frozenset[str]:
        """The bodies that a sequence moves."""
        state, moved = self.scene.state, set[str]()
        for action in skeleton:
            body = self.symbols.domain.bind(action).body
            moved |= {body, *state.carried_by(body)}
            state = successor(state, action)
        return frozenset(moved)

    def unsettled(self, skeleton: Skeleton) -> frozenset[str]:
        """The bodies that are still to move: misplaced ones after those that stand there."""
        if not self.misplaced:
            return frozenset()
        last = {self.symbols.domain.bind(a).body: k for k, a in enumerate(skeleton)}
        found = set[str]()
        for body, others in self.misplaced.items():
            found |= others - self.moved(skeleton)
            if body not in last or others - self.moved(skeleton[: last[body]]):
                found.add(body)
        return frozenset(found)

    @property
    def symbols(self) -> Symbols:
        """The symbols that actions may name."""
        return self.restriction or self.scene.symbols
