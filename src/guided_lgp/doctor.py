"""What a working installation needs, and how to mend it."""

import platform
import shutil
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryFile

from guided_lgp.errors import InputError, pybullet_remedy
from guided_lgp.paths import DESCRIPTIONS, MODELS, SOURCES
from guided_lgp.policy.registry import POLICIES, load_policy

_INSTALL = f"make -C {SOURCES} setup"
_OWN_CACHE = "set XDG_CACHE_HOME to a folder of your own that can be written"
_REPAIR = "guided-lgp doctor --repair"


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
    checks: list[Callable[[], Finding]] = [_python, _pybullet, _packages, _robot]
    checks += [_compiler, _vectors, _cache]
    checks += [partial(_policy, name) for name in POLICIES]
    return [check() for check in [*checks, _pipeline]]


def _python() -> Finding:
    ok = (3, 10) <= sys.version_info[:2] <= (3, 13)
    mend = "" if ok else "make a virtual environment with Python 3.10 to 3.13"
    return Finding("Python", ok, platform.python_version(), mend)


def _pybullet() -> Finding:
    if find_spec("pybullet") is None:
        return Finding("PyBullet", False, "is not installed", pybullet_remedy())
    return Finding("PyBullet", True, f"version {metadata.version('pybullet')}")


def _packages() -> Finding:
    lock = SOURCES / "requirements.lock"
    if not lock.is_file():
        return Finding("Packages", True, "no requirements.lock beside the package: not compared")
    wrong = []
    for line in lock.read_text(encoding="utf-8").splitlines():
        name, _, wanted = line.partition(" ")[0].partition("==")
        try:
            found = metadata.version(name).partition("+")[0]
        except metadata.PackageNotFoundError:
            found = "missing"
        if found != wanted.partition("+")[0]:
            wrong.append(f"{name} {found} instead of {wanted}")
    if wrong:
        return Finding("Packages", False, "; ".join(wrong), _INSTALL)
    return Finding("Packages", True, "as in requirements.lock")


def _robot() -> Finding:
    found = sorted(folder.name for folder in DESCRIPTIONS.glob("*_description"))
    mend = "" if found else "pip install --force-reinstall --no-deps guided-lgp"
    return Finding("Robots", bool(found), " ".join(found) or "no description", mend)


def _compiler() -> Finding:
    system = next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if system:
        return Finding("C compiler", True, system)
    if find_spec("ziglang"):
        return Finding("C compiler", True, "the one in the package ziglang")
    hint = "install a C compiler, or: pip install 'guided-lgp[compiler]'"
    return Finding("C compiler", True, "none: the solver is slower, with the same results", hint)


def _vectors() -> Finding:
    """The widest vectors that compiled code uses here; see ``compiled.py``."""
    file = Path("/proc/cpuinfo")
    words = file.read_text(encoding="utf-8").split() if file.is_file() else ()
    for name, flag in (("AVX-512", "avx512f"), ("AVX2", "avx2")):
        if flag in words:
            return Finding("Vectors", True, name)
    return Finding("Vectors", True, "no AVX2: compiled code is slower, with the same results")


def _cache() -> Finding:
    from guided_lgp.cache import damaged, private_folder

    try:
        folder = private_folder()
        with TemporaryFile(dir=folder):
            bad = damaged()
    except (InputError, OSError) as error:
        return Finding("Cache", False, str(error), _OWN_CACHE)
    if bad:
        others = f" and {len(bad) - 1} more" if len(bad) > 1 else ""
        return Finding("Cache", False, f"damaged: {bad[0]}{others}", _REPAIR)
    return Finding("Cache", True, f"{folder} for compiled solvers")


def repair() -> list[str]:
    """Mend what can be mended without the network: damaged entries of the cache.

    Returns:
        What was mended, one line each.

    Raises:
        InputError: the cache cannot be used.
    """
    from guided_lgp.cache import mend

    return [f"{file} was damaged; it is made again when it is needed" for file in mend()]


def _policy(name: str) -> Finding:
    title = f"Policy {name}"
    try:
        load_policy(name, MODELS)
    except ImportError as error:
        return Finding(title, False, str(error), _INSTALL)
    except InputError as error:
        return Finding(
            title,
            False,
            str(error),
            f"git checkout src, or: dvc repro {POLICIES[name].stage}; make ship",
        )
    return Finding(title, True, f"trained, in {MODELS}")


def _pipeline() -> Finding:
    if (Path.cwd() / "dvc.yaml").is_file():
        return Finding("Pipeline", True, "dvc.yaml found")
    hint = "change to the folder of the clone to run the pipeline; plan works anywhere"
    return Finding("Pipeline", True, "not in a clone", hint)
