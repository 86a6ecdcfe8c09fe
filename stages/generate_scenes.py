"""Stage generate_scenes of dvc.yaml."""

from guided_lgp.cli import stage_main

if __name__ == "__main__":  # worker processes of Dask import this file
    stage_main("generate_scenes")
