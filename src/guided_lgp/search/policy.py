"""What a planner needs of a policy: a probability over actions, as a protocol."""

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from guided_lgp.bounds.results import Array
from guided_lgp.logic import Action, Objective, State


class Policy(Protocol):
    """A policy mu(g, s_k): log-probabilities of high-level actions (paper, Sec. II-A)."""

    def log_probabilities(
        self,
        objective: Objective,
        state: State,
        positions: Mapping[str, Array],
        actions: Sequence[Action],
    ) -> Array:
        """Score applicable actions.

        Args:
            objective: the goals to reach, as the search encodes them (adapted or not).
            state: the symbolic state, for the choice of slots.
            positions: world position (3,) in m of every symbol, as declared: the order of the boxes
                and of the surfaces decides about the slots of a policy that has slots.
            actions: the applicable children, at least one.

        Returns:
            (len(actions),) natural logarithms of the policy's probabilities.
        """
        ...


class Uniform:
    """The policy that knows nothing: shows what a search does without one."""

    def log_probabilities(
        self,
        objective: Objective,
        state: State,
        positions: Mapping[str, Array],
        actions: Sequence[Action],
    ) -> Array:
        """See :class:`Policy`."""
        return np.full(len(actions), -np.log(len(actions)))
