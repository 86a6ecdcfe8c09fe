"""Stage train_relational of dvc.yaml."""

from guided_lgp.cli import stage_main

stage_main("train_relational")
