import json
from pathlib import Path

import numpy as np
import pytest
from synthetic import Enumeration

from guided_lgp.errors import InputError
from guided_lgp.params import Network, Parallel, TrainPolicy
from guided_lgp.policy.paper.dataset import Dataset
from guided_lgp.policy.paper.encoding import Encoding
from guided_lgp.policy.paper.samples import build_dataset
from guided_lgp.policy.paper.train import train_model, train_network
from guided_lgp.policy.split import training_objectives
from guided_lgp.policy.splits import held_out_samples

NETWORK = Network(layers=2, nodes=16, dropout=0.1, l2=1e-4, epochs=3, batch=64, lr=1e-3)
SETTINGS = TrainPolicy(
    seed=5,
    validation_share=0.2,
    patience=20,
    instruction=NETWORK,
    grasp=NETWORK,
    place=NETWORK,
)
ALONE, TOGETHER = (Parallel(backend="loky", workers=count) for count in (1, 2))


@pytest.fixture(scope="module")
def dataset(world: Enumeration) -> Dataset:
    objectives = training_objectives(world.scenes[0].symbols, 40, seed=4)
    return build_dataset(world.scenes, world.sequences, world.shortest, objectives, slack=0)


def test_the_same_bytes_whatever_the_number_of_workers(dataset: Dataset, tmp_path: Path) -> None:
    for folder, parallel in (("alone", ALONE), ("together", TOGETHER)):
        report = train_network("place", dataset, SETTINGS, parallel, tmp_path / folder)
        report.save(tmp_path / folder / "report.json")
    names = sorted(path.name for path in (tmp_path / "alone").iterdir())
    assert names == ["place.json", "place.safetensors", "report.json"]
    for name in names:
        alone, together = (tmp_path / folder / name for folder in ("alone", "together"))
        assert alone.read_bytes() == together.read_bytes()


@pytest.mark.parametrize("network", ["instruction", "grasp"])
def test_the_report_holds_curves_confusion_and_both_splits(
    dataset: Dataset, tmp_path: Path, network: str
) -> None:
    train_network(network, dataset, SETTINGS, ALONE, tmp_path).save(tmp_path / "report.json")
    document = json.loads((tmp_path / "report.json").read_text())
    samples = len(dataset.of_network(network))
    assert document["network"] == network
    assert document["samples"] == samples
    assert tuple(document["sub_policies"]) == Encoding().chains[network]
    for name, figures in document["sub_policies"].items():
        assert figures["classes"] == list(dataset.class_names(name))
        for split in (figures, figures["by_configuration"]):
            confusion = np.array(split["confusion"])
            best = split["best_epoch"] - 1
            assert split["epochs"] == len(split["curves"]["validation_loss"]) == 3
            assert split["loss"] == min(split["curves"]["validation_loss"])
            assert split["accuracy"] == split["curves"]["validation_accuracy"][best]
            assert np.trace(confusion) / confusion.sum() == pytest.approx(split["accuracy"])
            assert 0.05 * samples < confusion.sum() < 0.5 * samples


def test_the_split_by_configuration_shares_no_configuration(dataset: Dataset) -> None:
    configuration = dataset.configuration[dataset.sample_state]
    held_out = held_out_samples(configuration, "configuration", SETTINGS)
    assert not set(configuration[held_out]) & set(configuration[~held_out])
    assert len(set(configuration[held_out])) == 1  # a fifth of five

    random = held_out_samples(configuration, "random", SETTINGS)
    assert np.count_nonzero(random) == round(0.2 * len(dataset))
    assert set(configuration[random]) == set(configuration[~random])


def test_a_share_that_leaves_nothing_is_refused(world: Enumeration, tmp_path: Path) -> None:
    objectives = training_objectives(world.scenes[0].symbols, 40, seed=4)
    single = build_dataset(world.scenes[:1], world.sequences, world.shortest, objectives, slack=0)
    with pytest.raises(InputError, match=r"validation_share: .*configuration"):
        train_network("grasp", single, SETTINGS, ALONE, tmp_path)


def test_networks_are_those_of_the_domain(dataset: Dataset) -> None:
    settings = TrainPolicy.model_validate(SETTINGS.model_dump() | {"take": NETWORK.model_dump()})
    with pytest.raises(InputError, match=r"has the networks .*take .*instruction, grasp, place"):
        train_model("grasp", dataset, settings, "random")


def test_training_for_studies_gives_the_same_networks(dataset: Dataset, tmp_path: Path) -> None:
    train_network("instruction", dataset, SETTINGS, ALONE, tmp_path / "pipeline")
    for split in ("random", "configuration"):
        train_model("instruction", dataset, SETTINGS, split).save(tmp_path / split)
    pipeline, *studies = (
        (tmp_path / folder / "instruction.safetensors").read_bytes()
        for folder in ("pipeline", "random", "configuration")
    )
    assert [pipeline == weights for weights in studies] == [True, False]
