"""Stage build_dataset of dvc.yaml."""

from guided_lgp.cli import stage_main

stage_main("build_dataset")
