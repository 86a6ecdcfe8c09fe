"""The trained relational policy: a probability over high-level actions, without torch."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from guided_lgp.logic import Action, Objective, State, Symbols
from guided_lgp.policy.relational.encoding import graphs, situation
from guided_lgp.policy.relational.geometry import BLIND
from guided_lgp.policy.relational.heads import heads
from guided_lgp.policy.relational.model import Weights, load_weights

Shapes = Mapping[str, NDArray[np.float64]]


class RelationalPolicy:
    """Scores actions on any number of boxes and tables, with any number of goals."""

    def __init__(self, weights: Weights, shapes: Shapes | None = None) -> None:
        self._weights = weights
        self._shapes = shapes

    def given(self, shapes: Shapes) -> "RelationalPolicy":
        """The same policy where half extents (m) and yaw (rad), (4,), of all bodies are known."""
        return self if self._weights.sight == BLIND else RelationalPolicy(self._weights, shapes)

    @property
    def instructions(self) -> Collection[str]:
        """The instructions that there are heads for."""
        return heads(self._weights.domain)

    def log_probabilities(
        self,
        objective: Objective,
        state: State,
        symbols: Symbols,
        positions: Mapping[str, NDArray[np.float64]],
        actions: Sequence[Action],
    ) -> NDArray[np.float64]:
        """Score applicable actions; see :class:`guided_lgp.search.policy.Policy`."""
        problem = situation(objective, state, positions, symbols, self._shapes)
        scores = self._weights.scores(graphs(problem, self._weights.limits, self._weights.sight))
        gripper = {name: row for row, name in enumerate(symbols.grippers)}
        table = {name: column for column, name in enumerate(symbols.tables)}
        known = heads(self._weights.domain)
        own = np.array(
            [
                scores[a.instruction][
                    gripper[a.symbols[0]], table[known[a.instruction].target_of(a)]
                ]
                for a in actions
            ],
            dtype=float,
        )
        own -= own.max()
        log_p: NDArray[np.float64] = own - np.log(np.exp(own).sum())
        return log_p


def load_relational(directory: Path) -> RelationalPolicy:
    """Read the trained relational policy.

    Raises:
        InputError: a file is missing, damaged, or of another version; the message names the stage
            that makes it.
    """
    return RelationalPolicy(load_weights(directory))
