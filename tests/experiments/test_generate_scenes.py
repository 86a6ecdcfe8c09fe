"""The sets of configurations: sizes, no overlap, the same bytes for the same seeds."""

from pathlib import Path

from guided_lgp.experiments import generate_scenes
from guided_lgp.params import load_params
from guided_lgp.scene import Scene, load_scenes
from guided_lgp.scene.setups import SETUPS

SETS = ["training", "test", *(f"scalability_{setup}" for setup in SETUPS)]


def test_sets_of_configurations(tmp_path: Path) -> None:
    params = load_params(Path(__file__).parents[2] / "params.yaml")
    for folder in ("one", "two"):
        generate_scenes.run(params, tmp_path / folder)
    scenes: dict[str, tuple[Scene, ...]] = {}
    for name in SETS:
        path = Path("data") / "scenes" / f"{name}.json"
        assert (tmp_path / "one" / path).read_bytes() == (tmp_path / "two" / path).read_bytes()
        scenes[name] = load_scenes(tmp_path / "one" / path).scenes
    assert [len(scenes[name]) for name in SETS] == [52, 20, *[3] * 7]
    assert [len(scenes[name][0].boxes) for name in SETS] == [3, 3, 3, 3, 4, 5, 6, 8, 10]
    drawn = [scene.boxes for name in SETS for scene in scenes[name]]
    assert len(set(drawn)) == len(drawn)  # no configuration is in two sets
    names = [scene.name for name in SETS for scene in scenes[name]]
    assert len(set(names)) == len(names)


def test_another_seed_gives_other_configurations(tmp_path: Path) -> None:
    params = load_params(Path(__file__).parents[2] / "params.yaml")
    other = params.generate_scenes.model_copy(update={"seed_training": 77})
    generate_scenes.run(params, tmp_path / "one")
    generate_scenes.run(params.model_copy(update={"generate_scenes": other}), tmp_path / "two")
    folders = [tmp_path / folder / "data" / "scenes" for folder in ("one", "two")]
    training, test = (
        [(folder / f"{name}.json").read_bytes() for folder in folders]
        for name in ("training", "test")
    )
    assert training[0] != training[1]
    assert test[0] == test[1]
