"""Take the pipeline's trained weights and limits into the package (``make ship``)."""

import shutil
from pathlib import Path

import yaml

from guided_lgp.documents import write_text
from guided_lgp.params import PlanningParams, load_params
from guided_lgp.paths import MODELS, PARAMS, PLANNING, TRAINED

_HEADING = "# Limits of planning; written by `make ship` from params.yaml.\n"


def ship(root: Path, models: Path = MODELS, limits: Path = PLANNING) -> None:
    """Copy the weights of a clone, and the sections of its parameters that planning reads.

    Args:
        root: the folder of ``dvc.yaml``.
        models: the folder to fill.
        limits: the file to write.

    Raises:
        InputError: the parameters are missing or damaged, or a file cannot be written.
    """
    shutil.copytree(root / TRAINED, models, dirs_exist_ok=True)
    params = load_params(root / PARAMS).model_dump(include=set(PlanningParams.model_fields))
    write_text(limits, _HEADING + yaml.safe_dump(params, sort_keys=True))


if __name__ == "__main__":
    ship(Path.cwd())
