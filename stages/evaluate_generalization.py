"""Stage evaluate_generalization of dvc.yaml."""

from guided_lgp.cli import stage_main

stage_main("evaluate_generalization")
