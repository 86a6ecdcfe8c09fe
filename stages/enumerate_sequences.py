"""Stage enumerate_sequences of dvc.yaml."""

from guided_lgp.cli import stage_main

stage_main("enumerate_sequences")
