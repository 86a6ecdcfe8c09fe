"""A stage as DVC knows it: what it depends on and what it has written."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from hashlib import md5, sha256
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from guided_lgp.errors import InputError
from guided_lgp.faults import validated
from guided_lgp.params import Params
from guided_lgp.paths import PARAMS
from guided_lgp.tracking.metrics import flatten


@dataclass(frozen=True)
class StageFiles:
    """A stage as ``dvc.lock`` describes it."""

    address: str
    """Name in dvc.yaml, such as ``train_policy@place``."""
    key: str
    """Hash of the command, the dependencies and the parameters."""
    dependencies: Mapping[str, str | None]
    """Paths with their md5, where known."""
    outputs: Mapping[str, str | None]
    """As ``dependencies``."""
    parameters: Mapping[str, Any]
    """Values by dotted name."""

    @classmethod
    def of(cls, address: str, entry: Mapping[str, Any]) -> "StageFiles":
        """Read the entry of one stage in ``dvc.lock``."""
        dependencies = {item["path"]: item.get("md5") for item in entry.get("deps", ())}
        determinants = [address, entry["cmd"], dependencies, entry.get("params", {})]
        text = json.dumps(determinants, sort_keys=True)
        return cls(
            address=address,
            key=sha256(text.encode()).hexdigest(),
            dependencies=dependencies,
            outputs={item["path"]: item.get("md5") for item in entry.get("outs", ())},
            parameters=entry.get("params", {}).get(PARAMS.name, {}),
        )


class _File(BaseModel):
    path: str
    md5: str | None = None


class _Entry(BaseModel):
    cmd: str | list[str]
    deps: list[_File] = []
    params: dict[str, dict[str, Any]] = {}
    outs: list[_File] = []


class _Lock(BaseModel):
    """What of ``dvc.lock`` is read here."""

    stages: dict[str, _Entry]


def read_lock(path: Path) -> list[StageFiles]:
    """The stages in ``dvc.lock``.

    Raises:
        InputError: the file is missing or damaged.
    """
    from dvc.utils.serialize import ParseError, load_yaml  # YAML 1.2, where 1e-05 is a number

    remedy = "dvc repro first"
    if not path.is_file():
        raise InputError(str(path), "not found: no stage has run here", remedy)
    try:
        document = load_yaml(path)
    except (ParseError, OSError, ValueError) as error:
        raise InputError(
            str(path), f"is not YAML: {' '.join(str(error).split())}", remedy
        ) from None
    stages = validated(_Lock.model_validate, document, str(path)).stages
    return [StageFiles.of(name, entry.model_dump()) for name, entry in stages.items()]


def running_stage(address: str) -> StageFiles:
    """The running stage as DVC is about to write it to ``dvc.lock``."""
    from dvc.repo import Repo
    from dvc.stage.serialize import to_single_stage_lockfile

    with Repo() as repo:
        path, _, name = address.rpartition(":")
        stage = repo.stage.load_one(path=path or None, name=name)
        stage.save_deps()
        return StageFiles.of(address, to_single_stage_lockfile(stage))


def check_parameters(stage: StageFiles, params: Params) -> None:
    """Raise :class:`InputError` if a stage ran with other parameters."""
    current = flatten(params.model_dump())
    for name, value in flatten(stage.parameters).items():
        if current.get(name) != value:
            fault = f"is not {value!r}, with which {stage.address} ran"
            raise InputError(f"{PARAMS}: {name}", fault, "dvc repro first")


def check_outputs(stage: StageFiles) -> None:
    """Raise :class:`InputError` if an output is not the one that the stage made."""
    for path, expected in stage.outputs.items():
        file = Path(path)
        if not file.exists():
            raise InputError(path, f"missing, made by the stage {stage.address}", "dvc repro first")
        recorded = file.is_file() and file.parts[0] != "data"
        if recorded and expected not in (None, md5(file.read_bytes()).hexdigest()):
            raise InputError(path, "is not the one that dvc.lock names", "dvc repro first")
