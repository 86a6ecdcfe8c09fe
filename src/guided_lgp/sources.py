"""The sources of the clone that runs, as far as a stage depends on them."""

from hashlib import sha256
from pathlib import Path

from pydantic import BaseModel

from guided_lgp.documents import read_yaml
from guided_lgp.errors import InputError
from guided_lgp.faults import validated
from guided_lgp.paths import SOURCES

_PACKAGE = Path("src")


class _Stage(BaseModel):
    """What of a stage is read here."""

    deps: list[str] = []
    do: "_Stage | None" = None


class _Stages(BaseModel):
    stages: dict[str, _Stage]


def source_digest(stages: Path, name: str) -> str:
    """Digest of the sources that a file of stages lists for one of them.

    Args:
        stages: the file, relative to the clone.
        name: the stage; for one of several, without what tells it from the others.

    Raises:
        InputError: the file is missing or damaged, or has no such stage.
    """
    file = SOURCES / stages
    known = validated(_Stages.model_validate, read_yaml(file), str(file)).stages
    if name not in known:
        raise InputError(str(file), f"has no stage {name!r}")
    digest = sha256()
    for dependency in (known[name].do or known[name]).deps:
        if Path(dependency).is_relative_to(_PACKAGE):
            for file in _files(SOURCES / dependency):
                digest.update(file.read_bytes())
    return digest.hexdigest()


def _files(path: Path) -> list[Path]:
    """The file itself, or the files of a folder."""
    found = path.rglob("*") if path.is_dir() else (path,)
    return sorted(file for file in found if file.is_file() and "__pycache__" not in file.parts)
