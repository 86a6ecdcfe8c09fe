"""Stage compare_scalability of dvc.yaml."""

from guided_lgp.cli import stage_main

stage_main("compare_scalability")
