"""The paper's hierarchical policy: one network per decision, for a fixed number of symbols."""

from pathlib import Path

from guided_lgp.policy.declaration import PolicyDeclaration, TrainedPolicy


def _paper(directory: Path) -> TrainedPolicy:
    from guided_lgp.policy.paper.inference import load_networks

    return load_networks(directory, "train_policy")


def _improved(directory: Path) -> TrainedPolicy:
    from guided_lgp.policy.paper.inference import load_networks

    return load_networks(directory / "improved", "train_improved")


DECLARATIONS = (
    PolicyDeclaration(
        name="paper",
        label="Paper's networks",
        summary="its networks, for 3 boxes and 2 tables",
        color="#0072B2",
        stage="train_policy",
        load=_paper,
    ),
    PolicyDeclaration(
        name="improved",
        label="Improved networks",
        summary="the same networks, better trained",
        color="#009E73",
        stage="train_improved",
        load=_improved,
    ),
)
