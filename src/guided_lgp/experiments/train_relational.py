"""Stage train_relational: one network over any number of symbols."""

from pathlib import Path

from guided_lgp.params import Params
from guided_lgp.paths import DATASET, TRAINED, TRAINING
from guided_lgp.policy.paper.dataset import load_dataset
from guided_lgp.policy.relational.train import train_relational


def run(params: Params, root: Path) -> None:
    """Write ``models/relational.*`` and the report of the training."""
    dataset = load_dataset(root / DATASET / "paper")
    report = train_relational(dataset, params.train_relational, params.parallel, root / TRAINED)
    report.save(root / TRAINING / "relational.json")
