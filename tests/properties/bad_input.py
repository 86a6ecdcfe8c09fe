"""Bad input: how to make it, and what every reader must do with it."""

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from hypothesis import settings
from hypothesis import strategies as st

from guided_lgp.errors import InputError

Answer = TypeVar("Answer")

EXAMPLE = Path(__file__).parents[2] / "examples" / "three_boxes.json"

UNICODE_NAMES = ("röd", "红", "κόκκινο", "🟥", "red\u202eder", "red\u0301", "ｒｅｄ")
_ODD = (
    *(None, True, False, 0, -1, 2, 2**31, 2**63, -(2**63) - 1, 10**30, 10**400),
    *(0.0, -0.0, 0.5, 1e-320, 1e-9, 1e9, 1e308, -1e308),
    *(float("nan"), float("inf"), float("-inf")),
    *("", " ", "0", "1e-3", "nan", "x" * 40, "a\nb", "\x00", "\x1b[31m", "\ud800", "../..", "%s{}"),
    *("red", "green", "tab1", "pr2L", "(on red green)", *UNICODE_NAMES),
    *([], {}, [[]], [1, 2], [0.5] * 3, [None] * 3, {"": 0}, {"x": {"y": []}}),
)

odd_values = st.one_of(
    st.sampled_from(_ODD).map(copy.deepcopy),
    st.floats(),
    st.integers(),
    st.text(max_size=20),
    st.recursive(
        st.none() | st.booleans() | st.floats() | st.text(max_size=5),
        lambda inner: (
            st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=5), inner, max_size=3)
        ),
        max_leaves=6,
    ),
)
"""Values that a field of a document may get by mistake: wrong type, size, unit or text."""


def examples(count: int) -> settings:
    """So many examples in continuous integration; the profile ``long`` has ten times as many."""
    return settings(max_examples=count * settings.default.max_examples // 100)


def answer(read: Callable[[], Answer], *names: Path | str) -> Answer | None:
    """What a reader returns, or None if it refuses with one line that names the culprit.

    Any other exception than InputError is a failure of the test.
    """
    try:
        return read()
    except InputError as error:
        message = str(error)
        assert message.splitlines() == [message], repr(message)
        assert message.isprintable(), repr(message)
        assert any(str(name) in message for name in names), (message, names)
        return None


@st.composite
def spoilt(draw: st.DrawFn, document: Any) -> Any:
    """A copy of a JSON document with one to three faults anywhere in it."""
    root = [copy.deepcopy(document)]
    for _ in range(draw(st.integers(1, 3))):
        holder: Any = root
        key: Any = 0
        while isinstance(holder[key], dict | list) and holder[key] and draw(st.integers(0, 4)):
            holder = holder[key]
            keys = list(holder) if isinstance(holder, dict) else range(len(holder))
            key = draw(st.sampled_from(keys))
        _spoil(draw, holder, key, holder is root)
    return root[0]


def _spoil(draw: st.DrawFn, holder: Any, key: Any, whole: bool) -> None:
    value = holder[key]
    faults = ["replace", "replace"] if whole else ["replace", "replace", "delete"]
    if isinstance(value, dict | list):
        faults += ["add", "nest"]
    if isinstance(value, int | float) and abs(value) < 1e300:
        faults.append("scale")
    if isinstance(holder, list) and not whole:
        faults.append("repeat")
    match draw(st.sampled_from(faults)):
        case "replace":
            holder[key] = draw(odd_values)
        case "delete":
            del holder[key]
        case "add" if isinstance(value, dict):
            value[draw(st.text(max_size=8) | st.sampled_from(UNICODE_NAMES))] = draw(odd_values)
        case "add":
            value.append(draw(odd_values))
        case "nest":
            holder[key] = [value]
        case "scale":
            holder[key] = value * draw(st.sampled_from((-1, 0.01, 100, 1000, 57.29577951308232)))
        case "repeat":
            holder.insert(0, copy.deepcopy(value))


@st.composite
def truncated(draw: st.DrawFn, content: bytes) -> bytes:
    """The file as an interrupted copy leaves it, or an empty one."""
    return content[: draw(st.integers(0, len(content) - 1))]


@st.composite
def overwritten(draw: st.DrawFn, content: bytes) -> bytes:
    """The file with up to 30 other bytes in one place."""
    start = draw(st.integers(0, len(content) - 1))
    noise = draw(st.binary(min_size=1, max_size=30))[: len(content) - start]
    return content[:start] + noise + content[start + len(noise) :]


def garbled(content: bytes) -> st.SearchStrategy[bytes]:
    """The file with other bytes in one place, cut off, or nothing but random bytes."""
    return st.one_of(overwritten(content), truncated(content), st.binary(max_size=200))


def write_json(path: Path, document: Any) -> Path:
    """Write a document as JSON; NaN and infinities as Python writes them."""
    path.write_text(json.dumps(document), encoding="utf-8")
    return path
