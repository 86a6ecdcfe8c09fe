"""What a planner is given."""

from collections.abc import Callable
from dataclasses import dataclass, field

from guided_lgp.bounds.deadline import NEVER, Deadline
from guided_lgp.logic import Objective, Symbols, validate_objective
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

    deadline: Deadline = NEVER
    """When the search ends, for users."""
    widened: Callable[[], "Problem | None"] = lambda: None
    """The same task with further instructions, if one of its goals needs them."""

    def __post_init__(self) -> None:
        validate_objective(self.objective, self.symbols, self.scene.state)

    @property
    def symbols(self) -> Symbols:
        """The symbols that actions may name."""
        return self.restriction or self.scene.symbols
