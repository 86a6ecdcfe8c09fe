"""How input gets bad: other values, other types, other bytes, half of it, all of it twice.

Every function takes the content of a good file and a random generator, and returns another content.
"""

import copy
import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import yaml
from safetensors.numpy import load, save

Rng = np.random.Generator
Spoiler = Callable[[bytes, Rng], bytes]

NAMES = (
    "röd",
    "红",
    "🟥",
    "red\u202eder",
    "red\u0301",
    "ｒｅｄ",
    "../..",
    "%s{}",
    "a\nb",
    "\x1b[31m",
)
ODD: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 2, 7, 2**31, 2**63, -(2**63) - 1, 10**30),
    *(0.0, -0.0, 0.5, 1e-320, 1e-9, 1e9, 1e308, -1e308),
    *(float("nan"), float("inf"), float("-inf")),
    *("", " ", "0", "1e-3", "nan", "x" * 400, "\x00", "\ud800", "\udcff", *NAMES),
    *("red", "green", "tab1", "pr2L", "pr2", "panda", "handover", "floor", "(on red green)"),
    *("box", "cylinder", "sphere", "mesh", "fixed", "/dev/null", "/etc/passwd", "panda.yaml"),
    *([], {}, [[]], [1, 2], [0.5] * 3, [0.5] * 4, [None] * 3, [1e400] * 3, ["a"] * 3),
    *({"": 0}, {"x": {"y": []}}, {"name": "red"}, [{"name": "red"}]),
)
HUGE = "1" + "0" * 400
"""A number beyond a float, which JSON and YAML can write."""


def pick(rng: Rng, values: Sequence[Any]) -> Any:
    """One of some values, itself and not a NumPy scalar."""
    return values[int(rng.integers(len(values)))]


def document(content: Any, rng: Rng) -> Any:
    """A copy of a JSON document with one to three faults anywhere in it."""
    root = [copy.deepcopy(content)]
    for _ in range(int(rng.integers(1, 4))):
        holder: Any = root
        key: Any = 0
        while isinstance(holder[key], dict | list) and holder[key] and rng.random() < 0.85:
            holder = holder[key]
            key = pick(rng, list(holder) if isinstance(holder, dict) else range(len(holder)))
        _spoil(holder, key, rng, whole=holder is root)
    return root[0]


def _spoil(holder: Any, key: Any, rng: Rng, whole: bool) -> None:
    value, fault = holder[key], int(rng.integers(8))
    if fault == 0 and not whole:
        del holder[key]
    elif fault == 1 and isinstance(value, dict):
        value[pick(rng, NAMES)] = copy.deepcopy(pick(rng, ODD))
    elif fault == 1 and isinstance(value, list):
        value.append(copy.deepcopy(pick(rng, ODD)))
    elif fault == 2:
        holder[key] = [value]
    elif fault == 3 and isinstance(value, int | float):
        holder[key] = value * pick(rng, (-1, 0.01, 100, 1000, 57.29577951308232))
    elif fault == 4 and isinstance(holder, list) and not whole:
        holder.insert(0, copy.deepcopy(value))
    elif fault == 5 and isinstance(holder, dict):
        other = pick(rng, list(holder.values()))
        holder[key] = copy.deepcopy(other)
    elif fault == 6 and isinstance(value, str) and value:
        place = int(rng.integers(len(value)))
        holder[key] = value[:place] + pick(rng, NAMES) + value[place:]
    else:
        holder[key] = copy.deepcopy(pick(rng, ODD))


def text(content: bytes, rng: Rng) -> bytes:
    """The file with other bytes in one place, cut off, doubled, or nothing but random bytes."""
    place = int(rng.integers(len(content) + 1))
    match int(rng.integers(6)):
        case 0:
            return content[:place]
        case 1:
            return rng.bytes(int(rng.integers(200)))
        case 2:
            return content[:place] + content
        case 3:
            return content[:place] + content[place + int(rng.integers(1, 30)) :]
    noise = rng.bytes(int(rng.integers(1, 30)))
    return content[:place] + noise + content[place + len(noise) :]


def json_file(content: bytes, rng: Rng) -> bytes:
    """A JSON file: another document, a key twice, a huge number, or other bytes."""
    match int(rng.integers(10)):
        case 0:
            return text(content, rng)
        case 1:
            return _with_huge_number(content, rng)
        case 2:
            return _with_a_key_twice(content, rng)
    return json.dumps(document(json.loads(content), rng)).encode("utf-8", "surrogatepass")


def yaml_file(content: bytes, rng: Rng) -> bytes:
    """A YAML file: another document, a key twice, tags of Python, anchors, or other bytes."""
    match int(rng.integers(10)):
        case 0:
            return text(content, rng)
        case 1:
            return _with_huge_number(content, rng)
        case 2:
            lines = content.splitlines(keepends=True)
            place = int(rng.integers(len(lines)))
            return b"".join([*lines[:place], lines[place], *lines[place:]])
        case 3:
            tags = ("!!python/object/apply:os.getpid []", "!!timestamp 2024-13-45", "!!binary x")
            odd = (*tags, "*none", "&a [*a]", "!x y", "<<: 1", "0o9", "12:61:61", "1_0", "? {}")
            return _with_value(content, pick(rng, odd).encode(), rng)
        case 4:
            levels = "".join(f"a{n}: &a{n} [*a{n - 1}, *a{n - 1}]\n" for n in range(1, 12))
            return content + b"\na0: &a0 x\n" + levels.encode()
    spoilt = document(yaml.safe_load(content), rng)
    return yaml.safe_dump(spoilt, sort_keys=False, allow_unicode=True).encode(
        "utf-8", "surrogatepass"
    )


def _with_huge_number(content: bytes, rng: Rng) -> bytes:
    return _with_value(content, pick(rng, (HUGE, f"-{HUGE}", f"{HUGE}.5", "1e999")).encode(), rng)


def _with_value(content: bytes, value: bytes, rng: Rng) -> bytes:
    """Another value instead of one of the numbers."""
    found = list(re.finditer(rb"-?\d+(\.\d+)?(e-?\d+)?", content))
    if not found:
        return value
    place = found[int(rng.integers(len(found)))]
    return content[: place.start()] + value + content[place.end() :]


def _with_a_key_twice(content: bytes, rng: Rng) -> bytes:
    found = list(re.finditer(rb'"\w+":', content))
    if not found:
        return content + content
    place = found[int(rng.integers(len(found)))]
    return content[: place.start()] + place.group() + b" 0, " + content[place.start() :]


def xml_file(content: bytes, rng: Rng) -> bytes:
    """An XML file with another value of an attribute, an element twice or gone, or other bytes."""
    match int(rng.integers(5)):
        case 0:
            return text(content, rng)
        case 1:
            found = list(re.finditer(rb"<(\w+)[^<>]*/>", content))
        case _:
            found = list(re.finditer(rb'(?<==")[^"<>]*(?=")', content))
    place = found[int(rng.integers(len(found)))]
    other = (
        pick(rng, found).group()
        if rng.random() < 0.5
        else str(pick(rng, ODD)).encode("utf-8", "surrogatepass")
    )
    return content[: place.start()] + other + content[place.end() :]


_KINDS = (np.int64, np.int8, np.uint16, np.float64, np.float16, np.float32, np.bool_)


def tensor_file(content: bytes, rng: Rng) -> bytes:
    """A safetensors file: other types, shapes, values, names, or other bytes."""
    if rng.random() < 0.25:
        return text(content, rng)
    tensors = dict(load(content))
    name = pick(rng, sorted(tensors))
    array = tensors[name]
    match int(rng.integers(8)):
        case 0:
            tensors[name] = np.zeros((), array.dtype)
        case 1:
            tensors[name] = array[:0]
        case 2:
            tensors[name] = np.ascontiguousarray(array[..., None])
        case 3:
            tensors[name] = array.astype(pick(rng, _KINDS))
        case 4:
            del tensors[name]
        case 5:
            tensors[pick(rng, ("", "x.0.weight", *NAMES))] = array
        case 6 if array.size:
            other = array.copy()
            values = (float("nan"), float("inf"), 1e9, -1, 127, 0)
            with np.errstate(all="ignore"):
                other.reshape(-1)[int(rng.integers(array.size))] = np.array(
                    pick(rng, values)
                ).astype(array.dtype)
            tensors[name] = other
        case _:
            return _of_a_type_that_numpy_lacks(save(tensors), rng)
    return save(tensors)


def _of_a_type_that_numpy_lacks(content: bytes, rng: Rng) -> bytes:
    """The header says that some array is of another type; sizes need not fit."""
    size = int.from_bytes(content[:8], "little")
    kind = pick(rng, ("BF16", "F8_E4M3", "F8_E5M2", "U64", "X1", "F64")).encode()
    header = re.sub(rb'"dtype":"\w+"', b'"dtype":"' + kind + b'"', content[8 : 8 + size], count=1)
    return len(header).to_bytes(8, "little") + header + content[8 + size :]


def table_file(content: bytes, rng: Rng) -> bytes:
    """A Parquet file: other types, names, nulls, columns, rows, or other bytes."""
    if rng.random() < 0.25:
        return text(content, rng)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "table.parquet"
        file.write_bytes(content)
        table = pq.read_table(file)
        pq.write_table(_spoilt_table(table, rng), file)
        return file.read_bytes()


def _spoilt_table(table: pa.Table, rng: Rng) -> pa.Table:
    name = pick(rng, table.column_names)
    place = table.column_names.index(name)
    values = table[name].to_pylist()
    match int(rng.integers(7)):
        case 0:
            return table.drop_columns([name])
        case 1:
            odd = pick(rng, (1, 1.5, "x", True, b"x", [1], {"a": 1}))
            return table.set_column(place, name, pa.array([odd] * len(values)))
        case 2:
            return table.set_column(place, name, pa.nulls(len(values)))
        case 3:
            return pa.concat_tables([table, table.slice(0, 1)])
        case 4:
            return table.slice(0, int(rng.integers(len(values))))
        case 5:
            return table.replace_schema_metadata({b"guided_lgp": b"2"})
    if values:
        values[int(rng.integers(len(values)))] = _of_kind(table.schema.field(name).type, rng)
    return table.set_column(place, name, pa.array(values, table.schema.field(name).type))


def _of_kind(kind: pa.DataType, rng: Rng) -> Any:
    """Another value of a type, or none."""
    if pa.types.is_string(kind):
        words = ("", "training-000", "(grasp pr2L red)", "(place pr2L red red)", "()", "(on", "x")
        return pick(rng, (None, *words, "(grasp pr2L none)", "(on red red)", *NAMES))
    if pa.types.is_integer(kind):
        return pick(rng, (None, -1, 0, 1, 100, 2**31 - 1))
    if pa.types.is_floating(kind):
        return pick(rng, (None, float("nan"), -1.0, 1e300))
    if pa.types.is_boolean(kind):
        return pick(rng, (None, True, False))
    if pa.types.is_list(kind):
        return pick(rng, (None, [], [0.5], [float("nan")] * 42, [None] * 42))
    return None


def words(content: bytes, rng: Rng) -> bytes:
    """A line of text, such as a goal, with other words, parentheses or characters."""
    parts = re.findall(r"\w+|\W", content.decode())
    for _ in range(int(rng.integers(1, 4))):
        place = int(rng.integers(len(parts) + 1))
        match int(rng.integers(3)):
            case 0:
                parts[place : place + 1] = []
            case 1:
                parts.insert(place, pick(rng, ("(", ")", "on", "held", "red", "none", *NAMES)))
            case _:
                parts[place : place + 1] = [str(pick(rng, ODD))]
    return "".join(parts).encode("utf-8", "surrogatepass")
