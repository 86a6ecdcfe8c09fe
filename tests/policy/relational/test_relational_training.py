"""Samples and training of the relational policy."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from synthetic import Enumeration

from guided_lgp.errors import InputError
from guided_lgp.params import Parallel, TrainRelational
from guided_lgp.policy.paper.dataset import Dataset
from guided_lgp.policy.paper.samples import build_dataset
from guided_lgp.policy.relational.encoding import NO_GOAL, Range, graphs
from guided_lgp.policy.relational.heads import heads
from guided_lgp.policy.relational.samples import Examples, examples, own_side, supports_first
from guided_lgp.policy.relational.train import train_relational
from guided_lgp.policy.relational.training import fit
from guided_lgp.policy.split import training_objectives

SETTINGS = TrainRelational(
    seed=6, validation_share=0.2, patience=40, width=16, rounds=1, l2=0, epochs=2, batch=64, lr=5e-3
)
SEED = np.random.SeedSequence(1)


@pytest.fixture(scope="module")
def dataset(world: Enumeration) -> Dataset:
    objectives = training_objectives(world.scenes[0].symbols, 40, seed=4)
    return build_dataset(world.scenes, world.sequences, world.shortest, objectives, slack=0)


@pytest.fixture(scope="module")
def problems(dataset: Dataset) -> Examples:
    return examples(dataset)


def applicable(problems: Examples) -> np.ndarray:
    inputs = graphs(problems.situations, Range.of(problems.situations))
    allowed = [h.applicable(problems.situations, inputs) for h in heads(problems.domain).values()]
    return np.logical_or.reduce(allowed)


def test_problems_are_distinct_and_know_every_sample(dataset: Dataset, problems: Examples) -> None:
    situations = problems.situations
    keys = np.column_stack([problems.configuration, situations.supports, situations.goals])
    assert len(np.unique(keys, axis=0)) == len(keys)
    allowed = applicable(problems)
    assert problems.right.any(axis=(1, 2)).all()
    assert not (problems.right & ~allowed).any()
    preferred = supports_first(situations) & own_side(situations)
    chosen = {
        key.tobytes(): (right, first)
        for key, right, first in zip(keys, problems.right, preferred, strict=True)
    }
    goal = dataset.goals.reshape(-1, 2, 10)
    for sample in range(0, len(dataset), 7):
        state = dataset.sample_state[sample]
        goals = np.full(3, NO_GOAL)
        for code in goal[dataset.sample_goals[sample]]:
            goals[code[2:5].argmax()] = -2 if code[0] else code[5:].argmax()
        key = np.array([dataset.configuration[state], *dataset.supports[state], *goals])
        right, first = chosen[key.astype(keys.dtype).tobytes()]
        instruction, gripper, box, table = dataset.actions[state]
        place = gripper, 2 + box if instruction == 0 else table
        assert right[place] or not first[place]


def test_goals_that_hold_are_left_out_once_more(problems: Examples) -> None:
    goals, supports = problems.situations.goals, problems.situations.supports
    holds = (goals == supports) & (goals != NO_GOAL)
    rows = {row.tobytes() for row in np.column_stack([problems.configuration, supports, goals])}
    some = np.flatnonzero(holds.any(axis=1))
    assert len(some)
    for row in some[:50]:
        left = np.where((goals == supports) | ((goals == -2) & (supports < 0)), NO_GOAL, goals)
        assert np.array([problems.configuration[row], *supports[row], *left[row]]).tobytes() in rows


def test_a_few_problems_are_learnt_by_heart(problems: Examples) -> None:
    few = problems[np.arange(0, len(problems), len(problems) // 40)]
    result = fit(few, few, SETTINGS.model_copy(update={"epochs": 60, "batch": 16}), SEED)
    floor = np.log(few.right.sum(axis=(1, 2))).mean()
    assert result.curves["validation_accuracy"][result.best_epoch - 1] > 0.98
    assert result.curves["validation_loss"][result.best_epoch - 1] < floor + 0.1


def test_shuffled_labels_fall_to_chance(problems: Examples) -> None:
    rng = np.random.default_rng(8)
    allowed = applicable(problems)
    noise = np.where(allowed, rng.random(allowed.shape), -1).reshape(len(allowed), -1)
    right = np.zeros_like(noise, dtype=bool)
    right[np.arange(len(right)), noise.argmax(axis=1)] = True
    shuffled = replace(problems, right=right.reshape(allowed.shape))
    held_out = rng.random(len(problems)) < 0.3
    settings = SETTINGS.model_copy(update={"epochs": 4})
    true = fit(problems[~held_out], problems[held_out], settings, SEED)
    result = fit(shuffled[~held_out], shuffled[held_out], settings, SEED)
    chance = (1 / allowed[held_out].sum(axis=(1, 2))).mean()
    assert result.curves["validation_accuracy"][result.best_epoch - 1] < chance + 0.05
    assert true.curves["validation_accuracy"][true.best_epoch - 1] > chance + 0.3


def test_the_same_bytes_whatever_the_number_of_workers(dataset: Dataset, tmp_path: Path) -> None:
    for count in (1, 2):
        parallel = Parallel(backend="loky", workers=count)
        folder = tmp_path / str(count)
        report = train_relational(dataset, SETTINGS, parallel, folder)
        report.save(folder / "report.json")
    names = sorted(path.name for path in (tmp_path / "1").iterdir())
    assert names == ["relational.json", "relational.safetensors", "report.json"]
    for name in names:
        assert (tmp_path / "1" / name).read_bytes() == (tmp_path / "2" / name).read_bytes()
    figures = report.sub_policies["action"]
    for split in (figures, figures["by_configuration"]):
        confusion, best = np.array(split["confusion"]), split["best_epoch"] - 1
        assert confusion.shape == (2, 2)
        assert split["epochs"] == len(split["curves"]["training_loss"]) == 2
        assert split["accuracy"] == split["curves"]["validation_accuracy"][best]


def test_faults_are_one_line(dataset: Dataset, tmp_path: Path) -> None:
    parallel = Parallel(backend="loky", workers=1)
    settings = SETTINGS.model_copy(update={"validation_share": 0.999})
    with pytest.raises(InputError, match=r"train_relational\.validation_share"):
        train_relational(dataset, settings, parallel, tmp_path)
    with pytest.raises(InputError, match="the loss is not finite"):
        train_relational(dataset, SETTINGS.model_copy(update={"lr": 1e30}), parallel, tmp_path)
    other = replace(dataset, encoding=replace(dataset.encoding, relative=True))
    with pytest.raises(InputError, match="is encoded otherwise"):
        examples(other)
