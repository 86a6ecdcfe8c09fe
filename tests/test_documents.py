"""Every way in which a document cannot be read or written is one line."""

import json
import math
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from guided_lgp import documents
from guided_lgp.documents import (
    copy_whole,
    made_whole,
    read_json,
    read_yaml,
    write_json,
    write_text,
    written_whole,
)
from guided_lgp.errors import InputError, shortened

CONTENT = np.random.default_rng(1).bytes(2**20)
WRITERS: dict[str, Callable[[Path], object]] = {
    "file.json": lambda path: path.write_text(json.dumps(list(CONTENT))),
    "file.npz": lambda path: np.savez_compressed(path, content=np.frombuffer(CONTENT, np.uint8)),
    "file.parquet": lambda path: pq.write_table(pa.table({"content": [CONTENT]}), path),
    "file.safetensors": lambda path: path.write_bytes(CONTENT),
}


def names(folder: Path) -> list[str]:
    return [path.name for path in folder.iterdir()]


def test_a_document(tmp_path: Path) -> None:
    file = tmp_path / "file.json"
    file.write_text('{"röd": [1, -0.5e-3, null, true, "x"]}', encoding="utf-8")
    assert read_json(file) == {"röd": [1, -0.0005, None, True, "x"]}


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        (b"", "is not JSON: Expecting value"),
        (b'{"name": ', "is not JSON: Expecting value"),
        (b"\xff\xfe{}", "is not UTF-8 at byte 0"),
        (b"\x93NUMPY\x01", "is not UTF-8 at byte 0"),
        (b"[" * 100_000, "is nested too deeply"),
        (b'{"a":' * 100_000, "is nested too deeply"),
        (b"[NaN]", "is not JSON: NaN is not a finite number"),
        (b"[1, -Infinity]", "is not JSON: -Infinity is not a finite number"),
        (b"[1e999]", "is not JSON: 1e999 is not a finite number"),
        (b"[%s.0]" % (b"9" * 5000), "is not JSON: 99999999999999999999 is not a finite number"),
        (b"[%s]" % (b"9" * 5000), "is not JSON: 99999999999999999999 is not a finite number"),
        (b"[1%s]" % (b"0" * 400), "is not JSON: 10000000000000000000 is not a finite number"),
        (b'{"a": 1, "b": 2, "a": 3}', "is not JSON: has the key 'a' twice"),
        (b'[{"a": {"%s": 1, "%s": 2}}]' % (b"k" * 999, b"k" * 999), "is not JSON: has the key"),
        (b'["\\ud800"]', "is not JSON: has a lone surrogate U+D800"),
        (b'{"\\uDFFF": 1}', "is not JSON: has a lone surrogate U+DFFF"),
    ],
)
def test_faults(content: bytes, fault: str, tmp_path: Path) -> None:
    file = tmp_path / "file.json"
    file.write_bytes(content)
    with pytest.raises(InputError) as caught:
        read_json(file, "the output of stage x")
    message = str(caught.value)
    assert message.startswith(f"{file}: {fault}")
    assert message.endswith(" (accepted: the output of stage x)")
    assert len(message) < len(str(file)) + 300


@pytest.mark.parametrize(
    ("content", "fault"),
    [
        ("a: 1\nb: 2\na: 3", "has the key 'a' twice"),
        ("a: {b: 1, b: 2}", "has the key 'b' twice"),
        ("a: 1" + "0" * 400, "10000000000000000000 is not a finite number"),
        ("a: 1" + "0" * 5000, "10000000000000000000 is not a finite number"),
        ("a: 1" + ":0" * 500_000, "1:0:0:0:0:0:0:0:0:0: is not a finite number"),
        ("a: 1" + ":0" * 500 + ".5", "int too large to convert to float"),
        ("a: {b: 1, <<: {c: 1}, b: 2}", "has the key 'b' twice"),
        ("a: &x {b: 1, b: 2}\nc: {<<: *x}", "has the key 'b' twice"),
        ('a: "\\ud800"', "has a lone surrogate U+D800"),
        ("a: [", "expected the node content"),
        ("a: 2024-13-45", "month must be in 1..12"),
        ("[" * 5000, "is nested too deeply"),
        ("a: &x [1, {b: *x}]", "has an alias inside of what it stands for"),
    ],
)
def test_faults_in_yaml(content: str, fault: str, tmp_path: Path) -> None:
    file = tmp_path / "file.yaml"
    file.write_text(content)
    with pytest.raises(InputError) as caught:
        read_yaml(file)
    assert fault in str(caught.value)
    assert len(str(caught.value)) < len(str(file)) + 310


def test_merges_in_yaml(tmp_path: Path) -> None:
    """Also those that PyYAML would make billions of pairs of."""
    file = tmp_path / "file.yaml"
    ten = (f"a{n}: &a{n} {{<<: [{', '.join([f'*a{n - 1}'] * 10)}]}}" for n in range(1, 10))
    file.write_text("\n".join(["a0: &a0 {k: 1, l: 2}", *ten, "b: {<<: *a9, l: 3, m: 4}"]))
    found = read_yaml(file)
    assert found["a9"] == {"k": 1, "l": 2}
    assert found["b"] == {"k": 1, "l": 3, "m": 4}


def test_yaml(tmp_path: Path) -> None:
    file = tmp_path / "file.yaml"
    file.write_text("a: &a {x: 1, y: 2}\nb: {<<: *a, x: 3}\nc: 2020-01-01")
    document = read_yaml(file)
    assert document["b"] == {"x": 3, "y": 2}
    file.write_text("x" * 10)
    assert read_yaml(file) == "x" * 10


def test_a_value_with_many_names_is_read_at_once(tmp_path: Path) -> None:
    file = tmp_path / "file.yaml"
    levels = [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]" for n in range(1, 20)]
    file.write_text("\n".join(["a0: &a0 x", *levels]))
    assert len(read_yaml(file)["a19"]) == 9


def test_a_long_line_keeps_its_ends() -> None:
    line = shortened("begin" + "x" * 10**6 + "end")
    assert len(line) == 300
    assert line.startswith("beginx")
    assert line.endswith("xend")
    assert len(str(InputError("file", "\0" * 10**6))) < 1500


def test_missing_and_unreadable_files(tmp_path: Path) -> None:
    for path, fault in ((tmp_path / "none", "No such file"), (tmp_path, "Is a directory")):
        with pytest.raises(InputError, match=fault):
            read_json(path)


@pytest.mark.parametrize("read", [read_json, read_yaml])
def test_a_file_without_an_end(
    read: Callable[[Path], object], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(documents, "LARGEST", 2**20)
    with pytest.raises(InputError, match="/dev/zero: is larger than 1 MiB"):
        read(Path("/dev/zero"))


def test_no_number_is_lost(tmp_path: Path) -> None:
    file = tmp_path / "file.json"
    file.write_text(repr([math.pi, 5e-324, 1.7976931348623157e308]))
    assert read_json(file) == [math.pi, 5e-324, 1.7976931348623157e308]


def test_what_is_written_is_read(tmp_path: Path) -> None:
    file = tmp_path / "deep" / "file.json"
    document = {"röd": [math.pi, -0.0, 2**60, None, "\U0001f600"]}
    write_json(file, document)
    assert read_json(file) == document
    before = file.read_bytes()
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(file, {"share": float("nan")})
    assert file.read_bytes() == before
    assert names(file.parent) == ["file.json"]


@pytest.mark.parametrize("name", WRITERS)
def test_a_full_disk_leaves_what_was_there(name: str, tmp_path: Path) -> None:
    """Writing ends as on a full disk when the name to write to leads to /dev/full."""
    file = tmp_path / name
    file.write_text("what was there")

    def write() -> None:
        with written_whole(file) as unfinished:
            unfinished.unlink()
            unfinished.symlink_to("/dev/full")
            WRITERS[name](unfinished)

    with pytest.raises(InputError) as caught:
        write()
    message = str(caught.value)
    assert message.startswith(f"{file}: cannot be written: ")
    assert "No space left on device" in message
    assert file.read_text() == "what was there"
    assert names(tmp_path) == [name]
    with written_whole(file) as unfinished:
        WRITERS[name](unfinished)
    assert file.stat().st_size >= 2**20


WRITER = """
import os, sys
from pathlib import Path
from guided_lgp.documents import written_whole
with written_whole(Path(sys.argv[1])) as unfinished:
    unfinished.write_text('{"half')
    print("writing", flush=True)
    sys.stdin.read()
"""


def writer(file: Path) -> subprocess.Popen[str]:
    """A process in the middle of writing a file."""
    command = [sys.executable, "-c", WRITER, str(file)]
    process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    assert process.stdout.readline() == "writing\n"
    return process


def test_leftovers_of_a_killed_writer_go_and_those_of_a_living_one_stay(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "file.json"
    killed, living = writer(file), writer(file)
    killed.kill()
    killed.wait()
    assert not file.exists()
    assert len(names(tmp_path)) == 2
    monkeypatch.setattr(documents, "_LEFTOVER_S", -1.0)
    write_json(file, {})
    assert len(names(tmp_path)) == 2  # the file, and what the other writes
    living.communicate("")
    assert living.returncode == 0
    assert names(tmp_path) == ["file.json"]
    assert file.read_text() == '{"half'


def test_an_interrupted_writer_leaves_nothing(tmp_path: Path) -> None:
    file = tmp_path / "file.json"

    def write() -> None:
        with written_whole(file) as unfinished:
            unfinished.write_text('{"half')
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write()
    assert names(tmp_path) == []


RACER = """
import sys
from pathlib import Path
from guided_lgp.documents import write_text
for _ in range(100):
    write_text(Path(sys.argv[1]), sys.argv[2] * 20_000)
"""


def test_of_four_writers_no_reader_sees_a_mixture(tmp_path: Path) -> None:
    file = tmp_path / "file.txt"
    command = [sys.executable, "-c", RACER, str(file)]
    writers = [subprocess.Popen([*command, letter]) for letter in "abcd"]
    whole = {letter * 20_000 for letter in "abcd"}
    reads = 0
    while any(process.poll() is None for process in writers):
        if file.exists():
            reads += 1
            assert file.read_text() in whole
    assert [process.returncode for process in writers] == [0] * 4
    assert reads > 20
    assert names(tmp_path) == ["file.txt"]


def test_a_planted_link_is_replaced_and_a_mode_is_kept(tmp_path: Path) -> None:
    victim, file, secret = tmp_path / "victim", tmp_path / "file.json", tmp_path / "secret.json"
    victim.write_text("mine")
    file.symlink_to(victim)
    write_json(file, {})
    assert victim.read_text() == "mine"
    assert not file.is_symlink()
    secret.touch(mode=0o600)
    write_json(secret, {})
    assert secret.stat().st_mode & 0o777 == 0o600
    secret.chmod(0o444)  # as files that DVC protects
    write_json(secret, {})
    assert secret.stat().st_mode & 0o777 == 0o644


def test_a_name_as_long_as_the_file_system_takes(tmp_path: Path) -> None:
    file = tmp_path / ("ü" * 125 + ".json")
    write_json(file, {})
    assert names(tmp_path) == [file.name]


def test_a_pipe_and_a_device_stay_what_they_are(
    tmp_path: Path, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    read = subprocess.Popen(["cat", str(pipe)], stdout=subprocess.PIPE)
    write_text(pipe, "röd")
    assert read.communicate()[0] == "röd".encode()
    assert pipe.is_fifo()
    write_text(Path("/dev/null"), "röd")
    assert Path("/dev/null").is_char_device()
    with pytest.raises(InputError, match="/dev/full: cannot be written: No space left on device"):
        write_text(Path("/dev/full"), "röd")
    write_text(Path("-"), "röd")
    sys.stdout.flush()
    assert capfdbinary.readouterr().out == "röd".encode()


def test_a_folder_that_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "data").write_text("a file")
    for path in (tmp_path / "data" / "file.json", Path("/proc/data/file.json")):
        with pytest.raises(InputError, match=f"{path}: cannot be written: "):
            write_json(path, {})


def test_a_folder_is_there_whole_or_not_at_all(tmp_path: Path) -> None:
    target = tmp_path / "deep" / "folder"

    def make(interrupted: bool) -> None:
        with made_whole(target) as folder:
            folder.mkdir()
            (folder / "b").write_text("half")
            if interrupted:
                raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        make(interrupted=True)
    assert list(target.parent.iterdir()) == []
    for _ in range(2):  # an empty one is no hindrance
        with made_whole(target) as folder:
            assert not target.exists() or not list(target.iterdir())
            folder.mkdir()
    (target / "a").write_text("mine")
    with pytest.raises(InputError, match=r"folder: cannot be written: .*not empty"):
        make(interrupted=False)
    assert [file.name for file in target.parent.rglob("*")] == ["folder", "a"]


def test_what_killed_makers_of_a_folder_left_goes(tmp_path: Path) -> None:
    left = tmp_path / ".unfinished-0123-folder"
    (left / "folder").mkdir(parents=True)
    os.utime(left, (0, 0))
    with made_whole(tmp_path / "folder") as folder:
        folder.mkdir()
        assert not left.exists()
    assert [file.name for file in tmp_path.iterdir()] == ["folder"]


def test_a_copy_has_every_file(tmp_path: Path) -> None:
    for name in ("a", "deep/b"):
        (tmp_path / "from" / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / "from" / name).write_text(name)
    copy_whole(tmp_path / "from", tmp_path / "to")
    assert (tmp_path / "to" / "deep" / "b").read_text() == "deep/b"
    assert len(list((tmp_path / "to").rglob("*"))) == 3
