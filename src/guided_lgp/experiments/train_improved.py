"""Stage train_improved: one of the three networks, on the samples of the improved recipe."""

from pathlib import Path

from guided_lgp.params import Params
from guided_lgp.paths import DATASET, TRAINED, TRAINING
from guided_lgp.policy.paper.dataset import load_dataset
from guided_lgp.policy.paper.train import train_network


def run(params: Params, root: Path, network: str) -> None:
    """Write ``models/improved/<network>.*`` and the report of the training."""
    dataset = load_dataset(root / DATASET / "improved")
    report = train_network(
        network, dataset, params.train_improved, params.parallel, root / TRAINED / "improved"
    )
    report.save(root / TRAINING / "improved" / f"{network}.json")
