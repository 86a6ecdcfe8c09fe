"""Stage generate_scenes: configurations for training, test and scalability."""

import logging
from pathlib import Path

from guided_lgp.params import Params
from guided_lgp.paths import SCENES
from guided_lgp.scene import generate
from guided_lgp.scene.setups import SETUPS

_BOXES_OF_THE_PAPER = 5

logger = logging.getLogger(__name__)


def run(params: Params, root: Path) -> None:
    """Write ``data/scenes/*.json``; the seeds of the three purposes are separate."""
    settings = params.generate_scenes
    wanted = [
        ("training", "a", settings.training_configurations, settings.seed_training),
        ("test", "a", settings.test_configurations, settings.seed_test),
    ]
    for setup, content in SETUPS.items():
        many = len(content.boxes) > _BOXES_OF_THE_PAPER
        count = settings.many_boxes_configurations if many else settings.scalability_configurations
        wanted.append((f"scalability_{setup}", setup, count, settings.seed_scalability))
    for name, setup, number, stream in wanted:
        scenes = generate(setup, number, stream, name.replace("_", "-"))
        scenes.save(root / SCENES / f"{name}.json")
        logger.info("%s: %d configurations, %d rejected", name, number, scenes.rejected)
