"""What somebody else leaves where the program will look: it is neither run nor overwritten.

Root can give a file to another user, who has then planted it; others leave these attempts out.
"""

import os
import pickle
import subprocess
import traceback
from collections.abc import Callable, Mapping
from contextlib import chdir, suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from unittest.mock import patch

from guided_lgp import compiled
from guided_lgp.cli.alone import alone
from guided_lgp.cli.outputs import destinations
from guided_lgp.documents import read_yaml, write_text
from guided_lgp.errors import InputError
from guided_lgp.policy.tensors import read_tensors

SOURCE = "int seven(void) { return 7; }"
_EVIL = """
#include <fcntl.h>
__attribute__((constructor)) static void run(void) { open("%s", O_CREAT | O_WRONLY, 0644); }
int seven(void) { return 6; }
int guided_lgp_probe(void) { return 7; }
"""
OTHER = 54322
"""Another user's id."""
REAL_USERS = (OTHER, 0)
"""The real user of a process that acts as the other one: itself, or root, who has started it."""
_PRECIOUS = b"precious"


@dataclass(frozen=True)
class Place:
    """A folder where all of it happens."""

    folder: Path

    @property
    def mark(self) -> Path:
        """Is there once planted code has run."""
        return self.folder / "mark"

    @property
    def precious(self) -> Path:
        """A file of the one who runs the program, which must stay as it is."""
        return self.folder / "precious"

    @property
    def cache(self) -> Path:
        """The folder of the cache."""
        return self.folder / "xdg" / "guided-lgp"

    def evil_library(self) -> bytes:
        """A library that leaves the mark when it is opened."""
        code, file = self.folder / "evil.c", self.folder / "evil.so"
        code.write_text(_EVIL % self.mark)
        compiler = next(compiled._compilers())
        subprocess.run([*compiler, "-shared", "-fPIC", "-o", str(file), str(code)], check=True)
        return file.read_bytes()


def seven() -> None:
    """What the one who runs the program wants of the cache."""
    with suppress(InputError):
        library = compiled.load_compiled("seven", SOURCE)
        assert library is None or library.seven() == 7, "a foreign library was used"


def entry(place: Place) -> str:
    """The name of the library in the cache."""
    return next(file.name for file in place.cache.glob("seven-*.so"))


def _evil_entry(place: Place, owner: int, mode: int) -> None:
    content = place.evil_library()
    name = entry(place)
    for file, text in ((name, content), (f"{name}.sha256", _digest(content))):
        target = place.cache / file
        target.unlink(missing_ok=True)
        target.write_bytes(text)
        target.chmod(mode)
        if owner != os.geteuid():
            os.chown(target, owner, -1)


def _digest(content: bytes) -> bytes:
    return sha256(content).hexdigest().encode()


def others_folder(place: Place) -> None:
    """The folder of the cache is somebody else's."""
    _evil_entry(place, OTHER, 0o644)
    place.cache.chmod(0o777)
    os.chown(place.cache, OTHER, -1)


def link_to_others_folder(place: Place) -> None:
    """The folder of the cache is a link to somebody else's."""
    _evil_entry(place, OTHER, 0o644)
    elsewhere = place.cache.rename(place.folder / "elsewhere")
    os.chown(elsewhere, OTHER, -1)
    place.cache.symlink_to(elsewhere)


def others_library(place: Place) -> None:
    """In a folder that all may write to lies somebody else's library with its digest."""
    _evil_entry(place, OTHER, 0o644)
    place.cache.chmod(0o777)


def writable_library(place: Place) -> None:
    """A library of one's own that all may write to."""
    _evil_entry(place, os.geteuid(), 0o666)


def another_library(place: Place) -> None:
    """A library whose digest is not the one that was stored."""
    digest = (place.cache / f"{entry(place)}.sha256").read_bytes()
    _evil_entry(place, os.geteuid(), 0o600)
    (place.cache / f"{entry(place)}.sha256").write_bytes(digest)


def garbage(place: Place) -> None:
    """Half a library."""
    file = place.cache / entry(place)
    file.write_bytes(file.read_bytes()[:3000])


def pipe_for_a_library(place: Place) -> None:
    """A pipe, which nobody writes to."""
    file = place.cache / entry(place)
    file.unlink()
    os.mkfifo(file)


def folders_for_files(place: Place) -> None:
    """Folders with something in them in place of library, digest and lock."""
    name = entry(place)
    for file in (name, f"{name}.sha256", f"{name}.lock"):
        (place.cache / file).unlink(missing_ok=True)
        (place.cache / file / "a").mkdir(parents=True)


def links_to_precious(place: Place) -> None:
    """Links in place of library, digest and lock, and where unfinished files might be."""
    name = entry(place)
    unfinished = [f".unfinished-{n:016x}-{name}" for n in range(10)]
    for file in (name, f"{name}.sha256", f"{name}.lock", *unfinished):
        (place.cache / file).unlink(missing_ok=True)
        (place.cache / file).symlink_to(place.precious)


def hard_links_to_precious(place: Place) -> None:
    """The same with hard links."""
    name = entry(place)
    for file in (name, f"{name}.sha256", f"{name}.lock"):
        (place.cache / file).unlink(missing_ok=True)
        (place.cache / file).hardlink_to(place.precious)


OF_OTHERS: tuple[Callable[[Place], None], ...] = (
    others_folder,
    link_to_others_folder,
    others_library,
)
PLANTS: tuple[Callable[[Place], None], ...] = (
    writable_library,
    another_library,
    garbage,
    pipe_for_a_library,
    folders_for_files,
    links_to_precious,
    hard_links_to_precious,
)
"""What is left in the cache."""


def relative_cache(place: Place) -> None:
    """A cache in the current folder, which a relative $XDG_CACHE_HOME names."""
    _evil_entry(place, os.geteuid(), 0o644)
    with chdir(place.folder), patch.dict(os.environ, XDG_CACHE_HOME="xdg", HOME=str(place.folder)):
        seven()


def planted_package(place: Place) -> None:
    """A package of the compiler's name in the current folder, and a program of its name."""
    package = place.folder / "ziglang"
    package.mkdir()
    code = f"open({str(place.mark)!r}, 'w')"
    for file in ("__init__.py", "__main__.py"):
        (package / file).write_text(code)
    (place.folder / "cc").write_text(f"#!/bin/sh\ntouch {place.mark}\n")
    (place.folder / "cc").chmod(0o755)
    with chdir(place.folder), patch.dict(os.environ, PATH="/nowhere"):
        compiled.load_compiled("another", "int another(void) { return 8; }")


def link_for_a_target(place: Place) -> None:
    """A link where a file is to be written."""
    (place.folder / "target").symlink_to(place.precious)
    write_text(place.folder / "target", "new")


def link_for_a_lock(place: Place) -> None:
    """A link where a stage's lock is to be."""
    _lock(place).symlink_to(place.precious)
    _hold(place)


def _lock(place: Place) -> Path:
    """Where a stage's lock is to be; its folder is there."""
    lock = place.folder / ".dvc" / "tmp" / "guided-lgp" / "stage.lock"
    lock.parent.mkdir(parents=True)
    return lock


def _hold(place: Place) -> None:
    with alone(place.folder, "stage"):
        pass


def link_to_an_input(place: Place) -> None:
    """``--out`` names a link to what is read."""
    (place.folder / "out").symlink_to(place.precious)
    target = destinations({"--out": place.folder / "out"}, [place.precious])["--out"]
    assert target is not None
    write_text(target, "new")


def hard_link_to_an_input(place: Place) -> None:
    """The same with a hard link."""
    (place.folder / "out").hardlink_to(place.precious)
    target = destinations({"--out": place.folder / "out"}, [place.precious])["--out"]
    assert target is not None
    write_text(target, "new")


class _Payload:
    def __init__(self, mark: Path) -> None:
        self._mark = mark

    def __reduce__(self) -> tuple[object, tuple[str]]:
        return os.mkdir, (str(self._mark),)


def pickled_weights(place: Place) -> None:
    """A pickle that is called weights."""
    file = place.folder / "relational.safetensors"
    file.write_bytes(pickle.dumps(_Payload(place.mark)))
    read_tensors(file, "weights")


def tagged_yaml(place: Place) -> None:
    """YAML with PyYAML's tags, which call functions."""
    file = place.folder / "params.yaml"
    file.write_text(f"a: !!python/object/apply:os.mkdir ['{place.mark}']\n")
    read_yaml(file)


ACTS: tuple[Callable[[Place], None], ...] = (
    relative_cache,
    planted_package,
    link_for_a_target,
    link_for_a_lock,
    link_to_an_input,
    hard_link_to_an_input,
    pickled_weights,
    tagged_yaml,
)
"""What the one who runs the program does beside something planted."""


def roots_folder(place: Place) -> None:
    """The cache is root's folder, to which all may write, with root's library and its digest."""
    _evil_entry(place, 0, 0o644)
    place.cache.chmod(0o777)


def roots_library(place: Place) -> None:
    """In one's own cache lies root's library with its digest."""
    _evil_entry(place, 0, 0o644)
    os.chown(place.cache, OTHER, -1)


def roots_lock(place: Place) -> None:
    """The lock of a stage is root's link to a file of one's own."""
    lock = _lock(place)
    lock.parent.chmod(0o777)
    lock.symlink_to(place.precious)


def roots_target(place: Place) -> None:
    """What is to be written is root's link to a file of one's own, in a folder such as /tmp."""
    (place.folder / "target").symlink_to(place.precious)
    place.folder.chmod(0o1777)


BY_ROOT: Mapping[Callable[[Place], None], Callable[[Place], object]] = {
    roots_folder: lambda place: seven(),
    roots_library: lambda place: seven(),
    roots_lock: _hold,
    roots_target: lambda place: write_text(place.folder / "target", "new"),
}
"""What root plants for another user, and what that one does."""


def is_effective_for_another(
    plant: Callable[[Place], None], act: Callable[[Place], object], real: int
) -> bool:
    """Whether root's plant is effective for another user.

    Args:
        plant: what root leaves.
        act: what the other user does.
        real: the real user of that process, such as a program has that acts as its owner.
    """
    with TemporaryDirectory() as folder:  # where another user can get to
        place = _prepared(Path(folder))
        os.chown(place.precious, OTHER, -1)

        def as_another() -> None:
            os.setgroups([])
            os.setresgid(OTHER, OTHER, OTHER)
            os.setresuid(real, OTHER, OTHER)
            act(place)

        with patch.dict(os.environ, XDG_CACHE_HOME=str(place.cache.parent)):
            _in_child(seven)
            plant(place)
            ended_well = _in_child(as_another)
        return _has_effect(place) or not ended_well


def is_effective(
    folder: Path, plant: Callable[[Place], None], act: Callable[[], None] = seven
) -> bool:
    """Whether planted code runs or a precious file changes, when the cache is used."""
    place = _prepared(folder)
    with patch.dict(os.environ, XDG_CACHE_HOME=str(place.cache.parent)):
        _in_child(seven)
        plant(place)
        ended_well = _in_child(act)
    return _has_effect(place) or not ended_well


def act_is_effective(folder: Path, act: Callable[[Place], None]) -> bool:
    """The same for what is done in a folder of one's own."""
    place = _prepared(folder)
    with patch.dict(os.environ, XDG_CACHE_HOME=str(place.cache.parent)):
        _in_child(seven)
        _in_child(lambda: act(place))
    return _has_effect(place)


def _prepared(folder: Path) -> Place:
    place = Place(folder)
    place.cache.parent.mkdir(parents=True)
    for made in (folder, place.cache.parent):
        made.chmod(0o777)
    place.precious.write_bytes(_PRECIOUS)
    return place


def _has_effect(place: Place) -> bool:
    return os.path.lexists(place.mark) or place.precious.read_bytes() != _PRECIOUS


def _in_child(work: Callable[[], None]) -> bool:
    """Work in a child process; whether it ends well, which a refusal in one line is, too."""
    child = os.fork()
    if child == 0:
        code = 0
        try:
            work()
        except InputError:
            pass
        except BaseException:
            traceback.print_exc()
            code = 1
        os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


def all_plants(folder: Path) -> dict[str, bool]:
    """Whether each of them is effective."""
    root = os.geteuid() == 0
    plants = (*OF_OTHERS, *PLANTS) if root else PLANTS
    found = {plant.__name__: is_effective(folder / plant.__name__, plant) for plant in plants}
    for plant, act in BY_ROOT.items() if root else ():
        for real in REAL_USERS:
            name = f"{plant.__name__}, real user {real}"
            found[name] = is_effective_for_another(plant, act, real)
    return found | {act.__name__: act_is_effective(folder / act.__name__, act) for act in ACTS}
