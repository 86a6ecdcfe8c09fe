"""Every way in which a JSON document can be unreadable is one line."""

import math
from pathlib import Path

import pytest

from guided_lgp import documents
from guided_lgp.documents import read_json
from guided_lgp.errors import InputError


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
        (b"[%s]" % (b"9" * 5000), "is not JSON: Exceeds the limit"),
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


def test_missing_and_unreadable_files(tmp_path: Path) -> None:
    for path, fault in ((tmp_path / "none", "No such file"), (tmp_path, "Is a directory")):
        with pytest.raises(InputError, match=fault):
            read_json(path)


def test_a_file_without_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(documents, "LARGEST", 2**20)
    with pytest.raises(InputError, match="/dev/zero: is larger than 1 MiB"):
        read_json(Path("/dev/zero"))


def test_no_number_is_lost(tmp_path: Path) -> None:
    file = tmp_path / "file.json"
    file.write_text(repr([math.pi, 5e-324, 1.7976931348623157e308]))
    assert read_json(file) == [math.pi, 5e-324, 1.7976931348623157e308]
