"""The symbols that a policy is asked about."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from guided_lgp.logic import State, Symbols


def declared_symbols(state: State, positions: Mapping[str, NDArray[np.float64]]) -> Symbols:
    """The symbols of a state, from the positions: of grippers, then boxes, then surfaces."""
    boxes = {name for name, _ in state.support + state.held}
    names = tuple(positions)
    first = min(names.index(box) for box in boxes)
    return state.domain.symbols(
        gripper=names[:first],
        box=tuple(name for name in names if name in boxes),
        table=tuple(name for name in names[first:] if name not in boxes),
    )
