"""The study of the feasibility classifier, with bounds under which nothing can stand on blue."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from test_studies import copy_models, enumerate_all, root

from guided_lgp.errors import InputError
from guided_lgp.logic import parse_objective
from guided_lgp.params import Network, SearchLimits, load_params
from guided_lgp.policy.uniform import Uniform
from guided_lgp.scene import load_scenes
from guided_lgp.search import best_first
from guided_lgp.search.problem import Problem
from guided_lgp.studies import evaluate, feasibility
from guided_lgp.studies.cases import OUTCOMES
from guided_lgp.studies.classifier import FeasibilityAware, Verdicts, train_classifier
from guided_lgp.studies.feasibility_tables import feasibility_tables, verdict
from stand_ins import NothingOnBlue

__all__ = ["root"]  # a fixture

NETWORK = Network(layers=1, nodes=8, dropout=0.0, l2=0.0, epochs=20, batch=64, lr=1e-2)


@pytest.fixture
def outputs(root: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """What the pipeline leaves: sequences of up to two actions, and models."""
    monkeypatch.setattr(evaluate, "SceneBounds", NothingOnBlue)
    enumerate_all(root, "training", 2)
    enumerate_all(root, "test", 1)
    copy_models(root)
    return root


def verdicts(root: Path, split: str) -> Verdicts:
    scenes = load_scenes(root / f"data/scenes/{split}.json").scenes
    return feasibility.read_verdicts(scenes, root / f"data/sequences/{split}.parquet")


def test_run_and_render(outputs: Path) -> None:
    feasibility.run(outputs)
    document = json.loads((outputs / "reports/studies/feasibility.json").read_text())
    times = json.loads((outputs / "reports/studies/feasibility_timing.json").read_text())
    sequences = pd.read_parquet(outputs / "data/sequences/test.parquet")
    assert document["classifier"]["n"] == len(sequences)
    confusion = np.array(document["classifier"]["confusion"])
    assert confusion.sum(axis=1).tolist() == [
        (~sequences["feasible"]).sum(),
        sequences["feasible"].sum(),
    ]
    scene = load_scenes(outputs / "data/scenes/test.json").scenes[0]
    for policy, searches in document["search"].items():
        for search, runs in searches.items():
            for classified, figures in runs.items():
                assert figures["n"] == len(evaluate.problems(scene))
                assert sum(figures[name] for name in OUTCOMES) == pytest.approx(1)
                assert figures["coarse_calls"] > figures["infeasible_calls"] >= 0
                time = times[policy][search][classified]
                assert time["coarse_s"] == 0.5 * figures["coarse_calls"]
                assert time["infeasible_s"] == 0.5 * figures["infeasible_calls"]

    tables = feasibility_tables(outputs)
    assert verdict(times) in tables["feasibility"].markdown()
    calls = document["search"]["paper"]["best_first"]["with"]["coarse_calls"]
    assert ("paper", "best-first", "with", str(calls)) in {
        (*row[:3], row[5]) for row in tables["feasibility"].rows
    }
    assert sum(int(row[1]) for row in tables["feasibility_reliability"].rows) == len(sequences)


def test_verdicts_are_those_of_the_table(outputs: Path) -> None:
    own = verdicts(outputs, "training")
    table = pd.read_parquet(outputs / "data/sequences/training.parquet")
    assert own.feasible.sum() == table["feasible"].sum()
    assert np.unique(own.configuration).tolist() == [0, 1]
    places = own.inputs[own.inputs[:, 0] == 0]
    assert len(places) == table["skeleton"].str.count("place").sum()


def test_sequences_of_other_scenes_are_refused(outputs: Path) -> None:
    scenes = load_scenes(outputs / "data/scenes/test.json").scenes
    path = outputs / "data/sequences/training.parquet"
    with pytest.raises(InputError, match=f"lacks sequences of {scenes[0].name}, "):
        feasibility.read_verdicts(scenes, path)


def test_a_complete_search_stays_complete(outputs: Path) -> None:
    """Without a plan to find, everything feasible is visited, with the classifier as without."""
    classifier = train_classifier(verdicts(outputs, "training"), NETWORK, 0.5, 20, 0)
    scene = load_scenes(outputs / "data/scenes/test.json").scenes[0]
    limits = SearchLimits(
        max_depth=3, reattempts=0, max_tree_size=1000, max_paths=1, max_sequences=1000
    )
    bounds = evaluate.CoarseBounds(scene, load_params(outputs / "params.yaml").bounds)
    trees = []
    for policy in (Uniform(), FeasibilityAware(Uniform(), classifier)):
        found = best_first.plan(
            Problem(scene, parse_objective(["(on red blue)"]), limits, bounds, policy)
        )
        assert found.reason == "exhausted"
        trees.append((found.tree_size, found.coarse_calls, found.expansions))
    assert trees[0] == trees[1]


@pytest.mark.parametrize(
    ("policy_s", "words"),
    [
        ((0.5, 0.5), "does not pay"),
        ((0.1, 0.5), "pays for 1 of 2 policies (one)"),
        ((0.1, 0.1), "pays for every policy"),
    ],
)
def test_the_verdict_counts_all_that_takes_time(policy_s: tuple[float, float], words: str) -> None:
    """The classifier saves 0.2 s of coarse NLPs here, and costs what it costs."""
    without = {"coarse_s": 2.0, "infeasible_s": 0.5, "policy_s": 0.0}
    times = {
        name: {
            "best_first": {
                "without": without,
                "with": {"coarse_s": 1.8, "infeasible_s": 0.3, "policy_s": spent},
            }
        }
        for name, spent in zip(("one", "two"), policy_s, strict=True)
    }
    sentence = verdict(times)
    assert f"The classifier {words}:" in sentence
    assert f"{100 * (policy_s[0] - 0.2) / 2:+.1f} % (one)" in sentence
    assert "take 25.0 % (one), 25.0 % (two)" in sentence
