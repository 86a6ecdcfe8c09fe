"""What a planner needs of a policy: a probability over actions, as a protocol."""

from collections.abc import Mapping, Sequence
from typing import Protocol, runtime_checkable

from guided_lgp.bounds.results import Array
from guided_lgp.logic import Action, Objective, State, Symbols


class Policy(Protocol):
    """A policy mu(g, s_k): log-probabilities of high-level actions (paper, Sec. II-A)."""

    def log_probabilities(
        self,
        objective: Objective,
        state: State,
        symbols: Symbols,
        positions: Mapping[str, Array],
        actions: Sequence[Action],
    ) -> Array:
        """Score applicable actions.

        Args:
            objective: the goals to reach, as the search encodes them (adapted or not).
            state: the symbolic state.
            symbols: all symbols of the problem, as declared: their order decides about the slots of
                a policy that has slots.
            positions: world position (3,) in m of every symbol.
            actions: the applicable children, at least one.

        Returns:
            (len(actions),) natural logarithms of the policy's probabilities.
        """
        ...


@runtime_checkable
class SeeingPolicy(Policy, Protocol):
    """A policy that may see more than positions."""

    def given(self, shapes: Mapping[str, Array]) -> Policy:
        """The policy where half extents (m) and yaw (rad), (4,), of boxes and tables are known."""
        ...
