"""The private cache: nothing foreign is opened, nothing damaged stays."""

import os
import subprocess
import time
from contextlib import suppress
from pathlib import Path

import pytest

from guided_lgp import cache, compiled
from guided_lgp.errors import InputError

SOURCE = "int seven(void) { return 7; }"


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    return tmp_path / "guided-lgp"


def seven() -> int:
    library = compiled.load_compiled("seven", SOURCE)
    assert library is not None
    answer: int = library.seven()
    return answer


def library(folder: Path) -> Path:
    (file,) = folder.glob("seven-*.so")
    return file


def another_library(folder: Path) -> bytes:
    """One that ends the process that opens it."""
    code, file = folder / "evil.c", folder / "evil.so"
    code.write_text(
        "#include <stdlib.h>\n__attribute__((constructor)) static void run(void) { _Exit(66); }"
    )
    compiler = next(compiled._compilers())
    subprocess.run([*compiler, "-shared", "-fPIC", "-o", str(file), str(code)], check=True)
    return file.read_bytes()


def test_the_folder_is_private_and_the_name_says_for_what(folder: Path) -> None:
    folder.mkdir()
    folder.chmod(0o777)
    assert seven() == 7
    assert folder.stat().st_mode & 0o777 == 0o700
    assert f"-{os.uname().machine}-" in library(folder).name


@pytest.mark.parametrize("damage", ["empty", "truncated", "foreign", "no digest", "writable"])
def test_a_damaged_library_is_made_again_with_one_line(
    damage: str, folder: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    assert seven() == 7
    file = library(folder)
    whole = file.read_bytes()
    file.unlink()  # this process has it open
    file.write_bytes(whole)
    assert cache.is_whole(file)
    if damage == "no digest":
        file.with_name(f"{file.name}.sha256").unlink()
    elif damage == "writable":
        file.chmod(0o666)
    else:
        contents = {"empty": b"", "truncated": whole[:5000], "foreign": another_library(tmp_path)}
        file.write_bytes(contents[damage])
    assert seven() == 7
    assert [record.message for record in caplog.records] == [f"{file} is damaged and made again"]
    assert cache.is_whole(file)


def test_a_generous_umask_does_not_spoil_the_cache(folder: Path) -> None:
    before = os.umask(0)
    try:
        assert seven() == 7
    finally:
        os.umask(before)
    assert cache.is_whole(library(folder))


def test_links_are_not_followed(folder: Path, tmp_path: Path) -> None:
    assert seven() == 7
    victim = tmp_path / "victim"
    victim.write_bytes(library(folder).read_bytes())
    before = victim.read_bytes()
    for suffix in ("", ".sha256", ".lock"):
        planted = library(folder).with_name(f"{library(folder).name}{suffix}")
        planted.unlink()
        planted.symlink_to(victim)
        assert seven() == 7
        assert victim.read_bytes() == before
    assert not library(folder).is_symlink()


def test_a_link_or_another_users_folder_is_refused(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "elsewhere").mkdir()
    folder.symlink_to("elsewhere")
    with pytest.raises(InputError, match=r"guided-lgp: is not a folder .*XDG_CACHE_HOME"):
        seven()
    folder.unlink()
    folder.mkdir()
    monkeypatch.setattr(os, "geteuid", lambda: os.getuid() + 1)
    with pytest.raises(InputError, match="belongs to another user"):
        seven()


def test_a_relative_folder_does_not_count(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert cache.private_folder() == tmp_path / "home" / ".cache" / "guided-lgp"
    monkeypatch.setenv("HOME", "relative")
    with pytest.raises(InputError, match="XDG_CACHE_HOME: is not set, and there is no home"):
        cache.private_folder()
    assert not Path("relative").exists()


def stand_in(folder: Path, script: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a script be every compiler."""
    file = folder / "bin" / "cc"
    file.parent.mkdir()
    file.write_text(f"#!/bin/sh\n{script}")
    file.chmod(0o755)
    monkeypatch.setattr(compiled, "_compilers", lambda: iter([[str(file)]]))


@pytest.mark.parametrize("garbage", ["echo garbage", "true", "head -c 4000 {library}"])
def test_a_compiler_that_leaves_garbage_does_not_poison_the_cache(
    garbage: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert seven() == 7
    script = garbage.format(library=library(folder).rename(tmp_path / "library.so"))
    with monkeypatch.context() as changed:
        stand_in(tmp_path, f'while [ "$1" != -o ]; do shift; done\n{script} > "$2"', changed)
        assert compiled.load_compiled("seven", SOURCE) is None
    assert not list(folder.glob("*.so"))
    assert seven() == 7


def test_a_compiler_that_hangs_ends_with_its_children(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(tmp_path, f"sleep 60 &\necho $! > {tmp_path / 'child'}\nwait", monkeypatch)
    monkeypatch.setattr(compiled, "_LONGEST", 0.5)
    start = time.monotonic()
    assert compiled.load_compiled("seven", SOURCE) is None
    assert time.monotonic() - start < 20
    status = Path(f"/proc/{(tmp_path / 'child').read_text().strip()}/stat")
    while runs(status) and time.monotonic() - start < 20:
        time.sleep(0.01)  # a process that is killed may run on for a moment
    assert not runs(status)
    assert not list(folder.glob(".unfinished-*"))


def runs(status: Path) -> bool:
    """Whether a process is there that is more than an entry in the table."""
    with suppress(FileNotFoundError, ProcessLookupError):
        return status.read_text().rpartition(")")[2].split()[0] != "Z"
    return False


def test_without_its_compiler_a_library_is_still_found(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert seven() == 7
    monkeypatch.setattr(compiled, "_compilers", lambda: iter(()))
    assert seven() == 7


def test_what_a_kill_left_is_taken_away(folder: Path) -> None:
    assert seven() == 7
    file = library(folder)
    leftover = folder / f".unfinished-{file.name}-x"
    leftover.mkdir()
    (leftover / "code.so").write_bytes(b"half")
    file.unlink()
    assert seven() == 7
    assert not leftover.exists()


def test_a_kept_file_is_mended_with_one_line(
    folder: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    file = cache.kept("robot.urdf", b"<robot/>")
    assert not caplog.records
    for damage in (b"", b"<rob", b"<another/>"):
        file.write_bytes(damage)
        assert cache.damaged() == [file]
        assert cache.kept("robot.urdf", b"<robot/>").read_bytes() == b"<robot/>"
        assert [record.message for record in caplog.records] == [
            f"{file} is damaged and made again"
        ]
        assert not cache.damaged()
        caplog.clear()
    victim = tmp_path / "victim"
    victim.write_bytes(b"<mine/>")
    file.unlink()
    file.symlink_to(victim)
    assert cache.kept("robot.urdf", b"<robot/>").read_bytes() == b"<robot/>"
    assert victim.read_bytes() == b"<mine/>"


def test_mending_leaves_what_is_whole_or_being_made(folder: Path) -> None:
    whole, file = (cache.kept(name, b"content") for name in ("whole", "file"))
    file.write_bytes(b"half")
    with cache._locked(file):
        assert cache.damaged() == []
        assert cache.mend() == []
    assert cache.damaged() == [file]
    assert cache.mend() == [file]
    assert whole.exists()
    assert not file.exists()


def test_a_folder_for_a_lock_is_removed(folder: Path) -> None:
    assert seven() == 7
    file = library(folder)
    file.unlink()  # this process has it open
    lock = file.with_name(f"{file.name}.lock")
    lock.unlink()
    (lock / "a").mkdir(parents=True)
    assert seven() == 7


def test_the_checks_cost_little(folder: Path) -> None:
    assert seven() == 7
    start = time.process_time()
    for _ in range(10):
        seven()
    assert (time.process_time() - start) / 10 < 0.01
