"""Stage build_dataset: the training samples of the drawn objectives."""

import logging
from pathlib import Path

from guided_lgp.params import Params, SampleRecipe
from guided_lgp.paths import DATASET, SCENES, SEQUENCES
from guided_lgp.policy.paper.samples import build_dataset
from guided_lgp.policy.split import training_objectives
from guided_lgp.scene import load_scenes

logger = logging.getLogger(__name__)


def run(params: Params, root: Path) -> None:
    """Write ``data/dataset/<policy>`` from the sequences of the training configurations."""
    settings = params.build_dataset
    scenes = load_scenes(root / SCENES / "training.json").scenes
    objectives = training_objectives(scenes[0].symbols, settings.training_objectives, settings.seed)
    for policy, recipe in {"paper": SampleRecipe(), "improved": settings.improved}.items():
        dataset = build_dataset(
            scenes,
            root / SEQUENCES / "training.parquet",
            root / SEQUENCES / "training_shortest.parquet",
            objectives,
            params.enumerate_sequences.slack,
            recipe,
            settings.seed,
        )
        dataset.save(root / DATASET / policy)
        logger.info("%s: %d samples of %d objectives", policy, len(dataset), len(objectives))
