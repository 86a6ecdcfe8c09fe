"""Files between the stages: scenes, tables, data set, models, metrics. Damaged ones are refused."""

import json
import struct
import sys
from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from bad_input import (
    answer,
    examples,
    garbled,
    odd_values,
    overwritten,
    spoilt,
    truncated,
    write_json,
)
from hypothesis import given
from hypothesis import strategies as st
from pydantic import TypeAdapter
from safetensors.numpy import load_file, save_file

from enumerated import write_enumeration
from guided_lgp.bounds.plan_file import read_plan
from guided_lgp.domains import load_domain
from guided_lgp.logic import two_goal_objectives
from guided_lgp.policy.paper.dataset import Dataset, load_dataset
from guided_lgp.policy.paper.encoding import Encoding
from guided_lgp.policy.paper.inference import load_networks
from guided_lgp.policy.paper.model import Model, load_model
from guided_lgp.policy.paper.samples import build_dataset
from guided_lgp.policy.tensors import write_tensors
from guided_lgp.report.metrics import read_metrics
from guided_lgp.scene import GeneratedScenes, generate, load_scene, load_scenes
from guided_lgp.scene.setups import SETUPS
from guided_lgp.sequences import SHORTEST, VERDICTS
from guided_lgp.tables import read_columns

SYMBOLS = load_domain().symbols(
    gripper=("pr2L", "pr2R"), box=("red", "green", "blue"), table=("tab1", "tab2")
)
OBJECTIVES = tuple(two_goal_objectives(SYMBOLS)[:5])
STAGE = "some_stage"
OBJECT = TypeAdapter(dict)


@pytest.fixture(scope="module")
def scenes(folder: Path) -> Path:
    path = folder / "scenes.json"
    generate("a", 3, 1, "scene").save(path)
    return path


@examples(150)
@given(data=st.data())
def test_spoilt_scene_files(data: st.DataObject, scenes: Path, folder: Path) -> None:
    document = json.loads(scenes.read_text(encoding="utf-8"))
    index = data.draw(st.integers(0, 2))
    document["scenes"][index] = data.draw(spoilt(document["scenes"][index]))
    file = write_json(folder / "spoilt.json", document)
    found = answer(lambda: load_scenes(file), f"{file}: scenes.{index}", f"{file}: is not JSON")
    if found is not None:
        assert len(found.scenes) == 3


@examples(150)
@given(data=st.data())
def test_spoilt_lists_of_scenes(data: st.DataObject, scenes: Path, folder: Path) -> None:
    """Faults anywhere in the file: its version, its setup, the list, a scene."""
    document = data.draw(spoilt(json.loads(scenes.read_text(encoding="utf-8"))))
    file = write_json(folder / "spoilt.json", document)
    found = answer(lambda: load_scenes(file), file)
    if found is not None:
        assert found.setup in SETUPS
        assert found.rejected >= 0
        assert len(found.scenes) == len(document["scenes"]) > 0


DEEP = ("[" * 100_000, '{"a":' * 100_000, "[" * 100_000 + "]" * 100_000)


@pytest.mark.parametrize("content", DEEP, ids=("lists", "mappings", "closed"))
def test_deep_documents(
    content: str, dataset: Path, models: Path, tables: Mapping[str, Path], folder: Path
) -> None:
    target = copy_files(models, copy_files(dataset, folder / "deep"))
    files = [target / name for name in ("scene", "plan", "metrics", "dataset", "grasp")]
    for name in files:
        name.with_suffix(".json").write_text(content)
    scene, plan, metrics, samples, model = (file.with_suffix(".json") for file in files)
    assert answer(lambda: load_scene(scene), scene) is None
    assert answer(lambda: load_scenes(scene), scene) is None
    assert answer(lambda: read_plan(plan), plan) is None
    assert answer(lambda: read_metrics(metrics, STAGE, OBJECT), metrics) is None
    assert answer(lambda: load_dataset(target), samples) is None
    assert answer(lambda: load_model(target, "grasp"), model) is None


@examples(100)
@given(data=st.data())
def test_truncated_scene_files(data: st.DataObject, scenes: Path, folder: Path) -> None:
    file = folder / "truncated.json"
    file.write_bytes(data.draw(truncated(scenes.read_bytes().rstrip())))
    assert answer(lambda: load_scenes(file), file) is None


@pytest.fixture(scope="module")
def tables(scenes: Path, folder: Path) -> Mapping[str, Path]:
    """Both tables of the enumeration, as if one action had been feasible in each scene."""
    files = write_enumeration(folder, load_scenes(scenes).scenes, OBJECTIVES)
    return dict(zip(("verdicts", "shortest"), files, strict=True))


COLUMNS = {"verdicts": VERDICTS, "shortest": SHORTEST}


def table(path: Path, columns: pa.Schema) -> pa.Table | None:
    found = answer(lambda: read_columns(path, STAGE, columns), path)
    assert found is None or found.schema == columns
    return found


@examples(100)
@given(name=st.sampled_from(("verdicts", "shortest")), data=st.data())
def test_truncated_tables(
    name: str, data: st.DataObject, tables: Mapping[str, Path], folder: Path
) -> None:
    file = folder / "truncated.parquet"
    file.write_bytes(data.draw(truncated(tables[name].read_bytes())))
    assert table(file, COLUMNS[name]) is None


@examples(250)
@given(name=st.sampled_from(("verdicts", "shortest")), data=st.data())
def test_garbled_tables(
    name: str, data: st.DataObject, tables: Mapping[str, Path], folder: Path
) -> None:
    """Other bytes anywhere: among the values, in the description of a page, in the footer."""
    file = folder / "garbled.parquet"
    file.write_bytes(data.draw(overwritten(tables[name].read_bytes())))
    table(file, COLUMNS[name])


@examples(150)
@given(name=st.sampled_from(("verdicts", "shortest")), data=st.data())
def test_garbled_values_are_not_taken_for_others(
    name: str, data: st.DataObject, tables: Mapping[str, Path], folder: Path
) -> None:
    """Each page has a checksum of its values."""
    content = tables[name].read_bytes()
    footer = len(content) - 8 - struct.unpack("<I", content[-8:-4])[0]
    file = folder / "values.parquet"
    file.write_bytes(data.draw(overwritten(content[:footer])) + content[footer:])
    found = table(file, COLUMNS[name])
    assert found is None or found.equals(read_columns(tables[name], STAGE, COLUMNS[name]))


@examples(60)
@given(
    columns=st.dictionaries(
        st.sampled_from(("configuration", "objective", "length", "other", "κ")),
        st.lists(st.integers() | st.none(), min_size=2, max_size=2).filter(
            lambda values: all(value is None or abs(value) < 2**63 for value in values)
        ),
    ),
    version=st.sampled_from((b"1", b"2", b"", None)),
)
def test_tables_of_another_make(
    columns: dict[str, list[int]], version: bytes | None, folder: Path
) -> None:
    file = folder / "other.parquet"
    wanted = pa.schema([("configuration", pa.int64()), ("length", pa.int64())])
    written = pa.table(columns)
    metadata = None if version is None else {b"guided_lgp": version}
    pq.write_table(written.replace_schema_metadata(metadata), file)
    found = table(file, wanted)
    assert (found is not None) == (version == b"1" and set(wanted.names) <= set(columns))


@examples(150)
@given(name=st.sampled_from(("verdicts", "shortest")), data=st.data())
def test_a_data_set_from_damaged_tables(
    name: str, data: st.DataObject, scenes: Path, tables: Mapping[str, Path], folder: Path
) -> None:
    file = folder / "damaged.parquet"
    content = tables[name].read_bytes()
    file.write_bytes(data.draw(garbled(content)))
    paths = {**tables, name: file}
    found = load_scenes(scenes).scenes
    built = answer(
        lambda: build_dataset(found, paths["verdicts"], paths["shortest"], OBJECTIVES, 0), file
    )
    if built is not None:
        whole = build_dataset(found, tables["verdicts"], tables["shortest"], OBJECTIVES, 0)
        assert np.array_equal(built.states, whole.states)


@pytest.fixture(scope="module")
def dataset(folder: Path) -> Path:
    rng = np.random.default_rng(1)
    encoding = Encoding()
    path = folder / "dataset"
    Dataset(
        encoding=encoding,
        symbols=SYMBOLS,
        objectives=OBJECTIVES,
        configurations=("scene-000",),
        states=rng.normal(size=(20, encoding.state_size)).astype(np.float32),
        actions=np.tile(np.array([[0, 1, 2, -1], [1, 0, 2, 4]], np.int8), (10, 1)),
        supports=rng.integers(-2, 5, (20, 3)).astype(np.int8),
        configuration=np.zeros(20, np.int32),
        goals=rng.integers(0, 2, (5, 20)).astype(np.float32),
        sample_state=rng.integers(0, 20, 30).astype(np.int32),
        sample_goals=rng.integers(0, 5, 30).astype(np.int32),
    ).save(path)
    return path


def copy_files(source: Path, target: Path) -> Path:
    target.mkdir(exist_ok=True)
    for file in source.iterdir():
        (target / file.name).write_bytes(file.read_bytes())
    return target


@examples(250)
@given(data=st.data())
def test_damaged_samples(data: st.DataObject, dataset: Path, folder: Path) -> None:
    target = copy_files(dataset, folder / "dataset-2")
    file = target / "samples.safetensors"
    file.write_bytes(data.draw(garbled(file.read_bytes())))
    found = answer(lambda: load_dataset(target), file)
    if found is not None:
        whole = load_dataset(dataset)
        assert np.array_equal(found.states, whole.states)
        assert np.array_equal(found.sample_state, whole.sample_state)


@examples(60)
@given(data=st.data())
def test_samples_with_other_arrays(data: st.DataObject, dataset: Path, folder: Path) -> None:
    """An array that is missing or too many; the digest of the file is right."""
    target = copy_files(dataset, folder / "dataset-3")
    file = target / "samples.safetensors"
    arrays = load_file(file)
    name = data.draw(st.sampled_from(sorted(arrays)))
    match data.draw(st.sampled_from(("missing", "extra"))):
        case "missing":
            del arrays[name]
        case "extra":
            arrays[f"{name}_too"] = arrays[name]
    digest = write_tensors(file, arrays)
    description = json.loads((target / "dataset.json").read_text()) | {"digest": digest}
    (target / "dataset.json").write_text(json.dumps(description))
    assert answer(lambda: load_dataset(target), file) is None


@examples(150)
@given(data=st.data())
def test_garbled_descriptions_of_the_data_set(
    data: st.DataObject, dataset: Path, folder: Path
) -> None:
    target = copy_files(dataset, folder / "dataset-4")
    file = target / "dataset.json"
    file.write_bytes(data.draw(garbled(file.read_bytes())))
    found = answer(lambda: load_dataset(target), file, target / "samples.safetensors")
    if found is not None:
        assert found.encoding == Encoding()
        assert len(found) == 30


@pytest.fixture(scope="module")
def models(folder: Path) -> Path:
    """Networks of one hidden layer with random weights."""
    rng = np.random.default_rng(2)
    encoding = Encoding()
    path = folder / "models"
    for network, chain in Encoding().chains.items():
        sub_policies = {}
        for name, inputs in zip(chain, encoding.chain_inputs(network), strict=True):
            widths = [inputs, 4, encoding.classes(name)]
            sub_policies[name] = tuple(
                (
                    rng.normal(size=(after, before)).astype(np.float32),
                    rng.normal(size=after).astype(np.float32),
                )
                for before, after in pairwise(widths)
            )
        Model(network, encoding, sub_policies, {"seed": 2}).save(path)
    return path


def check_model(found: Model | None, network: str) -> None:
    """The layers of each sub-policy fit the encoding and each other."""
    if found is None:
        return
    assert list(found.sub_policies) == list(Encoding().chains[network])
    for (name, layers), inputs in zip(
        found.sub_policies.items(), found.encoding.chain_inputs(network), strict=True
    ):
        width = inputs
        for weight, bias in layers:
            assert weight.shape == (len(bias), width)
            width = len(bias)
        assert width == found.encoding.classes(name)


@examples(150)
@given(network=st.sampled_from(sorted(Encoding().chains)), data=st.data())
def test_garbled_weights(network: str, data: st.DataObject, models: Path, folder: Path) -> None:
    target = copy_files(models, folder / "models-2")
    file = target / f"{network}.safetensors"
    file.write_bytes(data.draw(garbled(file.read_bytes())))
    check_model(answer(lambda: load_model(target, network), file), network)


@examples(60)
@given(network=st.sampled_from(sorted(Encoding().chains)), data=st.data())
def test_truncated_weights(network: str, data: st.DataObject, models: Path, folder: Path) -> None:
    target = copy_files(models, folder / "models-3")
    file = target / f"{network}.safetensors"
    file.write_bytes(data.draw(truncated(file.read_bytes())))
    assert answer(lambda: load_networks(target, "train_policy"), file) is None


@examples(60)
@given(size=st.integers(0, 2**64 - 1), header=st.binary(max_size=60), data=st.data())
def test_headers_of_weights(
    size: int, header: bytes, data: st.DataObject, models: Path, folder: Path
) -> None:
    """The header of a safetensors file tells its own length first."""
    target = copy_files(models, folder / "models-4")
    file = target / "grasp.safetensors"
    length = data.draw(st.sampled_from((size, len(header))))
    file.write_bytes(struct.pack("<Q", length) + header)
    assert answer(lambda: load_model(target, "grasp"), file) is None


@examples(60)
@given(
    shape=st.lists(st.integers(0, 5), min_size=1, max_size=3).map(tuple),
    part=st.sampled_from(("weight", "bias")),
)
def test_weights_of_another_shape(
    shape: tuple[int, ...], part: str, models: Path, folder: Path
) -> None:
    target = copy_files(models, folder / "models-5")
    file = target / "grasp.safetensors"
    save_file({f"gripper.0.{part}": np.zeros(shape, np.float32)}, file)
    assert answer(lambda: load_model(target, "grasp"), f"{file}: gripper.0") is None


@examples(100)
@given(
    number=st.sampled_from((np.nan, np.inf, -np.inf)),
    network=st.sampled_from(sorted(Encoding().chains)),
    data=st.data(),
)
def test_weights_that_are_no_numbers(
    number: float, network: str, data: st.DataObject, models: Path, folder: Path
) -> None:
    target = copy_files(models, folder / "models-7")
    file = target / f"{network}.safetensors"
    tensors = load_file(file)
    spoiled = tensors[data.draw(st.sampled_from(sorted(tensors)))].reshape(-1)
    spoiled[data.draw(st.integers(0, spoiled.size - 1))] = number
    save_file(tensors, file)
    assert answer(lambda: load_model(target, network), file) is None


@examples(150)
@given(network=st.sampled_from(sorted(Encoding().chains)), data=st.data())
def test_spoilt_descriptions_of_models(
    network: str, data: st.DataObject, models: Path, folder: Path
) -> None:
    target = copy_files(models, folder / "models-8")
    file = target / f"{network}.json"
    write_json(file, data.draw(spoilt(json.loads(file.read_text(encoding="utf-8")))))
    found = answer(lambda: load_model(target, network), file, file.with_suffix(".safetensors"))
    check_model(found, network)


@examples(150)
@given(data=st.data())
def test_spoilt_descriptions_of_the_data_set(
    data: st.DataObject, dataset: Path, folder: Path
) -> None:
    target = copy_files(dataset, folder / "dataset-5")
    file = target / "dataset.json"
    write_json(file, data.draw(spoilt(json.loads(file.read_text(encoding="utf-8")))))
    answer(lambda: load_dataset(target), file, target / "samples.safetensors")


@examples(150)
@given(network=st.sampled_from(sorted(Encoding().chains)), data=st.data())
def test_garbled_descriptions_of_models(
    network: str, data: st.DataObject, models: Path, folder: Path
) -> None:
    target = copy_files(models, folder / "models-6")
    file = target / f"{network}.json"
    file.write_bytes(data.draw(garbled(file.read_bytes())))
    found = answer(lambda: load_model(target, network), file, file.with_suffix(".safetensors"))
    check_model(found, network)


def finite(value: Any) -> bool:
    """Whether all numbers of a document are finite."""
    match value:
        case dict():
            return all(map(finite, value.values()))
        case list():
            return all(map(finite, value))
        case int() | float():
            return abs(value) <= sys.float_info.max
    return True


@examples(100)
@given(document=odd_values | st.dictionaries(st.text(max_size=5), odd_values, max_size=3))
def test_metrics(document: Any, folder: Path) -> None:
    file = write_json(folder / "metrics.json", document)
    found = answer(lambda: read_metrics(file, STAGE, OBJECT), file)
    assert (found is not None) == (isinstance(document, dict) and finite(document))


def test_the_undamaged_files_are_read(
    scenes: Path, tables: Mapping[str, Path], dataset: Path, models: Path
) -> None:
    found = load_scenes(scenes)
    assert isinstance(found, GeneratedScenes)
    assert len(read_columns(tables["verdicts"], STAGE, VERDICTS)) == 9
    assert len(load_dataset(dataset)) == 30
    for network in Encoding().chains:
        check_model(load_model(models, network), network)
    assert load_networks(models, "train_policy").encoding == Encoding()
