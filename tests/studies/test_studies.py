"""The studies at a tiny scale, and their declaration."""

import json
import shutil
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pytest
import yaml

from guided_lgp.errors import InputError
from guided_lgp.experiments.enumerate_sequences import shortest_table, verdict_table
from guided_lgp.logic import one_goal_objectives, satisfied, two_goal_objectives
from guided_lgp.params import SampleRecipe, load_params
from guided_lgp.scene import generate
from guided_lgp.search.enumerate import enumerate_sequences
from guided_lgp.studies import evaluate, feasibility, train
from guided_lgp.studies.cases import OUTCOMES, load_study
from guided_lgp.studies.tables import render
from guided_lgp.tables import write_table
from stand_ins import NothingOnBlue

ROOT = Path(__file__).parents[2]
NETWORK = {
    "layers": 1,
    "nodes": 16,
    "dropout": 0.1,
    "l2": 1e-4,
    "epochs": 2,
    "batch": 512,
    "lr": 1e-2,
}
NETWORKS = {
    "seed": 0,
    "validation_share": 0.5,
    "patience": 5,
    **dict.fromkeys(("instruction", "grasp", "place"), NETWORK),
}
RELATIONAL = {
    "seed": 0,
    "validation_share": 0.5,
    "patience": 5,
    "width": 4,
    "rounds": 1,
    "l2": 0.0,
    "epochs": 1,
    "batch": 512,
    "lr": 1e-2,
}
SMALL = {"title": "title", "policy": "paper", "configurations": 2}
STUDY: dict[str, Any] = {
    "seeds": [4, 11],
    "limits": {
        "max_depth": 3,
        "reattempts": 0,
        "max_tree_size": 40,
        "max_paths": 2,
        "max_sequences": 1000,
    },
    "cases": {
        "paper": SMALL,
        "relational": {**SMALL, "policy": "relational", "objectives": 10},
        "shuffled": {
            **SMALL,
            "shuffled": True,
            "split": "configuration",
            "patience": 1,
            "dropout": 0.0,
        },
    },
    "tables": {
        "spread": {"title": "Spread", "cases": ["paper", "relational"]},
        "floor": {"title": "Floor", "cases": ["paper", "shuffled"]},
    },
    "feasibility": {"seed": 0, "validation_share": 0.5, "patience": 5, "network": NETWORK},
}


def write(root: Path, study: dict[str, Any]) -> None:
    (root / "studies").mkdir(exist_ok=True)
    (root / "studies/params.yaml").write_text(yaml.safe_dump(study, sort_keys=False))


@pytest.fixture
def root(tmp_path: Path) -> Path:
    """A folder with parameters."""
    pipeline = yaml.safe_load((ROOT / "params.yaml").read_text())
    pipeline["parallel"]["workers"] = 1
    pipeline |= {"train_policy": NETWORKS, "train_relational": RELATIONAL}
    (tmp_path / "params.yaml").write_text(yaml.safe_dump(pipeline))
    write(tmp_path, STUDY)
    return tmp_path


def enumerate_all(root: Path, split: str, count: int) -> None:
    """Scenes and sequences as the pipeline writes them, of up to two actions."""
    generated = generate("a", count, 1, split)
    generated.save(root / f"data/scenes/{split}.json")
    tables: tuple[list[pa.Table], list[pa.Table]] = ([], [])
    for scene in generated.scenes:
        objectives = one_goal_objectives(scene.symbols) + two_goal_objectives(scene.symbols)
        bounds = NothingOnBlue(scene, load_params(root / "params.yaml").bounds)
        found = enumerate_sequences(scene.state, scene.symbols, objectives, bounds, 2, 0)
        tables[0].append(verdict_table(scene, found))
        tables[1].append(shortest_table(scene, found))
    for suffix, parts in zip(("", "_shortest"), tables, strict=True):
        write_table(root / f"data/sequences/{split}{suffix}.parquet", pa.concat_tables(parts))


def copy_models(root: Path) -> None:
    """The trained networks; the paper's ones stand for the improved ones."""
    for folder in ("models", "models/improved"):
        shutil.copytree(ROOT / "models", root / folder, dirs_exist_ok=True)


def test_train_evaluate_render(root: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evaluate, "SceneBounds", NothingOnBlue)
    enumerate_all(root, "training", 2)
    enumerate_all(root, "test", 1)
    for case in STUDY["cases"]:
        train.train(root, case)
    dropouts = {
        case: json.loads((root / f"data/studies/{case}/11/grasp.json").read_text())["training"][
            "dropout"
        ]
        for case in ("paper", "shuffled")
    }
    assert dropouts == {"paper": 0.1, "shuffled": 0.0}
    for table in STUDY["tables"]:
        evaluate.evaluate(root, table)
    spread = json.loads((root / "reports/studies/spread.json").read_text())
    assert list(spread) == ["paper", "relational"]
    for planners in spread.values():
        assert list(planners) == ["default", "adaptation", "best_first"]
        for figures in planners.values():
            for values in figures.values():
                assert len(values["n"]) == len(STUDY["seeds"])
                outcomes = [values[name] for name in OUTCOMES]
                assert [sum(run) for run in zip(*outcomes, strict=True)] == pytest.approx(
                    [1.0] * len(values["n"])
                )
    scene = generate("a", 1, 1, "test").scenes[0]
    objectives = one_goal_objectives(scene.symbols) + two_goal_objectives(scene.symbols)
    problems = sum(not satisfied(scene.state, goals) for goals in objectives)
    assert spread["paper"]["default"]["all"]["n"] == [problems] * 2
    assert spread["paper"]["default"]["unseen"]["n"][0] < problems
    floor = json.loads((root / "reports/studies/floor.json").read_text())
    assert floor["paper"] == spread["paper"]
    assert list(floor) == ["paper", "shuffled"]

    copy_models(root)
    feasibility.run(root)
    render(root)
    page = (root / "reports/studies/studies.md").read_text()
    assert "**Spread**" in page
    assert "**Floor**" in page
    assert "**A feasibility classifier: what it saves**" in page
    table = pd.read_csv(root / "reports/studies/tables/spread.csv")
    row = table.query(
        "case == 'paper' and planner == 'adaptation' and objectives == 'all' "
        "and figure == 'shortest'"
    ).iloc[0]
    values = spread["paper"]["adaptation"]["all"]["shortest"]
    assert row["mean"] == pytest.approx(sum(values) / 2)
    assert row["runs"] == 2
    assert f"{100 * row['mean']:.1f} ± {100 * row['std']:.1f}" in page
    assert (root / "reports/studies/tables/floor.tex").is_file()


def with_case(**changes: Any) -> dict[str, Any]:
    """The cases, and one more."""
    return {"cases": STUDY["cases"] | {"more": SMALL | changes}}


@pytest.mark.parametrize(
    ("change", "fault"),
    [
        ({"tables": {"x": {"title": "x", "cases": ["none"]}}}, "tables.x.cases: unknown case"),
        ({"seeds": []}, "seeds: .*fewer than 1"),
        ({"cases": {"a": {"policy": "paper"}}}, "cases.a.title: missing"),
        ({"cases": {"a": {**SMALL, "of": 1}}}, "cases.a.of: unknown key .*policy"),
        (with_case(configurations=53), "cases.more.configurations: is 53 .*1 to 52"),
        (
            with_case(policy="relational", dropout=0.1),
            "cases.more.dropout: is given .*none for the relational policy",
        ),
        ({"other": 1}, "other: unknown key .*seeds, limits"),
    ],
)
def test_bad_parameters(root: Path, change: dict[str, Any], fault: str) -> None:
    write(root, STUDY | change)
    with pytest.raises(InputError, match=fault):
        load_study(root)


def test_unknown_cases_are_refused(root: Path) -> None:
    with pytest.raises(InputError, match=r"case 'none': is unknown .*paper, relational"):
        train.train(root, "none")
    with pytest.raises(InputError, match=r"table 'none': is unknown .*spread"):
        evaluate.evaluate(root, "none")


def test_the_declared_studies() -> None:
    """The cases called paper and improved are the pipeline's; the outputs are those of dvc.yaml."""
    study, params = load_study(ROOT)
    pipeline = load_params(ROOT / "params.yaml")
    assert params == pipeline
    assert len(study.seeds) >= 3
    for name in ("paper", "improved", "relational"):
        case = study.cases[name]
        differing = case.model_dump(exclude_defaults=True, exclude={"title", "policy", "recipe"})
        assert not differing
    assert study.cases["paper"].recipe == study.cases["relational"].recipe == SampleRecipe()
    assert study.cases["improved"].recipe == pipeline.build_dataset.improved
    stages = yaml.safe_load((ROOT / "studies/dvc.yaml").read_text())["stages"]
    figures = {name for out in stages["feasibility"]["outs"] for name in out}
    assert figures == {f"reports/studies/feasibility{part}.json" for part in ("", "_timing")}
    assert figures < set(stages["render"]["deps"])
    assert {"spread", *stages["evaluate"]["foreach"]} == set(study.tables)
    inputs = {dep for dep in stages["spread"]["deps"] if dep.startswith("data/studies")}
    assert inputs == {f"data/studies/{case}" for case in study.tables["spread"].cases}
