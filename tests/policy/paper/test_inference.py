import json
import subprocess
import sys
from itertools import product
from pathlib import Path

import numpy as np
import pytest
import safetensors.torch
import torch
from safetensors.numpy import load_file, save_file
from synthetic import make_scene, positions_along

from guided_lgp.bounds.results import Array
from guided_lgp.errors import InputError
from guided_lgp.logic import (
    Action,
    Objective,
    State,
    Symbols,
    parse_objective,
    parse_skeleton,
    progress,
)
from guided_lgp.policy.paper.encoding import Encoding
from guided_lgp.policy.paper.inference import FLOOR, load_networks
from guided_lgp.policy.paper.model import Model
from guided_lgp.policy.paper.network import Classifier
from guided_lgp.policy.registry import load_policy
from guided_lgp.scene import Scene

GRIPPERS, BOXES = ("pr2L", "pr2R"), ("red", "green", "blue")
TABLES = ("tab1", "tab2", *BOXES)
ENDINGS = ("json", "safetensors")
ACTIONS = [
    *(Action("grasp", names) for names in product(GRIPPERS, BOXES)),
    *(Action("place", names) for names in product(GRIPPERS, BOXES, TABLES)),
]
Situation = tuple[Objective, State, Symbols, dict[str, Array]]


def classifiers(encoding: Encoding) -> dict[str, dict[str, Classifier]]:
    """Untrained classifiers with weights large enough for decided answers."""
    rng = np.random.Generator(np.random.SFC64(3))
    networks: dict[str, dict[str, Classifier]] = {}
    for network, chain in Encoding().chains.items():
        networks[network] = {}
        for name, inputs in zip(chain, encoding.chain_inputs(network), strict=True):
            model = Classifier([inputs, 80, 80, 80, encoding.classes(name)], 0.3, rng)
            model.parameter.data.mul_(2)
            networks[network][name] = model
    return networks


def save(directory: Path, encoding: Encoding) -> None:
    for network, chain in classifiers(encoding).items():
        layers = {name: model.layers() for name, model in chain.items()}
        Model(network, encoding, layers, {"seed": 3}).save(directory)


@pytest.fixture
def models(tmp_path: Path) -> Path:
    save(tmp_path, Encoding())
    return tmp_path


@pytest.fixture(scope="module")
def scene() -> Scene:
    return make_scene("test", np.random.default_rng(4))


@pytest.fixture(scope="module")
def situation(scene: Scene) -> Situation:
    path = parse_skeleton("(grasp pr2L red)")
    objective = parse_objective(["(on red tab2)", "(on blue red)"])
    state = progress(scene.state, path)
    return objective, state, scene.symbols, positions_along(scene, path)[-1]


def test_probabilities_of_all_actions_sum_to_one(models: Path, situation: Situation) -> None:
    p = np.exp(load_networks(models, "train_policy").log_probabilities(*situation, ACTIONS))
    assert p.sum() == pytest.approx(1, abs=1e-6)
    assert p.max() > 2 * p.min()


def test_scores_are_the_product_of_the_conditionals_of_torch(
    models: Path, situation: Situation, scene: Scene
) -> None:
    objective, state, _, positions = situation
    encoding, networks = Encoding(), classifiers(Encoding())
    slots = encoding.fill(objective, state, scene.symbols)
    code = [
        *encoding.encode_goals(slots, state),
        *encoding.encode_state(slots, state, positions),
    ]

    def conditional(network: str, name: str, previous: list[float], chosen: int) -> float:
        with torch.inference_mode():
            logits = networks[network][name](torch.tensor([code + previous]))
        return float(torch.softmax(logits, 1)[0, chosen])

    def one_hot(size: int, index: int) -> list[float]:
        return [float(position == index) for position in range(size)]

    expected = []
    for action in ACTIONS:
        instruction = ("grasp", "place").index(action.instruction)
        held_by, held, *support = action.symbols
        gripper, box = GRIPPERS.index(held_by), BOXES.index(held)
        p = conditional("instruction", "instruction", [], instruction)
        p *= conditional(action.instruction, "gripper", [], gripper)
        p *= conditional(action.instruction, "box", one_hot(2, gripper), box)
        if support:
            previous = one_hot(2, gripper) + one_hot(3, box)
            p *= conditional("place", "table", previous, TABLES.index(support[0]))
        expected.append(p)
    scores = load_networks(models, "train_policy").log_probabilities(*situation, ACTIONS)
    np.testing.assert_allclose(np.exp(scores), expected, atol=1e-6)


def test_scores_follow_the_actions_asked_for(models: Path, situation: Situation) -> None:
    policy = load_networks(models, "train_policy")
    scores = policy.log_probabilities(*situation, ACTIONS)
    order = np.random.default_rng(0).permutation(len(ACTIONS))[:7]
    some = policy.log_probabilities(*situation, [ACTIONS[index] for index in order])
    assert some.tolist() == scores[order].tolist()


def test_an_action_on_a_symbol_without_slot_has_the_floor(models: Path, scene: Scene) -> None:
    pink = scene.boxes[0].model_copy(update={"name": "pink"})
    larger = scene.model_copy(update={"boxes": (*scene.boxes, pink)})
    positions = positions_along(larger, ())[0]
    policy = load_networks(models, "train_policy")
    actions = [Action("grasp", ("pr2L", box)) for box in ("red", "pink")]
    for goal, floor in (("(held red)", [False, True]), ("(held pink)", [False, False])):
        objective = parse_objective([goal])
        scores = policy.log_probabilities(
            objective, larger.state, larger.symbols, positions, actions
        )
        assert (scores == FLOOR).tolist() == floor


def test_planning_does_not_need_torch(models: Path) -> None:
    program = (
        "import sys, pathlib; from guided_lgp.policy.registry import load_policy;"
        f"load_policy('paper', pathlib.Path({str(models)!r}));"
        "sys.exit(bool({'torch', 'lightning', 'pandas'} & set(sys.modules)))"
    )
    assert subprocess.run([sys.executable, "-c", program], check=False).returncode == 0


def test_saved_twice_the_bytes_are_equal(models: Path, tmp_path: Path) -> None:
    save(tmp_path / "again", Encoding())
    names = sorted(path.name for path in (tmp_path / "again").iterdir())
    assert names == sorted(f"{n}.{end}" for n in Encoding().chains for end in ENDINGS)
    for name in names:
        assert (tmp_path / "again" / name).read_bytes() == (models / name).read_bytes()


def test_without_chain_the_choices_are_independent(tmp_path: Path, situation: Situation) -> None:
    save(tmp_path, Encoding(chain=False))
    p = np.exp(load_networks(tmp_path, "train_policy").log_probabilities(*situation, ACTIONS))
    assert p.sum() == pytest.approx(1, abs=1e-6)
    place = p[6:].reshape(2, 3, 5)
    independent = np.einsum(
        "i,j,k", place.sum((1, 2)), place.sum((0, 2)), place.sum((0, 1)), optimize=True
    )
    np.testing.assert_allclose(place, independent / place.sum() ** 2, atol=1e-6)


@pytest.mark.parametrize("name", ["place.json", "place.safetensors"])
@pytest.mark.parametrize("damage", [None, b"", b"{}", b"[1]", b"\xff\x00"])
def test_missing_and_damaged_files_name_the_stage(
    models: Path, name: str, damage: bytes | None
) -> None:
    (models / name).unlink()
    if damage is not None:
        (models / name).write_bytes(damage)
    with pytest.raises(InputError, match=rf"{name}:? .*train_policy"):
        load_networks(models, "train_policy")


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"version": 7}, "version: 7 is not 1"),
        ({"encoding": {"version": 7}}, "encoding.version: 7 is not 1"),
        ({"network": "grasp"}, "sub_policies: do not fit"),
        ({"training": None}, "training: None is not a mapping"),
        ({"sub_policies": []}, "sub_policies: .* is not a mapping"),
        ({"sub_policies": {"gripper": [41, 2]}}, "sub_policies: do not fit"),
        (
            {"sub_policies": {"gripper": [41, True, 2], "box": [1], "table": "ab"}},
            "True is not a whole number",
        ),
        ({"sub_policies": {"gripper": [40, 2], "box": [43, 3], "table": [46, 5]}}, "do not fit"),
        ({"sub_policies": {"gripper": [41, 2], "box": [43, 3], "table": [46, 5]}}, "2 × 41"),
    ],
)
def test_models_that_do_not_fit_are_refused(
    models: Path, change: dict[str, object], fault: str
) -> None:
    document = json.loads((models / "place.json").read_text())
    (models / "place.json").write_text(json.dumps(document | change))
    with pytest.raises(InputError, match=rf"place\.(json|safetensors).*{fault}.*train_policy"):
        load_networks(models, "train_policy")


@pytest.mark.parametrize(
    "bias",
    [
        np.zeros(3, np.float32),
        np.ones((), np.float32),
        np.zeros((80, 2), np.float32),
        np.full(80, np.nan, np.float32),
        np.full(80, np.inf, np.float32),
        np.zeros(80, np.int8),
    ],
    ids=["short", "scalar", "2d", "nan", "infinite", "int8"],
)
def test_weights_that_do_not_fit_are_refused(models: Path, bias: Array) -> None:
    path = models / "grasp.safetensors"
    save_file(load_file(path) | {"box.1.bias": bias}, path)
    with pytest.raises(InputError, match=r"grasp\.safetensors: box\.1[.:].*train_policy"):
        load_networks(models, "train_policy")


@pytest.mark.parametrize("kind", [torch.bfloat16, torch.float8_e4m3fn])
def test_weights_of_types_that_numpy_lacks_are_refused(models: Path, kind: torch.dtype) -> None:
    path = models / "grasp.safetensors"
    tensors = {name: torch.from_numpy(part) for name, part in load_file(path).items()}
    safetensors.torch.save_file(tensors | {"box.1.bias": torch.zeros(80, dtype=kind)}, path)
    with pytest.raises(InputError, match=r"grasp\.safetensors: .*train_policy"):
        load_networks(models, "train_policy")


@pytest.mark.parametrize(
    "change",
    [
        {"slots": {"grippers": 2, "boxes": 300_000, "surfaces": 2, "goals": 2}},
        {"slots": {"grippers": 2, "boxes": -1, "surfaces": 2, "goals": 2}},
        {"slots": 5},
        {"chain": 1},
        {"normalisation": {"centre": ["a"] * 21, "scale": [1.0] * 21}},
        {"normalisation": {"centre": [0.0] * 21, "scale": [0.0] * 21}},
        {"normalisation": {"centre": [0.0] * 20, "scale": [1.0] * 20}},
    ],
)
def test_impossible_encodings_are_refused(models: Path, change: dict[str, object]) -> None:
    document = json.loads((models / "place.json").read_text())
    document["encoding"] |= change
    (models / "place.json").write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"place\.json: encoding.*train_policy"):
        load_networks(models, "train_policy")


def test_networks_of_different_encodings_are_refused(models: Path, tmp_path: Path) -> None:
    save(tmp_path / "wide", Encoding(slots=(("gripper", 2), ("box", 4), ("table", 2))))
    for name in ("grasp.json", "grasp.safetensors"):
        (models / name).write_bytes((tmp_path / "wide" / name).read_bytes())
    with pytest.raises(InputError, match="different encodings"):
        load_networks(models, "train_policy")


def test_the_improved_policy_has_a_folder_of_its_own(models: Path) -> None:
    with pytest.raises(InputError, match=r"improved/instruction\.json: .*train_improved"):
        load_policy("improved", models)
    save(models / "improved", Encoding(chain=False))
    assert not load_policy("improved", models).encoding.chain
    assert load_networks(models, "train_policy").encoding.chain
    with pytest.raises(InputError, match=r"policy 'other': is unknown .*paper, improved"):
        load_policy("other", models)
