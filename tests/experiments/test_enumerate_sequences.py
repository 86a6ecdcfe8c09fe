"""Shards of the enumeration: resumed after an interruption, bound to what they depend on."""

import shutil
from pathlib import Path

import pyarrow.parquet as pq
import pytest
import yaml

from guided_lgp import sources
from guided_lgp.bounds.results import CoarseResult, Failure
from guided_lgp.errors import InputError
from guided_lgp.experiments import enumerate_sequences
from guided_lgp.logic import Skeleton
from guided_lgp.params import BoundsParams, Params, load_params
from guided_lgp.scene import Scene, generate
from guided_lgp.search.observation import start
from guided_lgp.sequences import SHORTEST
from guided_lgp.tables import read_columns

OUTPUTS = [
    f"{split}{suffix}.parquet" for split in ("training", "test") for suffix in ("", "_shortest")
]


class OneHand:
    """Bounds under which only the right hand reaches anything; raises on a scene named so."""

    opened: list[str]
    interrupt_at = ""

    def __init__(self, scene: Scene, params: BoundsParams) -> None:
        if scene.name == OneHand.interrupt_at:
            raise KeyboardInterrupt
        OneHand.opened.append(scene.name)
        self._keyframe = start(scene)

    def coarse(self, skeleton: Skeleton) -> CoarseResult:
        if skeleton[-1].symbols[0] == "pr2L":
            failure = Failure(len(skeleton) - 1, "reach", float("nan"), "scripted")
            return CoarseResult(skeleton, False, failure=failure)
        frames = (self._keyframe,) * len(skeleton)
        return CoarseResult(skeleton, True, frames, frames)


@pytest.fixture
def params() -> Params:
    params = load_params(Path(__file__).parents[2] / "params.yaml")
    serial = params.parallel.model_copy(update={"workers": 1})
    shallow = params.enumerate_sequences.model_copy(update={"max_length": 3})
    return params.model_copy(update={"parallel": serial, "enumerate_sequences": shallow})


@pytest.fixture
def scripted(monkeypatch: pytest.MonkeyPatch) -> type[OneHand]:
    monkeypatch.setattr(enumerate_sequences, "SceneBounds", OneHand)
    monkeypatch.setattr(OneHand, "opened", [], raising=False)
    monkeypatch.setattr(OneHand, "interrupt_at", "")
    return OneHand


SOURCE = "src/bound.py"


def make_root(folder: Path) -> Path:
    stages = {"enumerate_sequences": {"deps": [SOURCE, "data/scenes/training.json"]}}
    (folder / "src").mkdir(parents=True)
    (folder / SOURCE).write_text("eq. (3)")
    (folder / "src" / "other.py").touch()
    (folder / "dvc.yaml").write_text(yaml.safe_dump({"stages": stages}))
    for split, count in (("training", 2), ("test", 2)):
        generate("a", count, 9, split).save(folder / "data" / "scenes" / f"{split}.json")
    return folder


def test_an_interrupted_run_goes_on(
    tmp_path: Path, params: Params, scripted: type[OneHand], monkeypatch: pytest.MonkeyPatch
) -> None:
    whole, broken = make_root(tmp_path / "whole"), make_root(tmp_path / "broken")
    enumerate_sequences.run(params, whole)
    assert len(scripted.opened) == 4

    scripted.opened.clear()
    scripted.interrupt_at = "test-000"
    with pytest.raises(KeyboardInterrupt):
        enumerate_sequences.run(params, broken)
    assert not (broken / "data" / "sequences").exists()
    scripted.interrupt_at = ""
    enumerate_sequences.run(params, broken)

    assert scripted.opened == ["training-000", "training-001", "test-000", "test-001"]
    for folder in (whole, broken):
        assert len(list((folder / "data" / ".shards").iterdir())) == 4
    for name in OUTPUTS:
        path = Path("data") / "sequences" / name
        assert (whole / path).read_bytes() == (broken / path).read_bytes()


def test_shards_of_other_parameters_are_not_used(
    tmp_path: Path, params: Params, scripted: type[OneHand]
) -> None:
    root = make_root(tmp_path)
    scripted.interrupt_at = "training-001"
    with pytest.raises(KeyboardInterrupt):
        enumerate_sequences.run(params, root)
    scripted.interrupt_at = ""
    deeper = params.enumerate_sequences.model_copy(update={"max_length": 2})
    enumerate_sequences.run(params.model_copy(update={"enumerate_sequences": deeper}), root)
    assert scripted.opened.count("training-000") == 2
    assert len(list((root / "data" / ".shards").iterdir())) == 4


def test_a_run_that_was_killed_after_its_last_shard_recomputes_none(
    tmp_path: Path, params: Params, scripted: type[OneHand]
) -> None:
    root = make_root(tmp_path)
    enumerate_sequences.run(params, root)
    (root / "data" / ".shards" / "half.unfinished").mkdir()
    shutil.rmtree(root / "data" / "sequences")
    enumerate_sequences.run(params, root)
    assert len(scripted.opened) == 4
    assert len(list((root / "data" / ".shards").iterdir())) == 4


@pytest.mark.parametrize("damage", ["truncated", "missing", "other bytes", "no digests", "a file"])
def test_a_damaged_shard_is_computed_again(
    damage: str,
    tmp_path: Path,
    params: Params,
    scripted: type[OneHand],
    caplog: pytest.LogCaptureFixture,
) -> None:
    root = make_root(tmp_path)
    enumerate_sequences.run(params, root)
    whole = {name: (root / "data" / "sequences" / name).read_bytes() for name in OUTPUTS}
    shard = min((root / "data" / ".shards").iterdir())
    file = shard / "verdicts.parquet"
    content = file.read_bytes()
    match damage:
        case "truncated":
            file.write_bytes(content[: len(content) // 2])
        case "missing":
            file.unlink()
        case "other bytes":
            file.write_bytes(content[:100] + b"X" + content[101:])
        case "no digests":
            (shard / "digests.txt").unlink()
        case "a file":
            shutil.rmtree(shard)
            shard.write_bytes(b"half")
    caplog.clear()
    enumerate_sequences.run(params, root)
    warnings = [record.message for record in caplog.records if record.levelname == "WARNING"]
    assert warnings == [f"{shard} is damaged and computed again"]
    assert len(scripted.opened) == 5
    for name in OUTPUTS:
        assert (root / "data" / "sequences" / name).read_bytes() == whole[name]


def test_shards_of_other_sources_are_not_used(
    tmp_path: Path, params: Params, scripted: type[OneHand], monkeypatch: pytest.MonkeyPatch
) -> None:
    root = make_root(tmp_path)
    monkeypatch.setattr(sources, "SOURCES", root)
    enumerate_sequences.run(params, root)
    (root / "src" / "other.py").write_text("of another case")
    enumerate_sequences.run(params, root)
    assert len(scripted.opened) == 4
    (root / SOURCE).write_text("eq. (4)")
    enumerate_sequences.run(params, root)
    assert len(scripted.opened) == 8


def test_what_the_tables_hold(tmp_path: Path, params: Params, scripted: type[OneHand]) -> None:
    root = make_root(tmp_path)
    enumerate_sequences.run(params, root)
    folder = root / "data" / "sequences"
    verdicts = pq.read_table(folder / "training.parquet").to_pylist()
    for row in verdicts:
        assert row["feasible"] == ("pr2L" not in row["skeleton"])
        assert row["length"] == row["skeleton"].count("(")
        if row["feasible"]:
            assert len(row["states"]) == (row["length"] + 1) * 7 * 3
            assert row["failure_constraint"] is None
        else:
            assert row["states"] is None
            assert (row["failure_action"], row["failure_constraint"]) == (
                row["length"] - 1,
                "reach",
            )
            assert row["failure_violation"] is None
    file = folder / "training_shortest.parquet"
    shortest = read_columns(file, "enumerate_sequences", SHORTEST).to_pylist()
    assert len(shortest) == 2 * 87
    both_held = [row for row in shortest if row["objective"] == "(held red) (held green)"]
    assert [(row["symbolic_length"], row["length"]) for row in both_held] == [(2, None)] * 2


def test_missing_scenes_name_their_stage(tmp_path: Path, params: Params) -> None:
    with pytest.raises(InputError, match="generate_scenes"):
        enumerate_sequences.run(params, tmp_path)
