"""Symmetries, sizes and files of the relational policy; its weights are random here."""

import json
import shutil
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
import torch
from safetensors.numpy import load_file, save_file

from guided_lgp.bounds.results import Array
from guided_lgp.domains import load_domain
from guided_lgp.errors import InputError
from guided_lgp.logic import (
    Action,
    Goal,
    Objective,
    State,
    Symbols,
    applicable_actions,
    successor,
)
from guided_lgp.policy.registry import load_policy, missing_instructions
from guided_lgp.policy.relational.encoding import Range, graphs, situation
from guided_lgp.policy.relational.heads import heads
from guided_lgp.policy.relational.inference import RelationalPolicy, load_relational
from guided_lgp.policy.relational.model import Model, Weights, shapes
from guided_lgp.policy.relational.network import RelationalNetwork

LIMITS = Range((0.3, -0.5, 0.6), (0.7, 0.5, 1.0))
GRIPPERS = {"pr2L": np.array([0.3, 0.6, 1.2]), "pr2R": np.array([0.3, -0.6, 1.2])}


class Problem(NamedTuple):
    objective: Objective
    state: State
    symbols: Symbols
    positions: dict[str, Array]
    actions: list[Action]


def draw(boxes: int, tables: int, goals: int, seed: int) -> Problem:
    """A state after a few random actions, with random positions and goals."""
    rng = np.random.default_rng(seed)
    symbols = load_domain().symbols(
        gripper=GRIPPERS,
        box=[f"box{index}" for index in range(boxes)],
        table=[f"tab{index}" for index in range(tables)],
    )
    state = load_domain().state({box: str(rng.choice(symbols.surfaces)) for box in symbols.boxes})
    for _ in range(int(rng.integers(6))):
        actions = list(applicable_actions(state, symbols))
        state = successor(state, actions[rng.integers(len(actions))])
    kinds: list[Goal] = []
    for upper, lower in pairwise([*symbols.boxes[:goals], symbols.surfaces[0]]):
        kinds.append(Goal("held", (upper,)) if rng.random() < 0.2 else Goal("on", (upper, lower)))
    others = symbols.boxes + symbols.surfaces
    positions = {name: rng.uniform((0.3, -0.5, 0.6), (0.7, 0.5, 0.9)) for name in others}
    actions = list(applicable_actions(state, symbols))
    return Problem(tuple(kinds), state, symbols, GRIPPERS | positions, actions)


def renamed(problem: Problem, names: dict[str, str]) -> Problem:
    """The same problem under other names, and so in another order of declaration."""

    def new(name: str | None) -> str:
        assert name is not None
        return names.get(name, name)

    positions = {new(name): position for name, position in problem.positions.items()}
    return Problem(
        tuple(Goal(g.kind, tuple(map(new, g.symbols))) for g in problem.objective),
        load_domain().state(
            {new(box): new(table) for box, table in problem.state.support},
            {new(box): new(gripper) for box, gripper in problem.state.held},
        ),
        problem.symbols,
        {name: positions[name] for name in problem.positions},
        [Action(a.instruction, tuple(map(new, a.symbols))) for a in problem.actions],
    )


@pytest.fixture(scope="module")
def network() -> RelationalNetwork:
    with torch.random.fork_rng():
        torch.manual_seed(3)
        return RelationalNetwork(12, 2, heads(load_domain()))


@pytest.fixture(scope="module")
def weights(network: RelationalNetwork) -> Weights:
    tensors = {name: part.numpy().copy() for name, part in network.state_dict().items()}
    return Weights(LIMITS, tensors, load_domain())


@pytest.fixture(scope="module")
def policy(weights: Weights) -> RelationalPolicy:
    return RelationalPolicy(weights)


@pytest.fixture(scope="module")
def models(weights: Weights, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("models")
    Model(weights, {"seed": 3}).save(folder)
    return folder


@pytest.mark.parametrize("seed", range(5))
def test_renaming_boxes_and_tables_permutes_the_scores(policy: RelationalPolicy, seed: int) -> None:
    problem = draw(boxes=5, tables=3, goals=4, seed=seed)
    rng = np.random.default_rng(seed)
    names = {}
    for kind, count in (("box", 5), ("tab", 3)):
        names |= {f"{kind}{old}": f"{kind}{new}" for old, new in enumerate(rng.permutation(count))}
    scores = policy.log_probabilities(*problem)
    assert np.ptp(scores) > 0.01
    np.testing.assert_allclose(
        policy.log_probabilities(*renamed(problem, names)), scores, atol=1e-5
    )


@pytest.mark.parametrize("seed", range(5))
def test_mirroring_the_scene_swaps_the_grippers(policy: RelationalPolicy, seed: int) -> None:
    problem = draw(boxes=4, tables=2, goals=3, seed=seed)
    mirrored = renamed(problem, {"pr2L": "pr2R", "pr2R": "pr2L"})
    positions = {name: position * (1, -1, 1) for name, position in problem.positions.items()}
    mirrored = mirrored._replace(positions=positions)
    expected = policy.log_probabilities(*problem)
    assert policy.log_probabilities(*mirrored) == pytest.approx(expected, abs=1e-5)


@pytest.mark.parametrize(
    ("boxes", "tables", "goals"), [(1, 1, 1), (2, 1, 2), (3, 2, 1), (10, 3, 10), (14, 6, 14)]
)
def test_any_number_of_symbols_and_goals(
    policy: RelationalPolicy, boxes: int, tables: int, goals: int
) -> None:
    problem = draw(boxes, tables, goals, seed=boxes)
    p = np.exp(policy.log_probabilities(*problem))
    assert p.shape == (len(problem.actions),)
    assert p.sum() == pytest.approx(1)
    assert (p > 0).all()


@pytest.mark.parametrize("grippers", [["hand"], ["left", "right", "third"]])
def test_any_number_of_grippers(policy: RelationalPolicy, grippers: list[str]) -> None:
    symbols = load_domain().symbols(gripper=grippers, box=("red", "blue"), table=("tab1", "tab2"))
    state = load_domain().state({"red": "tab1"}, {"blue": grippers[0]})
    rng = np.random.default_rng(1)
    names = (*symbols.grippers, *symbols.tables)
    positions = {name: rng.uniform((0.3, -0.5, 0.6), (0.7, 0.5, 0.9)) for name in names}
    actions = list(applicable_actions(state, symbols))
    goals = (Goal("on", ("blue", "red")),)
    p = np.exp(policy.log_probabilities(goals, state, symbols, positions, actions))
    assert p.shape == (len(actions),)
    assert p.sum() == pytest.approx(1)


@pytest.mark.parametrize("seed", range(12))
def test_torch_and_numpy_agree_and_know_the_applicable_actions(
    network: RelationalNetwork, weights: Weights, seed: int
) -> None:
    problem = draw(boxes=4, tables=2, goals=3, seed=seed)
    symbols = load_domain().symbols(
        gripper=GRIPPERS, box=[f"box{i}" for i in range(4)], table=[f"tab{i}" for i in range(2)]
    )
    one = situation(problem.objective, problem.state, problem.positions, symbols)
    inputs = graphs(one, LIMITS)
    nodes, edges, held = (
        torch.from_numpy(array)
        for array in (inputs.nodes[0], np.repeat(inputs.edges, 2, axis=0), inputs.held[0])
    )
    with torch.no_grad():
        expected = network(nodes, edges, held).numpy()
    scores = weights.scores(inputs)
    for number, (name, head) in enumerate(heads(symbols.domain).items()):
        applicable = head.applicable(one, inputs)[0]
        np.testing.assert_allclose(
            scores[name][applicable], expected[:, number][applicable], atol=1e-6
        )
        allowed = {
            (symbols.grippers.index(a.symbols[0]), symbols.tables.index(a.symbols[-1]))
            for a in problem.actions
            if a.instruction == name
        }
        assert {tuple(row) for row in np.argwhere(applicable)} == allowed


@pytest.mark.parametrize("seed", range(12))
def test_heads_of_a_hand_over_apply_where_the_domain_says(seed: int) -> None:
    problem = draw(boxes=4, tables=2, goals=3, seed=seed)
    domain = load_domain("handover")
    members = {"box": problem.symbols.boxes, "table": problem.symbols.surfaces}
    symbols = domain.symbols(gripper=GRIPPERS, **members)
    state = domain.state(dict(problem.state.support), dict(problem.state.held))
    one = situation(problem.objective, state, problem.positions, symbols)
    inputs = graphs(one, LIMITS)
    found = {
        (name, symbols.grippers[gripper], symbols.tables[table])
        for name, head in heads(domain).items()
        for gripper, table in np.argwhere(head.applicable(one, inputs)[0])
    }
    expected = {
        (action.instruction, action.symbols[0], action.symbols[-1])
        for action in applicable_actions(state, symbols)
    }
    assert found == expected


def test_what_lies_outside_the_range_of_training_looks_like_its_border(
    policy: RelationalPolicy,
) -> None:
    problem = draw(boxes=3, tables=2, goals=2, seed=1)
    box = next(box for box, _ in problem.state.support)
    border, beyond = (
        problem._replace(positions=problem.positions | {box: np.array([0.5, 0.1, height])})
        for height in (LIMITS.upper[2], 5.0)
    )
    scores = policy.log_probabilities(*border)
    np.testing.assert_array_equal(policy.log_probabilities(*beyond), scores)


def test_a_domain_may_have_an_instruction_without_a_head(policy: RelationalPolicy) -> None:
    domain = load_domain()
    assert missing_instructions(policy, domain) == ()
    push = replace(domain.instructions[1], name="push")
    wider = replace(domain, instructions=(*domain.instructions, push))
    assert missing_instructions(policy, wider) == ("push",)
    assert missing_instructions(object(), wider) == ()


def test_files_are_read_back_without_torch(models: Path, policy: RelationalPolicy) -> None:
    problem = draw(boxes=3, tables=2, goals=2, seed=2)
    scores = load_policy("relational", models).log_probabilities(*problem)
    np.testing.assert_array_equal(scores, policy.log_probabilities(*problem))
    script = (
        "import sys, pathlib; from guided_lgp.policy.relational.inference import load_relational;"
        f"load_relational(pathlib.Path({str(models)!r})); sys.exit('torch' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0


def test_shapes_are_those_of_the_network(network: RelationalNetwork) -> None:
    parts = {name: tuple(part.shape) for name, part in network.state_dict().items()}
    assert shapes(12, 2, heads(load_domain())) == parts


@pytest.fixture
def copy(models: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(models, tmp_path / "models"))


@pytest.mark.parametrize(
    ("field", "value", "fault"),
    [
        ("version", 99, "version: 99 is not 1"),
        ("nodes", ["x"], "nodes, edges: are not what this program encodes"),
        ("limits", {"lower": [0, 0, 0], "upper": [1, 0, 1]}, "limits"),
        ("limits", {"lower": [0], "upper": [1]}, "limits"),
        ("limits", {"lower": "abc", "upper": [1, 1, 1]}, "limits"),
        ("limits", None, "limits"),
        ("width", 1.5, "width: 1.5 is not a whole number"),
        ("rounds", 10**9, "rounds: 1000000000 is more than 1024"),
        ("width", 13, "does not have the weights that its JSON describes"),
    ],
)
def test_a_damaged_description_is_one_line(
    copy: Path, field: str, value: object, fault: str
) -> None:
    file = copy / "relational.json"
    file.write_text(json.dumps(json.loads(file.read_text()) | {field: value}))
    with pytest.raises(InputError, match="train_relational") as error:
        load_relational(copy)
    assert fault in str(error.value)


@pytest.mark.parametrize("content", ["", "[]", "{}", "null"])
def test_a_description_that_is_none_is_one_line(copy: Path, content: str) -> None:
    (copy / "relational.json").write_text(content)
    with pytest.raises(InputError, match=r"relational\.json.*train_relational"):
        load_relational(copy)


@pytest.mark.parametrize("name", ["relational.json", "relational.safetensors"])
def test_a_missing_file_is_one_line(copy: Path, name: str) -> None:
    (copy / name).unlink()
    with pytest.raises(InputError, match=rf"{name}.*train_relational"):
        load_relational(copy)


def test_damaged_weights_are_one_line(copy: Path) -> None:
    file = copy / "relational.safetensors"
    tensors = load_file(file)
    tensors["pool.bias"][0] = np.nan
    save_file(tensors, file)
    with pytest.raises(InputError, match=r"pool\.bias: is not of finite numbers of 32 bits"):
        load_relational(copy)
    save_file(tensors | {"pool.bias": np.zeros(len(tensors["pool.bias"]), np.int64)}, file)
    with pytest.raises(InputError, match=r"pool\.bias: is not of finite numbers of 32 bits"):
        load_relational(copy)
    del tensors["pool.bias"]
    save_file(tensors, file)
    with pytest.raises(InputError, match="does not have the weights"):
        load_relational(copy)
    file.write_bytes(file.read_bytes()[:100])
    with pytest.raises(InputError, match="is damaged"):
        load_relational(copy)
