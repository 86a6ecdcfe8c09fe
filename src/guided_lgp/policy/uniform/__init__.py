"""The policy that knows nothing: the control, which shows what a search does without one."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from guided_lgp.policy.declaration import PolicyDeclaration

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from guided_lgp.logic import Action, Objective, State, Symbols


class Uniform:
    """All actions are equally good."""

    def log_probabilities(
        self,
        objective: "Objective",
        state: "State",
        symbols: "Symbols",
        positions: "Mapping[str, NDArray[np.float64]]",
        actions: "Sequence[Action]",
    ) -> "NDArray[np.float64]":
        """See :class:`guided_lgp.search.policy.Policy`."""
        import numpy as np

        return np.full(len(actions), -np.log(len(actions)))


DECLARATIONS = (
    PolicyDeclaration(
        name="uniform",
        label="No policy (control)",
        summary="none: all actions are equally good",
        color="#56B4E9",
        read=lambda folder: Uniform(),
    ),
)
