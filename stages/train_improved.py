"""Stage train_improved of dvc.yaml."""

from guided_lgp.cli import stage_main

stage_main("train_improved")
