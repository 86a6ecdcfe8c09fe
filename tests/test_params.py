"""params.yaml: what is committed is valid, and every fault is one line that names the key."""

from pathlib import Path
from typing import Any

import pytest
import yaml

from guided_lgp.errors import InputError
from guided_lgp.params import Params, load_params

ROOT = Path(__file__).parents[1]


def document() -> dict[str, Any]:
    content: dict[str, Any] = yaml.safe_load((ROOT / "params.yaml").read_text())
    return content


def message(tmp_path: Path, content: Any) -> str:
    file = tmp_path / "params.yaml"
    file.write_text(content if isinstance(content, str) else yaml.safe_dump(content))
    with pytest.raises(InputError) as caught:
        load_params(file)
    text = str(caught.value)
    assert "\n" not in text
    return text.removeprefix(f"{file}: ")


def test_paper_settings() -> None:
    params = load_params(ROOT / "params.yaml")
    scenes = params.generate_scenes
    assert (scenes.training_configurations, scenes.test_configurations) == (52, 20)
    assert params.build_dataset.training_objectives == 40
    table_4 = {
        "instruction": (2, 64, 0.3, 1e-4, 200, 128, 1e-3),
        "grasp": (3, 80, 0.3, 1e-4, 250, 128, 1e-3),
        "place": (3, 80, 0.1, 1e-4, 250, 128, 1e-3),
    }
    for name, values in table_4.items():
        network = getattr(params.train_policy, name)
        assert tuple(network.model_dump().values()) == values
    assert params.evaluate_generalization.max_depth == 8
    assert params.compare_scalability.max_depth == 20
    assert params.compare_scalability.max_tree_size == 400_000


def test_each_seed_is_another_one() -> None:
    params = load_params(ROOT / "params.yaml")
    scenes = params.generate_scenes
    seeds = [scenes.seed_training, scenes.seed_test, scenes.seed_scalability]
    seeds += [params.build_dataset.seed, params.train_policy.seed]
    assert len(set(seeds)) == len(seeds)


@pytest.mark.parametrize(
    ("section", "key", "value", "expected"),
    [
        ("build_dataset", "training_objectives", 73, "73 is more than 72"),
        ("build_dataset", "training_objectives", 0, "0 is less than 1"),
        ("build_dataset", "seed", "five", "'five' is not a whole number"),
        ("generate_scenes", "training_configurations", 2.5, "2.5 is not a whole number"),
        ("train_policy", "validation_share", float("nan"), "nan is not less than 1"),
        ("parallel", "backend", "threads", "'threads' is not 'loky' or 'dask'"),
    ],
)
def test_impossible_values(
    tmp_path: Path, section: str, key: str, value: object, expected: str
) -> None:
    content = document()
    content[section][key] = value
    assert message(tmp_path, content) == f"{section}.{key}: {expected}"


def test_nested_values(tmp_path: Path) -> None:
    content = document()
    content["train_policy"]["place"]["dropout"] = 1.0
    assert message(tmp_path, content) == ("train_policy.place.dropout: 1.0 is not less than 1")


def test_unknown_keys_name_the_accepted_ones(tmp_path: Path) -> None:
    content = document()
    content["train_policy"]["place"]["droput"] = 0.2
    assert message(tmp_path, content) == (
        "train_policy.place.droput: unknown key"
        " (accepted: layers, nodes, dropout, l2, epochs, batch, lr)"
    )
    content = document()
    content["train_polcy"] = {}
    accepted = ", ".join(Params.model_fields)
    assert message(tmp_path, content) == f"train_polcy: unknown key (accepted: {accepted})"


def test_missing_keys(tmp_path: Path) -> None:
    content = document()
    del content["build_dataset"]["seed"]
    assert message(tmp_path, content) == "build_dataset.seed: missing"
    content["build_dataset"] = 3
    assert message(tmp_path, content) == (
        "build_dataset: is not a mapping (accepted: training_objectives, seed, improved)"
    )


def test_not_a_parameter_file(tmp_path: Path) -> None:
    assert "is not YAML" in message(tmp_path, "a: [1")
    assert "is not a mapping" in message(tmp_path, "")
    with pytest.raises(InputError, match="No such file"):
        load_params(tmp_path / "none.yaml")
