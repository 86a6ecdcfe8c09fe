import json
from dataclasses import replace
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from synthetic import Enumeration, make_scene, positions_along, write_frame

from guided_lgp.domains import load_domain
from guided_lgp.errors import InputError
from guided_lgp.logic import (
    Action,
    Goal,
    Objective,
    Symbols,
    format_objective,
    progress,
    satisfied,
    two_goal_objectives,
    unsatisfied,
)
from guided_lgp.params import SampleRecipe
from guided_lgp.policy.paper.dataset import Dataset, load_dataset
from guided_lgp.policy.paper.encoding import Encoding
from guided_lgp.policy.paper.samples import build_dataset
from guided_lgp.policy.split import training_objectives


@pytest.fixture(scope="module")
def objectives(world: Enumeration) -> list[Objective]:
    return training_objectives(world.scenes[0].symbols, 40, seed=4)


@pytest.fixture(scope="module")
def dataset(world: Enumeration, objectives: list[Objective]) -> Dataset:
    return build_dataset(world.scenes, world.sequences, world.shortest, objectives, slack=0)


def decode_goals(code: np.ndarray, symbols: Symbols) -> Objective:
    goals = []
    for kind, box, table in ((g[:2], g[2:5], g[5:]) for g in code.reshape(2, 10)):
        on = (symbols.tables[int(table.argmax())],) if table.any() else ()
        names = (symbols.boxes[int(box.argmax())], *on)
        goals.append(Goal(("held", "on")[int(kind.argmax())], names))
    return tuple(goals)


def decode_action(classes: np.ndarray, symbols: Symbols) -> Action:
    instruction, gripper, box, table = classes.tolist()
    on = (symbols.tables[table],) if table >= 0 else ()
    name = Encoding().signature.instructions[instruction]
    return Action(name, (symbols.grippers[gripper], symbols.boxes[box], *on))


def expected_samples(
    world: Enumeration, objectives: list[Objective], slack: int, adapt: bool = False
) -> set[tuple[Objective, bytes, Action]]:
    """The definition of the samples, one by one."""
    samples = set()
    for scene in world.scenes:
        for objective in objectives:
            shortest = world.shortest_length(scene, objective)
            for path, end in world.feasible[scene.name].items():
                if shortest is None or not shortest <= len(path) <= shortest + slack:
                    continue
                prefixes = [progress(scene.state, path[:k]) for k in range(len(path))]
                if not satisfied(end, objective) or any(satisfied(s, objective) for s in prefixes):
                    continue
                frames = positions_along(scene, path)
                for prefix, frame, action in zip(prefixes, frames, path, strict=False):
                    state = np.concatenate(list(frame.values())).astype(np.float32).tobytes()
                    for goals in (objective, unsatisfied(prefix, objective))[: 1 + adapt]:
                        pair = goals * (2 // len(goals))  # one goal is encoded twice
                        samples |= {(pair, state, action), (pair[::-1], state, action)}
    return samples


def found_samples(dataset: Dataset) -> set[tuple[Objective, bytes, Action]]:
    return {
        (
            decode_goals(dataset.goals[goals], dataset.symbols),
            dataset.states[state].tobytes(),
            decode_action(dataset.actions[state], dataset.symbols),
        )
        for state, goals in zip(dataset.sample_state, dataset.sample_goals, strict=True)
    }


@pytest.mark.parametrize("slack", [0, 1])
def test_samples_are_those_of_the_definition(
    world: Enumeration, objectives: list[Objective], slack: int
) -> None:
    dataset = build_dataset(world.scenes, world.sequences, world.shortest, objectives, slack)
    assert found_samples(dataset) == expected_samples(world, objectives, slack)


def test_supports_are_those_of_the_symbolic_states(world: Enumeration, dataset: Dataset) -> None:
    symbols = dataset.symbols
    expected = {}
    for scene in world.scenes:
        for path in world.feasible[scene.name]:
            state = progress(scene.state, path)
            frame = positions_along(scene, path)[-1]
            key = np.concatenate(list(frame.values())).astype(np.float32).tobytes()
            expected[key] = dict(state.support + state.held)
    for state, supports in zip(dataset.states, dataset.supports.tolist(), strict=True):
        at = [symbols.tables[c] if c >= 0 else symbols.grippers[-1 - c] for c in supports]
        assert dict(zip(symbols.boxes, at, strict=True)) == expected[state.tobytes()]


def build(world: Enumeration, objectives: list[Objective], **changes: Any) -> Dataset:
    variant = SampleRecipe(**changes)
    return build_dataset(world.scenes, world.sequences, world.shortest, objectives, 0, variant)


def test_variant_with_adapted_goals(
    world: Enumeration, objectives: list[Objective], dataset: Dataset
) -> None:
    variant = build(world, objectives, adapted_goals=True)
    assert found_samples(variant) == expected_samples(world, objectives, 0, adapt=True)
    assert found_samples(variant) > found_samples(dataset)


def test_variant_with_boxes_in_random_order(
    world: Enumeration, objectives: list[Objective], dataset: Dataset
) -> None:
    variant = build(world, objectives, boxes="random")
    assert len(variant) == len(dataset)
    remaining = expected_samples(world, objectives, slack=0)
    symbols = variant.symbols
    used = set()
    for state, goals in zip(variant.sample_state, variant.sample_goals, strict=True):
        for boxes in permutations(symbols.boxes):
            order = [0, 1, *(2 + boxes.index(name) for name in symbols.boxes), 5, 6]
            named = load_domain().symbols(
                gripper=symbols.grippers, box=boxes, table=symbols.surfaces
            )
            sample = (
                decode_goals(variant.goals[goals], named),
                variant.states[state].reshape(7, 3)[order].tobytes(),
                decode_action(variant.actions[state], named),
            )
            if sample in remaining:
                remaining.remove(sample)
                used.add(boxes)
                break
    assert not remaining, "every sample occurs, under one of the orders"
    assert len(used) == 6


def test_variant_with_one_order(
    world: Enumeration, objectives: list[Objective], dataset: Dataset
) -> None:
    variant = build(world, objectives, both_orders=False)
    assert len(variant) == len(dataset) / 2
    goals = variant.goals[variant.sample_goals]
    assert {decode_goals(code, variant.symbols) for code in goals} <= set(objectives)


def test_variant_with_normalised_positions(
    world: Enumeration, objectives: list[Objective], dataset: Dataset
) -> None:
    variant = build(world, objectives, normalised=True)
    moving = np.ptp(dataset.states, axis=0) > 0
    assert np.abs(variant.states.mean(axis=0)).max() < 1e-4
    assert np.abs(variant.states.std(axis=0) - moving).max() < 1e-3
    scene = world.scenes[0]
    slots = variant.encoding.fill((), scene.state, scene.symbols)
    start = variant.encoding.encode_state(slots, scene.state, positions_along(scene, ())[0])
    assert (variant.states == start).all(axis=1).any()


def test_variant_with_the_named_boxes_first(
    world: Enumeration, objectives: list[Objective]
) -> None:
    variant = build(world, objectives, boxes="named_first")
    remaining = expected_samples(world, objectives, slack=0)
    assert len(variant) >= len(remaining)
    symbols = variant.symbols
    found = set()
    for state, goals in zip(variant.sample_state, variant.sample_goals, strict=True):
        for boxes in permutations(symbols.boxes):
            order = [0, 1, *(2 + boxes.index(name) for name in symbols.boxes), 5, 6]
            own = load_domain().symbols(gripper=symbols.grippers, box=boxes, table=symbols.surfaces)
            decoded = decode_goals(variant.goals[goals], own)
            world_order = variant.states[state].reshape(7, 3)[order].tobytes()
            sample = decoded, world_order, decode_action(variant.actions[state], own)
            named = dict.fromkeys(n for g in decoded for n in g.symbols if n in boxes)
            if sample in remaining:
                assert boxes[: len(named)] == tuple(named)
                found.add(sample)
    assert found == remaining


def test_variant_with_relative_positions(
    world: Enumeration, objectives: list[Objective], dataset: Dataset
) -> None:
    variant = build(world, objectives, relative=True)
    there, here = (data.states.reshape(-1, 7, 3).astype(float) for data in (dataset, variant))
    np.testing.assert_allclose(here[:, 2], there[:, 2] - there[:, 5], atol=1e-6)
    for symbol in (0, 1, 3, 4, 5, 6):
        np.testing.assert_allclose(here[:, symbol], there[:, symbol] - there[:, 2], atol=1e-6)


def test_variant_with_what_the_state_means(
    world: Enumeration, objectives: list[Objective], dataset: Dataset
) -> None:
    variant = build(world, objectives, symbolic_state=True)
    encoding, symbols = variant.encoding, variant.symbols
    assert encoding.input_size == len(set(encoding.input_names)) == 41 + 2 + 3 * 7
    assert (variant.states[:, :21] == dataset.states).all()
    assert len(variant) == len(dataset)
    for sample in range(0, len(variant), 50):
        row = variant.sample_state[sample]
        places = variant.states[row, 21:].reshape(3, 7)
        assert (places.sum(axis=1) == 1).all()
        names = (*symbols.tables, *symbols.grippers)
        at = {box: names[code.argmax()] for box, code in zip(symbols.boxes, places, strict=True)}
        for code in variant.goals[variant.sample_goals[sample]].reshape(2, 11):
            (goal, _) = decode_goals(np.tile(code[:10], 2), symbols)
            held = goal.kind == "held" and at[goal.symbols[0]] in symbols.grippers
            assert code[10] == (held or at[goal.symbols[0]] == goal.symbols[-1])


def test_variant_without_chain(
    world: Enumeration, objectives: list[Objective], dataset: Dataset
) -> None:
    variant = build(world, objectives, chain=False)
    samples = variant.of_network("place")
    inputs, classes = variant.tensors("place", "table", samples)
    assert inputs.shape == (len(samples), 41)
    assert (classes == dataset.tensors("place", "table", samples)[1]).all()


def test_each_step_is_a_sample_once_per_order_of_the_goals(
    world: Enumeration, objectives: list[Objective], dataset: Dataset
) -> None:
    count = 0
    for scene in world.scenes:
        for objective in objectives:
            shortest = world.shortest_length(scene, objective)
            lengths = [
                len(path)
                for path, end in world.feasible[scene.name].items()
                if len(path) == shortest and satisfied(end, objective)
            ]
            count += 2 * sum(lengths)
    assert len(dataset) == count > 1000
    assert len(np.unique(np.stack([dataset.sample_state, dataset.sample_goals]), axis=1).T) == count


def test_nothing_of_the_test_sets_leaks(dataset: Dataset, objectives: list[Objective]) -> None:
    symbols = dataset.symbols
    encoded = {decode_goals(code, symbols) for code in dataset.goals[dataset.sample_goals]}
    seen = {frozenset(goals) for goals in encoded}
    unseen = {frozenset(goals) for goals in two_goal_objectives(symbols)} - set(
        map(frozenset, objectives)
    )
    assert seen <= set(map(frozenset, objectives))
    assert not seen & unseen
    assert all(len(goals) == 2 for goals in seen), "one-goal objectives are for testing only"


def test_configurations_that_are_not_given_are_not_used(
    world: Enumeration, objectives: list[Objective]
) -> None:
    held_out = world.scenes[-1]
    dataset = build_dataset(world.scenes[:-1], world.sequences, world.shortest, objectives, slack=0)
    assert held_out.name not in dataset.configurations
    start = np.concatenate([np.array(box.position) for box in held_out.boxes]).astype(np.float32)
    assert not (dataset.states[:, 6:15] == start).all(axis=1).any()


def test_tensors_hold_the_true_previous_decisions(dataset: Dataset) -> None:
    samples = dataset.of_network("place")
    actions = dataset.actions[dataset.sample_state[samples]]
    assert (actions[:, 0] == Encoding().signature.instructions.index("place")).all()
    inputs, classes = dataset.tensors("place", "table", samples)
    assert inputs.shape == (len(samples), 41 + 2 + 3)
    assert classes.tolist() == actions[:, 3].tolist()
    assert inputs[:, 41:43].argmax(axis=1).tolist() == actions[:, 1].tolist()
    assert inputs[:, 43:].argmax(axis=1).tolist() == actions[:, 2].tolist()
    assert (inputs[:, 41:].sum(axis=1) == 2).all()
    first, _ = dataset.tensors("place", "gripper", samples)
    assert (first == inputs[:, :41]).all()


def test_networks_share_the_samples_by_instruction(dataset: Dataset) -> None:
    assert len(dataset.of_network("instruction")) == len(dataset)
    parts = [dataset.of_network(network) for network in ("grasp", "place")]
    assert sorted(np.concatenate(parts)) == list(range(len(dataset)))


def test_saved_twice_the_bytes_are_equal_and_come_back(dataset: Dataset, tmp_path: Path) -> None:
    for folder in ("one", "two"):
        dataset.save(tmp_path / folder)
    for name in ("samples.safetensors", "dataset.json"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    loaded = load_dataset(tmp_path / "one")
    for name, value in vars(dataset).items():
        if isinstance(value, np.ndarray):
            assert value.dtype == getattr(loaded, name).dtype
            assert (value == getattr(loaded, name)).all()
        else:
            assert value == getattr(loaded, name)


def test_missing_and_damaged_data_sets_name_the_stage(dataset: Dataset, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"dataset\.json: .*build_dataset"):
        load_dataset(tmp_path)
    dataset.save(tmp_path)
    samples = (tmp_path / "samples.safetensors").read_bytes()
    for damaged in (samples[:100], b"", b"text"):
        (tmp_path / "samples.safetensors").write_bytes(damaged)
        with pytest.raises(InputError, match=r"samples\.safetensors: .*build_dataset"):
            load_dataset(tmp_path)
    document = json.loads((tmp_path / "dataset.json").read_text())
    document["encoding"]["version"] = 99
    (tmp_path / "dataset.json").write_text(json.dumps(document))
    with pytest.raises(InputError, match=r"encoding\.version: 99 is not 1.*build_dataset"):
        load_dataset(tmp_path)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("sample_state", 10**6),
        ("sample_goals", -1),
        ("states", np.nan),
        ("actions", 5),
        ("supports", -3),
        ("configuration", 5),
    ],
)
def test_arrays_out_of_range_are_refused(
    dataset: Dataset, tmp_path: Path, name: str, value: float
) -> None:
    array = getattr(dataset, name).copy()
    array[-1] = value
    replace(dataset, **{name: array}).save(tmp_path)
    with pytest.raises(InputError, match=rf"samples\.safetensors: {name}: are .*build_dataset"):
        load_dataset(tmp_path)


def test_tables_of_other_content_are_refused(
    world: Enumeration, objectives: list[Objective], tmp_path: Path
) -> None:
    frame = pd.read_parquet(world.sequences)
    odd = tmp_path / "odd.parquet"
    for column, value in (
        ("skeleton", "(grasp pr2L pink)"),
        ("skeleton", "(jump)"),
        ("skeleton", "(place pr2L red tab1)"),
        ("feasible", None),
        ("states", [np.nan] * 42),
    ):
        row = next(index for index, feasible in enumerate(frame["feasible"]) if feasible)
        values = [*frame[column]]
        values[row] = value
        write_frame(odd, frame.assign(**{column: values}))
        with pytest.raises(InputError, match=r"odd\.parquet: .*enumerate_sequences"):
            build_dataset(world.scenes, odd, world.shortest, objectives, 0)
    odd.write_bytes(b"PAR1" + b"\xff" * 60 + b"PAR1")
    with pytest.raises(InputError, match=r"odd\.parquet: cannot be read"):
        build_dataset(world.scenes, odd, world.shortest, objectives, 0)
    lengths = pd.read_parquet(world.shortest)
    write_frame(odd, pd.concat([lengths, lengths]))
    with pytest.raises(InputError, match=r"odd\.parquet: has an objective .* twice"):
        build_dataset(world.scenes, world.sequences, odd, objectives, 0)


def test_sequences_that_do_not_fit_the_scenes_are_refused(
    world: Enumeration, objectives: list[Objective], tmp_path: Path
) -> None:
    other = make_scene("other", np.random.default_rng(0))
    with pytest.raises(InputError, match=r"lacks other .*enumerate_sequences"):
        build_dataset([other], world.sequences, world.shortest, objectives, 0)

    absent = tmp_path / "absent.parquet"
    with pytest.raises(InputError, match=r"absent\.parquet: .*enumerate_sequences"):
        build_dataset(world.scenes, absent, world.shortest, objectives, 0)

    short = tmp_path / "short.parquet"
    frame = pd.read_parquet(world.sequences)
    frame["states"] = [None if row is None else row[:-1] for row in frame["states"]]
    write_frame(short, frame)
    with pytest.raises(InputError, match=r"short\.parquet: states of train-000.*numbers"):
        build_dataset(world.scenes, short, world.shortest, objectives, 0)

    none = tmp_path / "none.parquet"
    write_frame(none, pd.read_parquet(world.sequences).assign(feasible=False))
    with pytest.raises(InputError, match="no training objective has a feasible sequence"):
        build_dataset(world.scenes, none, world.shortest, objectives, 0)


def test_training_needs_the_symbols_of_setup_a(
    world: Enumeration, objectives: list[Objective]
) -> None:
    scene = world.scenes[0]
    fewer = scene.model_copy(update={"boxes": scene.boxes[:2]})
    with pytest.raises(InputError, match="2 boxes"):
        build_dataset([fewer], world.sequences, world.shortest, objectives, 0)
    with pytest.raises(InputError, match="other symbols"):
        build_dataset([scene, fewer], world.sequences, world.shortest, objectives, 0)


def test_an_objective_that_holds_at_the_start_gives_no_samples(
    world: Enumeration, objectives: list[Objective], dataset: Dataset
) -> None:
    trivial = [
        (index, objective)
        for index, scene in enumerate(world.scenes)
        for objective in objectives
        if satisfied(load_domain().state(dict(scene.state.support)), objective)
    ]
    assert trivial, "the world has such pairs"
    configuration = dataset.configuration[dataset.sample_state]
    texts = [
        format_objective(decode_goals(code, dataset.symbols))
        for code in dataset.goals[dataset.sample_goals]
    ]
    pairs = set(zip(configuration.tolist(), texts, strict=True))
    assert not pairs & {(index, format_objective(objective)) for index, objective in trivial}
