"""What a policy says about itself, once: :mod:`guided_lgp.policy.registry` finds it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from guided_lgp.logic import Action, Objective, State, Symbols
    from guided_lgp.params import Params


class DeclaredPolicy(Protocol):
    """A policy as a search asks it; see :class:`guided_lgp.search.policy.Policy`.

    One that has ``instructions`` can score these alone.
    """

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
    read: Callable[[Path], DeclaredPolicy]
    """Read it from its folder; raises :class:`InputError`, which names the stage."""
    stage: str = ""
    """The stage that trains it, and its section of the parameters; empty if nothing is learnt."""
    networks: tuple[str, ...] = ()
    """The stems of its files."""
    folder: str = ""
    """Where they are in a folder of models, and the reports of their training in one of reports."""
    symmetric: Callable[["Params"], bool] = lambda params: True
    """Whether all boxes are alike to it, as the pipeline trains it."""
    default: bool = False
    """Whether plans follow it if nobody asks for another."""

    def load(self, models: Path) -> DeclaredPolicy:
        """Read it from a folder of models; raises :class:`InputError`, which names the stage."""
        return self.read(models / self.folder)

    def address(self, network: str) -> str:
        """The run of the stage that trains a network: ``train_policy@place``."""
        return f"{self.stage}@{network}" if len(self.networks) > 1 else self.stage
