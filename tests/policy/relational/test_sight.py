"""What a relational policy sees of the geometry, and what it learns from failures."""

from dataclasses import replace
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest
import torch

from guided_lgp.domains import load_domain
from guided_lgp.errors import InputError
from guided_lgp.logic import applicable_actions, parse_objective
from guided_lgp.params import TrainRelational
from guided_lgp.policy.relational.encoding import (
    EDGE_FEATURES,
    Range,
    Situations,
    graphs,
    situation,
)
from guided_lgp.policy.relational.geometry import BLIND, EVERYTHING, PAIRS, Sight
from guided_lgp.policy.relational.heads import heads
from guided_lgp.policy.relational.inference import RelationalPolicy, load_relational
from guided_lgp.policy.relational.model import Model, Weights
from guided_lgp.policy.relational.network import RelationalNetwork
from guided_lgp.policy.relational.samples import Examples
from guided_lgp.policy.relational.training import fit
from guided_lgp.scene import Box, Scene, Table
from guided_lgp.scene.footprints import footprint, gap
from guided_lgp.search.observation import observe, shapes, start

SCENE = Scene(
    tables=(
        Table(name="tab1", position=(0.5, 0.3, 0.6), half_extents=(0.2, 0.2)),
        Table(name="tab2", position=(0.5, -0.3, 0.6), half_extents=(0.2, 0.2)),
    ),
    boxes=(
        Box(name="low", size=(0.12, 0.06, 0.05), position=(0.5, 0.2, 0.625), on="tab1"),
        Box(name="tall", size=(0.12, 0.06, 0.14), position=(0.52, 0.28, 0.67), yaw=0.1, on="tab1"),
        Box(name="far", size=(0.1, 0.05, 0.1), position=(0.4, 0.45, 0.65), yaw=1.2, on="tab1"),
    ),
)
OBJECTIVE = parse_objective(["(on low tab2)"])
LIMITS = Range((0.3, -0.5, 0.5), (0.7, 0.0, 0.9))


def seen(scene: Scene = SCENE) -> Situations:
    keyframe = start(scene)
    positions, forms = observe(scene, keyframe), shapes(scene, keyframe)
    return situation(OBJECTIVE, scene.state, positions, scene.symbols, forms)


def test_pairs_see_gaps_and_tops() -> None:
    edges = graphs(seen(), LIMITS, EVERYTHING).edges[0, 2:, 2:, len(EDGE_FEATURES) :]
    value = {name: edges[..., column] for column, name in enumerate(PAIRS)}
    for (one, box), (two, other) in permutations(enumerate(SCENE.boxes), 2):
        apart = gap(footprint(box), footprint(other))
        assert 0.1 * value["gap"][one, two] <= apart + 1e-6
        above = (other.position[2] + other.size[2] / 2) - (box.position[2] + box.size[2] / 2)
        assert value["its top above this one's"][one, two] == pytest.approx(
            np.clip(above / 0.1, -1, 1), abs=1e-5
        )
    assert 0.1 * value["gap"][0, 1] == pytest.approx(
        gap(footprint(SCENE.boxes[0]), footprint(SCENE.boxes[1])), abs=1e-3
    )
    assert value["gap below 0.03 m"][0].tolist() == [0, 1, 0]
    assert value["its top above this one's by 0.01 m"][:, 0].tolist() == [0, 0, 0]
    assert not graphs(seen(), LIMITS, EVERYTHING).edges[0, :2, :, len(EDGE_FEATURES) :].any()


@pytest.fixture(scope="module")
def network() -> RelationalNetwork:
    with torch.random.fork_rng():
        torch.manual_seed(3)
        return RelationalNetwork(12, 2, heads(load_domain()), EVERYTHING)


@pytest.fixture(scope="module")
def weights(network: RelationalNetwork) -> Weights:
    tensors = {name: part.numpy().copy() for name, part in network.state_dict().items()}
    return Weights(LIMITS, tensors, load_domain(), EVERYTHING)


def scores(weights: Weights, scene: Scene) -> dict[str, float]:
    keyframe = start(scene)
    policy = RelationalPolicy(weights).given(shapes(scene, keyframe))
    actions = list(applicable_actions(scene.state, scene.symbols))
    positions = observe(scene, keyframe)
    log_p = policy.log_probabilities(OBJECTIVE, scene.state, scene.symbols, positions, actions)
    return dict(zip(map(str, actions), log_p.tolist(), strict=True))


def test_torch_and_numpy_agree(network: RelationalNetwork, weights: Weights) -> None:
    inputs = graphs(seen(), LIMITS, EVERYTHING)
    expected = weights.scores(inputs)
    for gripper in range(2):
        tensors = (inputs.nodes[:, gripper], inputs.edges, inputs.held[:, gripper])
        with torch.no_grad():
            found = network(*map(torch.from_numpy, tensors))[0]
        assert expected["grasp"][gripper] == pytest.approx(found[0].numpy(), abs=1e-5)


def test_a_mirrored_scene_swaps_the_grippers(weights: Weights) -> None:
    def mirrored(body: Box | Table) -> Box | Table:
        x, y, z = body.position
        return body.model_copy(update={"position": (x, -y, z), "yaw": -body.yaw})

    update = {
        "boxes": tuple(map(mirrored, SCENE.boxes)),
        "tables": tuple(map(mirrored, SCENE.tables)),
    }
    swapped = {"pr2L": "pr2R", "pr2R": "pr2L"}
    mirror = scores(weights, SCENE.model_copy(update=update))
    for action, score in scores(weights, SCENE).items():
        words = [swapped.get(word, word) for word in action[1:-1].split()]
        assert mirror[f"({' '.join(words)})"] == pytest.approx(score, abs=1e-5)


def test_what_is_seen_is_part_of_the_file(weights: Weights, tmp_path: Path) -> None:
    Model(weights, {"seed": 3}).save(tmp_path)
    assert load_relational(tmp_path)._weights.sight == EVERYTHING
    file = tmp_path / "relational.json"
    file.write_text(file.read_text().replace("gap below 0.05 m", "gap below 5 m"))
    with pytest.raises(InputError, match="are not what this program encodes"):
        load_relational(tmp_path)


def test_the_blind_policy_is_as_it_was() -> None:
    assert graphs(seen(), LIMITS).edges.shape[-1] == len(EDGE_FEATURES)
    assert graphs(seen(), LIMITS, Sight(("height",), ())).nodes.shape[-1] == 16


@pytest.mark.parametrize(("sight", "expected"), [(EVERYTHING, 1.0), (BLIND, 0.5)])
def test_what_blocks_is_learnt_by_those_who_see_it(sight: Sight, expected: float) -> None:
    """Of two boxes, either may be the tall one: the other cannot be taken."""
    low, tall = SCENE.boxes[:2]
    other = {
        "low": low.model_copy(update={"size": tall.size, "position": (*low.position[:2], 0.67)}),
        "tall": tall.model_copy(update={"size": low.size, "position": (*tall.position[:2], 0.625)}),
    }
    scenes = [
        SCENE,
        SCENE.model_copy(update={"boxes": (other["low"], other["tall"], SCENE.boxes[2])}),
    ]
    problems = [seen(scene) for scene in scenes]
    situations = Situations(
        *(
            np.concatenate([getattr(one, name) for one in problems] * 8)
            for name in ("positions", "supports", "goals")
        ),
        grippers=2,
        shapes=np.concatenate([one.shapes for one in problems if one.shapes is not None] * 8),
    )
    if sight == BLIND:
        situations = replace(situations, positions=situations.positions[[0] * 16])
    right = np.zeros((16, 2, 5), dtype=bool)
    right[::2, 0, 3] = right[1::2, 0, 2] = True
    wrong = np.zeros_like(right)
    wrong[::2, :, 2] = wrong[1::2, :, 3] = True
    examples = Examples(situations, right, np.arange(16, dtype=np.int32), load_domain(), wrong)
    settings = TrainRelational(
        seed=1,
        validation_share=0.2,
        patience=60,
        width=16,
        rounds=1,
        l2=0,
        epochs=60,
        batch=16,
        lr=1e-2,
    )
    result = fit(examples, examples, settings, np.random.SeedSequence(1), sight)
    best = result.best_epoch - 1
    assert result.curves["validation_accuracy"][best] == pytest.approx(expected, abs=0.01)
