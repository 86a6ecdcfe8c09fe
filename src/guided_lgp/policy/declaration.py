"""What a policy says about itself, once: :mod:`guided_lgp.policy.registry` finds it."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from guided_lgp.logic import Action, Objective, State, Symbols


class TrainedPolicy(Protocol):
    """A policy as a search asks it; see :class:`guided_lgp.search.policy.Policy`."""

    @property
    def instructions(self) -> "Collection[str]":
        """The instructions that it can score."""
        ...

    def log_probabilities(
        self,
        objective: "Objective",
        state: "State",
        symbols: "Symbols",
        positions: "Mapping[str, NDArray[np.float64]]",
        actions: "Sequence[Action]",
    ) -> "NDArray[np.float64]":
        """(len(actions),) natural logarithms of the probabilities of applicable actions."""
        ...


@dataclass(frozen=True)
class PolicyDeclaration:
    """A policy that planners can follow."""

    name: str
    """By which commands, parameters and metrics call it."""
    label: str
    """In tables and figures."""
    summary: str
    """What it is for, for the help of the command line."""
    color: str
    """One that readers with colour-blindness can tell from the others (Okabe and Ito)."""
    stage: str
    """The stage that trains it."""
    load: Callable[[Path], TrainedPolicy]
    """Read it from a folder of models; raises :class:`InputError`, which names the stage."""
