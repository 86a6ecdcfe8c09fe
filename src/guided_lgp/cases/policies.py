"""The policies of a case, and where their files are."""

from collections.abc import Mapping
from pathlib import Path

from guided_lgp.params import Case
from guided_lgp.paths import TRAINED
from guided_lgp.policy.relational.geometry import EVERYTHING, RELATIVE, SIZES, Sight

RIVALS = "rivals"
"""The part of an evaluation that needs no training."""
FULL = "full"
SHUFFLED = "shuffled"
SIGHTS: Mapping[str, Sight] = {
    FULL: EVERYTHING,
    "no_relative_geometry": Sight(nodes=SIZES),
    "no_sizes": Sight(edges=RELATIVE),
    SHUFFLED: EVERYTHING,
}
"""What each sees: the one that counts, then the controls."""


def trained_with(case: Case, seed: int) -> tuple[str, ...]:
    """The policies of one training: the full one, and with the first seed the controls, too."""
    return (FULL, *(case.controls if seed == case.seeds[0] else ()))


def demonstrations_of(root: Path, case: str) -> Path:
    """The file of the labelled states of a case."""
    return root / "data" / case / "demonstrations.safetensors"


def models_of(root: Path, case: str, policy: str, seed: int) -> Path:
    """The folder of one trained policy of a case."""
    return root / TRAINED / case / str(seed) / policy
