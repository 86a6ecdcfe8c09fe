"""Stage render_reports of dvc.yaml."""

from guided_lgp.cli import stage_main

stage_main("render_reports")
