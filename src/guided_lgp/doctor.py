"""What a working installation needs, and how to mend it."""

import platform
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

from guided_lgp.paths import MODELS, SOURCES


@dataclass(frozen=True)
class Finding:
    """The outcome of one check."""

    name: str
    ok: bool
    detail: str
    mend: str = ""
    """What to do about it; also a hint where nothing is broken."""


def examine() -> list[Finding]:
    """Run every check, in an order in which each one makes sense."""
    checks: list[Callable[[], Finding]] = [_python, _packages, _robot, _compiler, _models, _dvc]
    return [check() for check in checks]


def _python() -> Finding:
    ok = sys.version_info[:2] == (3, 11)
    return Finding(
        "Python",
        ok,
        platform.python_version(),
        "" if ok else "PyBullet has wheels up to Python 3.11: make a virtual environment with it",
    )


def _packages() -> Finding:
    lock = SOURCES / "requirements.lock"
    if not lock.is_file():
        return Finding("Packages", True, "no requirements.lock beside the package: not compared")
    wrong = []
    for line in lock.read_text(encoding="utf-8").split():
        name, _, wanted = line.partition("==")
        try:
            found = metadata.version(name).partition("+")[0]
        except metadata.PackageNotFoundError:
            found = "missing"
        if found != wanted.partition("+")[0]:
            wrong.append(f"{name} {found} instead of {wanted}")
    if wrong:
        return Finding("Packages", False, "; ".join(wrong), f"pip install -r {lock}")
    return Finding("Packages", True, "as in requirements.lock")


def _robot() -> Finding:
    try:
        files = metadata.files("example-robot-data") or []
    except metadata.PackageNotFoundError:
        files = []
    ok = any(file.name == "pr2.urdf" for file in files)
    detail = "PR2 description found" if ok else "PR2 description missing"
    return Finding("Robot", ok, detail, "" if ok else "pip install example-robot-data")


def _compiler() -> Finding:
    system = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if system:
        return Finding("C compiler", True, system)
    if find_spec("ziglang"):
        return Finding("C compiler", True, "the one in the package ziglang")
    hint = "install a C compiler, or: pip install 'guided-lgp[compiler]'"
    return Finding("C compiler", True, "none: the solver is slower, with the same results", hint)


def _models() -> Finding:
    networks = ("instruction", "grasp", "place")
    files = [f"{network}.{kind}" for network in networks for kind in ("safetensors", "json")]
    missing = [name for name in files if not (MODELS / name).is_file()]
    if missing:
        detail = f"{', '.join(missing)} missing in {MODELS}"
        return Finding("Models", False, detail, "git checkout models, or: dvc repro train_policy")
    return Finding("Models", True, str(MODELS))


def _dvc() -> Finding:
    if (Path.cwd() / "dvc.yaml").is_file():
        return Finding("Pipeline", True, "dvc.yaml found")
    hint = "change to the folder of the clone to run the pipeline; plan works anywhere"
    return Finding("Pipeline", True, "not in a clone", hint)
