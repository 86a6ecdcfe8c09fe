"""The paper's hierarchical policy: one network per decision, for a fixed number of symbols."""

from pathlib import Path
from typing import TYPE_CHECKING

from guided_lgp.domains import load_domain
from guided_lgp.policy.declaration import DeclaredPolicy, PolicyDeclaration

if TYPE_CHECKING:
    from guided_lgp.params import Params

NETWORKS = ("instruction", *(instruction.name for instruction in load_domain().instructions))


def _paper(directory: Path) -> DeclaredPolicy:
    from guided_lgp.policy.paper.inference import load_networks

    return load_networks(directory, "train_policy")


def _improved(directory: Path) -> DeclaredPolicy:
    from guided_lgp.policy.paper.inference import load_networks

    return load_networks(directory, "train_improved")


def _one_input_per_box(params: "Params") -> bool:
    return False


def _boxes_of_the_goals_first(params: "Params") -> bool:
    return params.build_dataset.improved.boxes != "declared"


DECLARATIONS = (
    PolicyDeclaration(
        name="paper",
        label="Paper's networks",
        summary="its networks, for 3 boxes and 2 tables",
        color="#0072B2",
        read=_paper,
        stage="train_policy",
        networks=NETWORKS,
        symmetric=_one_input_per_box,
    ),
    PolicyDeclaration(
        name="improved",
        label="Improved networks",
        summary="the same networks, better trained",
        color="#009E73",
        read=_improved,
        stage="train_improved",
        networks=NETWORKS,
        folder="improved",
        symmetric=_boxes_of_the_goals_first,
    ),
)
