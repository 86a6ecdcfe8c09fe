"""Stage generate_scenes of dvc.yaml."""

from guided_lgp.cli import stage_main

stage_main("generate_scenes")
