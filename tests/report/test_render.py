import json
import re
import shutil
from pathlib import Path

import outputs
import pandas as pd
import pytest

from guided_lgp.documents import write_json
from guided_lgp.errors import InputError
from guided_lgp.params import Params
from guided_lgp.paths import METRICS
from guided_lgp.report import render
from guided_lgp.report.readme import readme_block

FIGURES = {"scalability", "success", "learning_curves", "confusion", "feasible_share", "failures"}


def test_everything_is_written(rendered: Path) -> None:
    reports = rendered / "reports"
    figures = {path.name for path in (reports / "figures").iterdir()}
    pictures = {f"setup_{setup}.png" for setup in "abcd"}
    assert figures == {f"{n}.{s}" for n in FIGURES for s in ("png", "svg")} | pictures
    tables = {path.name for path in (reports / "tables").iterdir()}
    names = {"table_1", "training", "enumeration", "table_3_details"}
    names |= {"table_3_tree_size", "table_3_time"}
    assert tables == {f"{n}.{s}" for n in names for s in ("md", "tex", "csv")}
    assert {path.name for path in (reports / "replays").iterdir()} == {
        f"{setup}.html" for setup in "abcd"
    }


def test_table_1_stands_beside_the_papers(rendered: Path) -> None:
    text = (rendered / "reports/report.md").read_text(encoding="utf-8")
    row = next(line for line in text.splitlines() if line.startswith("| Shortest solution"))
    cells = [cell.strip() for cell in row.strip("|").split("|")][1:]
    assert cells == [
        *("91.9%", "90.0%", "90.3%", "90.0%"),
        *("98.5%", "95.0%", "98.2%", "95.0%"),
        *("99.0%", "99.0%"),
    ]
    counts = next(line for line in text.splitlines() if line.startswith("| Problems n"))
    assert counts.split("|")[2:6] == [" 1740 ", " 170 ", " 940 ", " 90 "]


def test_a_stopped_planner_has_no_number(rendered: Path) -> None:
    text = (rendered / "reports/tables/table_3_tree_size.md").read_text(encoding="utf-8")
    row = next(line for line in text.splitlines() if line.startswith("| c.2"))
    assert row.split("|")[5:7] == [" – ", " – (1/12) "]
    assert "stopped at the limit" in text
    for path in (rendered / "reports").rglob("table_3*"):
        assert "12345" not in path.read_text(encoding="utf-8").replace(",", "")
    for name in ("report.md", "report.html"):
        assert "12345" not in (rendered / "reports" / name).read_text(encoding="utf-8")
    tidy = pd.read_csv(rendered / "reports/tables/table_3_tree_size.csv")
    ours = tidy[(tidy["source"] == "ours") & (tidy["planner"] == "breadth_first")]
    assert ours.set_index("problem")["mean"].isna().sum() == 3


def test_the_page_needs_no_other_file_but_replays(rendered: Path) -> None:
    page = (rendered / "reports/report.html").read_text(encoding="utf-8")
    addresses = re.findall(r'(?:src|href)="([^"]*)"', page)
    outside = [a for a in addresses if not a.startswith(("data:", "#"))]
    assert outside == [f"replays/{setup}.html" for setup in "abcd"]
    for address in outside:
        assert (rendered / "reports" / address).is_file()
    anchors = [a[1:] for a in addresses if a.startswith("#")]
    assert all(f'id="{anchor}"' in page for anchor in anchors)
    assert "@import" not in page
    assert "url(" not in page


def test_training_metrics(rendered: Path) -> None:
    metrics = json.loads((rendered / METRICS / "training.json").read_text(encoding="utf-8"))
    assert {network: list(chain) for network, chain in metrics.items()} == {
        "instruction": ["instruction"],
        "grasp": ["gripper", "box"],
        "place": ["gripper", "box", "table"],
    }
    table = metrics["place"]["table"]
    assert table["epochs"] == 60
    assert 0 < table["accuracy"] < 1
    assert {"accuracy", "loss", "epochs"} <= table["by_configuration"].keys()


def test_readme_block_holds_the_tables(rendered: Path, tmp_path: Path) -> None:
    block = readme_block(rendered)
    assert block.count("**Table I") == 3
    assert "| d.2 | 10 |" in block
    with pytest.raises(InputError, match="render_reports"):
        readme_block(tmp_path)


def test_rendering_again_gives_the_same_bytes_and_geometry_is_optional(
    rendered: Path, tmp_path: Path, params: Params, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(render, "SceneBounds", outputs.Bounds)
    root = tmp_path / "again"
    shutil.copytree(rendered, root)
    (root / "reports/figures/old.png").touch()
    write_json(root / METRICS / "geometry.json", outputs.geometry())
    render.run(params, root)
    before = {
        path.relative_to(rendered): path.read_bytes()
        for path in (rendered / "reports").rglob("*")
        if path.is_file() and path.parent.name != "reports"
    }
    after = {
        path.relative_to(root): path.read_bytes()
        for path in (root / "reports").rglob("*")
        if path.is_file() and path.parent.name != "reports"
    }
    new = {str(path) for path in after.keys() - before.keys()}
    assert new == {"reports/metrics/geometry.json"} | {
        f"reports/tables/geometry.{suffix}" for suffix in ("md", "tex", "csv")
    }
    assert all(after[path] == content for path, content in before.items())
    page = (root / "reports/report.html").read_text(encoding="utf-8")
    assert "The two bounds of the NLP on random sequences" in page


@pytest.mark.parametrize(
    ("missing", "stage"),
    [
        ("reports/metrics/generalization.json", "evaluate_generalization"),
        ("reports/metrics/scalability_timing.json", "compare_scalability"),
        ("reports/training/place.json", "train_policy@place"),
        ("data/sequences/test.parquet", "enumerate_sequences"),
        ("data/evaluation/generalization.parquet", "evaluate_generalization"),
        ("data/scenes/scalability_b.json", "generate_scenes"),
    ],
)
def test_a_missing_input_names_its_stage(
    rendered: Path, tmp_path: Path, params: Params, missing: str, stage: str
) -> None:
    root = tmp_path / "root"
    shutil.copytree(rendered / "data", root / "data")
    for part in ("metrics", "training"):
        shutil.copytree(rendered / "reports" / part, root / "reports" / part)
    (root / missing).unlink()
    with pytest.raises(InputError, match=stage) as error:
        render.run(params, root)
    assert Path(missing).name in str(error.value)
    assert "\n" not in str(error.value)
    assert not (root / "reports/report.html").exists()
