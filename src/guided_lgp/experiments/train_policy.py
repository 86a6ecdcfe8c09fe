"""Stage train_policy: one of the three networks, as the paper trains it."""

from pathlib import Path

from guided_lgp.params import Params
from guided_lgp.paths import DATASET, TRAINED, TRAINING
from guided_lgp.policy.paper.dataset import load_dataset
from guided_lgp.policy.paper.train import train_network


def run(params: Params, root: Path, network: str) -> None:
    """Write ``models/<network>.safetensors`` and ``.json`` and the report of the training."""
    dataset = load_dataset(root / DATASET / "paper")
    report = train_network(network, dataset, params.train_policy, params.parallel, root / TRAINED)
    report.save(root / TRAINING / f"{network}.json")
