"""The symbols that a policy is asked about."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from guided_lgp.logic import State, Symbols
from guided_lgp.scene import GRIPPERS


def declared_symbols(state: State, positions: Mapping[str, NDArray[np.float64]]) -> Symbols:
    """The symbols of a state, in the order in which a search hands over their positions."""
    boxes = {name for name, _ in state.support + state.held}
    return state.domain.symbols(
        gripper=GRIPPERS,
        box=tuple(name for name in positions if name in boxes),
        table=tuple(name for name in positions if name not in {*GRIPPERS, *boxes}),
    )
