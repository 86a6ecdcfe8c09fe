"""Tables on disk: whole, versioned, and refused with the stage that makes them."""

from contextlib import suppress
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from guided_lgp.errors import InputError
from guided_lgp.tables import columns_of, read_columns, write_table

TABLE = pa.table({"name": ["a", "b"], "value": [1, 2]})
NAMES = columns_of(TABLE.schema, ["name"], ["name"])


def test_round_trip_and_same_bytes(tmp_path: Path) -> None:
    first, second = tmp_path / "one.parquet", tmp_path / "deep" / "two.parquet"
    write_table(first, TABLE)
    write_table(second, TABLE)
    assert read_columns(first, "some_stage", NAMES).to_pylist() == [{"name": "a"}, {"name": "b"}]
    assert first.read_bytes() == second.read_bytes()
    assert [path.name for path in tmp_path.iterdir() if path.is_file()] == ["one.parquet"]


def test_faults_name_the_stage(tmp_path: Path) -> None:
    path = tmp_path / "table.parquet"
    with pytest.raises(InputError, match=r"is missing .*stage some_stage"):
        read_columns(path, "some_stage", NAMES)
    path.write_bytes(b"PAR1 truncated")
    with pytest.raises(InputError, match=r"cannot be read: .*stage some_stage"):
        read_columns(path, "some_stage", NAMES)
    pq.write_table(TABLE, path)
    with pytest.raises(InputError, match=r"another version .*stage some_stage"):
        read_columns(path, "some_stage", NAMES)
    write_table(path, TABLE)
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(InputError, match=r"cannot be read: .*stage some_stage"):
        read_columns(path, "some_stage", NAMES)
    write_table(path, TABLE)
    with pytest.raises(InputError, match=r"stage some_stage"):
        read_columns(path, "some_stage", pa.schema([("other", pa.int64())]))


def test_damaged_bytes(tmp_path: Path) -> None:
    """One line for a damaged value, and never another exception."""
    path = tmp_path / "table.parquet"
    write_table(path, TABLE)
    content = path.read_bytes()
    footer = len(content) - 8 - int.from_bytes(content[-8:-4], "little")
    for place in range(len(content)):
        path.write_bytes(content[:place] + bytes([content[place] ^ 0x55]) + content[place + 1 :])
        rows = None
        with suppress(InputError):
            rows = read_columns(path, "some_stage", TABLE.schema).to_pylist()
        assert rows in (None, TABLE.to_pylist()) or place >= footer


@pytest.mark.parametrize("values", [["1", "2"], [b"1", b"2"], [[1], [2]], [True, True]])
def test_other_types_are_refused_and_not_converted(values: list[object], tmp_path: Path) -> None:
    path = tmp_path / "table.parquet"
    write_table(path, TABLE)
    assert read_columns(path, "some_stage", TABLE.schema).equals(TABLE)
    write_table(path, pa.table({"name": ["a", "b"], "value": values}))
    with pytest.raises(InputError, match=r"in the column 'value', not int64 .*stage some_stage"):
        read_columns(path, "some_stage", TABLE.schema)


def test_nulls_and_unknown_names_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "table.parquet"
    write_table(path, TABLE)
    with pytest.raises(InputError, match=r"parquet: name: unknown 'b' .*stage some_stage"):
        read_columns(path, "some_stage", NAMES, {"name": {"a", "c"}})
    write_table(path, pa.table({"name": ["a", None], "value": [1, 2]}))
    with pytest.raises(InputError, match=r"cannot be read: .*null.*stage some_stage"):
        read_columns(path, "some_stage", NAMES)
