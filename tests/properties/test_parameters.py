"""Parameter files: every value that is accepted is possible, every fault is one line."""

import json
from collections.abc import Iterator, Mapping
from math import isfinite
from pathlib import Path
from typing import Any

import pytest
import yaml
from bad_input import answer, examples, garbled, odd_values, spoilt
from hypothesis import example, given
from hypothesis import strategies as st

from guided_lgp.params import Params, SampleRecipe, load_params

FILE = Path(__file__).parents[2] / "params.yaml"
DOCUMENT: dict[str, Any] = yaml.safe_load(FILE.read_text(encoding="utf-8"))
PAPER = SampleRecipe().model_dump()


def leaves(values: Mapping[str, Any], prefix: tuple[str, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Every value with the keys that lead to it."""
    for key, value in values.items():
        if isinstance(value, Mapping):
            yield from leaves(value, (*prefix, key))
        else:
            yield (*prefix, key, value)


def table(values: Mapping[str, Any]) -> dict[tuple[str, ...], Any]:
    """Every value by its keys, but for the layouts of cases."""
    return {tuple(keys): value for *keys, value in leaves(values) if "layout" not in keys}


FIELDS = [keys for *keys, _ in leaves(DOCUMENT)]


def read(path: Path, text: str | bytes) -> Params | None:
    path.write_bytes(text if isinstance(text, bytes) else text.encode("utf-8", "surrogatepass"))
    params = answer(lambda: load_params(path), path)
    if params is not None:
        check(params, yaml.safe_load(path.read_bytes()))
    return params


def check(params: Params, document: Any) -> None:
    """Nothing is left out, made up or converted, except numbers written as text: ``1e-3``.

    What a recipe does not name is the paper's, a case has no controls that it does not name; the
    layout of a case is its family's to check.
    """
    accepted = table(params.model_dump(mode="json"))
    given = {("build_dataset", "improved", *keys): value for *keys, value in leaves(PAPER)}
    given |= {("cases", name, "controls"): [] for name in params.cases}
    given |= table(document)
    assert set(accepted) == set(given)
    for keys, value in accepted.items():
        assert isinstance(given[keys], bool) == isinstance(value, bool)
        if isinstance(value, int):
            assert type(given[keys]) is type(value)
            assert given[keys] == value
            assert 0 <= value < 2**63
        elif isinstance(value, float):
            assert isfinite(value)
            assert 0 <= value <= 1
            assert value == float(given[keys])
        else:
            assert value == given[keys]
    assert params.parallel.workers <= 4096
    assert params.build_dataset.training_objectives <= 72
    assert params.train_policy.place.lr > 0
    assert params.compare_scalability.max_tree_size <= 10_000_000


@examples(300)
@given(data=st.data())
def test_spoilt_documents(data: st.DataObject, folder: Path) -> None:
    document = data.draw(spoilt(DOCUMENT))
    read(folder / "params.yaml", json.dumps(document, ensure_ascii=False))


@examples(400)
@given(keys=st.sampled_from(FIELDS), value=odd_values)
def test_one_odd_value(keys: list[str], value: Any, folder: Path) -> None:
    document = json.loads(json.dumps(DOCUMENT))
    holder = document
    for key in keys[:-1]:
        holder = holder[key]
    holder[keys[-1]] = value
    read(folder / "params.yaml", json.dumps(document))


@examples(300)
@given(data=st.data())
def test_garbled_files(data: st.DataObject, folder: Path) -> None:
    read(folder / "params.yaml", data.draw(garbled(FILE.read_bytes())))


SCALARS = (
    *("2024-13-45", "0x_", "0b", "0o9", "09", "190:20:30", "=", "<<", ".", "~", "1e-3", "0x10"),
    *("!!int x", "!!bool x", "!!float x", "!!timestamp x", "!!binary x", "!!null x", "!!set {a}"),
    *("!!python/object:os.system x", "!!omap [1]", "*unknown", "&a [*a]", "{? [1] : 2}", "|\n a"),
    *("'", '"', "@", "`", "%", "\t", "\x00", "\x85", "\ud800", "0x" + "f" * 6000, "9" * 6000),
)


@examples(300)
@given(
    key=st.sampled_from(
        ("seed_training: 1", "workers: 2", "dropout: 0.3", "backend: loky", "slack:")
    ),
    text=st.sampled_from(SCALARS) | st.text(max_size=12),
)
@example(key="slack:", text="2024-13-45")
def test_odd_yaml(key: str, text: str, folder: Path) -> None:
    name = key.partition(":")[0]
    content = FILE.read_text(encoding="utf-8").replace(key, f"{name}: {text} #", 1)
    read(folder / "params.yaml", content)


@pytest.mark.parametrize("opening", ["[", "{a: ", "- "])
def test_deep_nesting(opening: str, folder: Path) -> None:
    assert read(folder / "deep.yaml", opening * 5000) is None


def test_small_files_of_huge_values(folder: Path) -> None:
    """Each line ten times the one before: 10^12 values in 12 lines."""
    lines = ["a0: &a0 [x]"]
    lines += [f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 10)}]" for n in range(1, 13)]
    content = FILE.read_text(encoding="utf-8").replace("workers: 2", "workers: *a12")
    assert read(folder / "huge.yaml", "\n".join([*lines, content])) is None


def test_a_truth_value_is_no_number(folder: Path) -> None:
    text = FILE.read_text(encoding="utf-8")
    assert read(folder / "params.yaml", text.replace("dropout: 0.1", "dropout: false")) is None
    assert read(folder / "params.yaml", text.replace("lr: 1.0e-3", "lr: 1e-3")) is not None
