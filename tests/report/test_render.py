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
from guided_lgp.report.findings import many, tree
from guided_lgp.report.pages import BEGIN, END, write_pages
from guided_lgp.report.scalability_tables import winners

FIGURES = {"solved", "tree_size", "time", "success", "confusion", "feasible_share", "failures"}
SETUPS = ("a", "b", "c", "d", "e6", "e8", "e10")
REPLAYS = ("a", "b", "c", "d", "e10")


def test_everything_is_written(rendered: Path) -> None:
    reports = rendered / "reports"
    figures = {path.name for path in (reports / "figures").iterdir()}
    pictures = {f"setup_{setup}.png" for setup in SETUPS}
    assert figures == {f"{n}.{s}" for n in FIGURES for s in ("png", "svg")} | pictures
    tables = {path.name for path in (reports / "tables").iterdir()}
    names = {"table_1", "unseen", "training", "enumeration", "table_3_details"}
    names |= {"table_3_tree_size", "table_3_time", "winners"}
    files = {f"{n}.{s}" for n in names for s in ("md", "tex", "csv")}
    assert tables == files
    assert {path.name for path in (reports / "replays").iterdir()} == {
        f"{setup}.html" for setup in REPLAYS
    }


def rows_of(table: Path) -> list[list[str]]:
    """Cells of the rows of a Markdown table, headings left out."""
    lines = [line for line in table.read_text(encoding="utf-8").splitlines() if line[:1] == "|"]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


def test_table_1_stands_beside_the_papers(rendered: Path) -> None:
    rows = rows_of(rendered / "reports/tables/table_1.md")
    shown = {tuple(row[:3]): row[3:5] + row[-2:] for row in rows}
    assert len(rows) == len(shown) == 11
    assert shown["Paper's networks", "default", "paper"] == ["91.9%", "90.3%", "1740", "940"]
    assert shown["Paper's networks", "default", "ours"] == ["90.0%", "90.0%", "170", "90"]
    assert shown["Improved networks", "best-first", "ours"][:2] == ["99.0%", "99.0%"]
    assert shown["Relational policy", "best-first", "ours"][:2] == ["100.0%", "100.0%"]
    assert {tuple(row[-6:-2]) for row in rows} == {
        ("–", "–", "–", "–"),
        ("1.50", "5.00", "1.00", "0.00"),
    }


def test_calls_to_a_plan_stand_in_the_details(rendered: Path) -> None:
    frame = pd.read_csv(rendered / "reports/tables/table_3_details.csv")
    guided = frame[frame["planner"] == "guided"]
    assert set(guided["infeasible_calls_mean"]) == {2.5}
    assert set(guided["failed_candidates_mean"]) == {0.5}
    heading = (rendered / "reports/tables/table_3_details.md").read_text(encoding="utf-8")
    assert "| Coarse calls | Infeasible | Failed candidates | Path calls |" in heading


def test_unseen_objectives_are_told_apart(rendered: Path) -> None:
    text = (rendered / "reports/report.md").read_text(encoding="utf-8")
    assert "Of the 47 unseen objectives, 29 (61.7%)" in text
    frame = pd.read_csv(rendered / "reports/tables/unseen.csv")
    assert set(frame["kind"]) == {"seen", "renamed", "new"}
    assert frame.groupby("planner")["n"].sum().eq(174).all()


def test_a_stopped_planner_has_no_number(rendered: Path) -> None:
    path = rendered / "reports/tables/table_3_tree_size.md"
    text = path.read_text(encoding="utf-8")
    rows = {tuple(row[:2]): row[2:] for row in rows_of(path)}
    assert rows["Breadth-first", "paper"][4:] == ["–", "–", "–", "", "", ""]
    assert rows["Breadth-first", "ours"][3:5] == ["216,000 ± 21,600", "– (1/12)"]
    assert rows["Problems n", "paper"] == ["9", "8", "6", "6", "6", "6", "6", "", "", ""]
    assert "stopped at the limit" in text
    for path in (rendered / "reports").rglob("table_3*"):
        assert "12345" not in path.read_text(encoding="utf-8").replace(",", "")
    for name in ("report.md", "report.html"):
        assert "12345" not in (rendered / "reports" / name).read_text(encoding="utf-8")
    tidy = pd.read_csv(rendered / "reports/tables/table_3_tree_size.csv")
    ours = tidy[(tidy["source"] == "ours") & (tidy["planner"] == "breadth_first")]
    assert ours.set_index("problem")["mean"].isna().sum() == 6


def test_the_page_opens_with_the_question_and_the_answer(rendered: Path) -> None:
    text = (rendered / "reports/report.md").read_text(encoding="utf-8")
    first, _, rest = text.partition("## Generalization")
    assert "## Question and answer" in first
    assert "95.0% / 95.0% of the problems" in first
    assert "Relational 36" in first
    assert rest.count("![") == len(FIGURES) + len(SETUPS)


def test_a_small_profile_has_answers_too() -> None:
    assert tree({"a.1": {"guided": {}}}, {}) == "Breadth-first finishes no problem."
    assert many({"a.1": {}}) == "No problem of more than 5 boxes was tried."


def test_what_holds_nearly_everywhere_is_a_sentence(rendered: Path) -> None:
    text = (rendered / "reports/report.md").read_text(encoding="utf-8")
    assert re.search(
        r"In our \d other rows of Table I, at least (99|100)\.\d% of the problems", text
    )
    assert "Not drawn, right in" not in text  # every sub-policy of the made-up figures errs


def test_curves_have_a_file_per_sub_policy(rendered: Path) -> None:
    folder = rendered / "reports/curves"
    names = {path.stem for path in folder.iterdir()}
    assert len(names) == 13
    assert {"paper_instruction", "improved_place_table", "relational_relational_action"} <= names
    curves = pd.read_csv(folder / "paper_place_table.csv")
    assert curves["epoch"].tolist() == list(range(1, 61))
    assert {"training_loss", "validation_loss"} <= set(curves.columns)


def test_the_page_needs_no_other_file_but_replays(rendered: Path) -> None:
    page = (rendered / "reports/report.html").read_text(encoding="utf-8")
    addresses = re.findall(r'(?:src|href)="([^"]*)"', page)
    outside = [a for a in addresses if not a.startswith(("data:", "#"))]
    assert outside == [f"replays/{setup}.html" for setup in REPLAYS]
    for address in outside:
        assert (rendered / "reports" / address).is_file()
    anchors = [a[1:] for a in addresses if a.startswith("#")]
    assert all(f'id="{anchor}"' in page for anchor in anchors)
    assert "@import" not in page
    assert "url(" not in page


def test_training_metrics(rendered: Path) -> None:
    metrics = json.loads((rendered / METRICS / "training.json").read_text(encoding="utf-8"))
    improved, relational = metrics.pop("improved"), metrics.pop("relational")
    chains = {
        "instruction": ["instruction"],
        "grasp": ["gripper", "box"],
        "place": ["gripper", "box", "table"],
    }
    for networks in (metrics, improved):
        assert {network: list(chain) for network, chain in networks.items()} == chains
    assert list(relational["relational"]) == ["action"]
    table = metrics["place"]["table"]
    assert table["epochs"] == 60
    assert 0 < table["accuracy"] < 1
    assert {"accuracy", "loss", "epochs"} <= table["by_configuration"].keys()


def test_the_summary_is_short_and_without_times(rendered: Path) -> None:
    figures = json.loads((rendered / METRICS / "summary.json").read_text(encoding="utf-8"))
    assert sum(map(len, figures.values())) <= 15
    assert figures["shortest"] == {"default": 0.9, "adaptation": 0.95, "relational": 0.995}
    assert list(figures["accuracy"]) == ["instruction", "grasp", "place", "relational"]
    assert figures["solved"] == {"guided": 1.0, "relational": 1.0}
    assert figures["coarse_calls"] == pytest.approx({"guided": 1.1, "relational": 1.1})
    assert not any(name.endswith("_s") for group in figures.values() for name in group)


def test_pages_hold_the_tables_and_the_findings(rendered: Path, tmp_path: Path) -> None:
    shutil.copytree(rendered, tmp_path / "clone")
    readme = tmp_path / "clone/README.md"
    readme.write_text(f"# Title\n\n{BEGIN}\nold\n{END}\n\nThe rest.\n")
    for _ in range(2):
        write_pages(tmp_path / "clone")
    text = readme.read_text()
    assert text.startswith(f"# Title\n\n{BEGIN}\n\n**1. ")
    assert text.endswith(f"\n{END}\n\nThe rest.\n")
    assert "old" not in text
    assert (tmp_path / "clone/docs/images/solved.png").is_file()
    results = (tmp_path / "clone/docs/results.md").read_text()
    assert results.count("## Table I") >= 3
    assert "K = 20: e.10" in results
    assert "crowded rows" not in text
    about_cases = tmp_path / "clone/docs/cases.md"
    about_cases.write_text(f"# Cases\n\n{BEGIN}\nold\n{END}\n")
    write_json(tmp_path / "clone/reports/cases.json", outputs.cases())
    write_json(tmp_path / "clone/reports/cases_compared.json", outputs.cases_compared())
    write_pages(tmp_path / "clone")
    assert "needs 6.5, 6.5 calls" in readme.read_text()
    assert "| Relational | 60 of 60, 6.5 | 60 of 60, 6.5 |" in about_cases.read_text()
    assert "0.35 (0.30 to 0.40, A\\*, facts)" in about_cases.read_text()
    assert "4 boxes: 4 and 10 of 20" in about_cases.read_text()
    readme.write_text("# Title\n")
    with pytest.raises(InputError, match="markers"):
        write_pages(tmp_path / "clone")
    with pytest.raises(InputError, match="compare_scalability"):
        write_pages(tmp_path)


def test_who_wins_is_who_is_first_of_those_that_solve_all() -> None:
    def cell(nodes: float, solved: int = 2) -> dict[str, float]:
        return {"problems": 2, "problems_solved": solved, "tree_size_mean": nodes}

    def times(seconds: float) -> dict[str, float]:
        return {"symbolic_s": seconds, "policy_s": 0.0, "coarse_s": 0.0, "path_s": 9.0}

    table = winners(
        {"a.1": {"astar": cell(10), "guided": cell(12), "relational": cell(5, solved=1)}},
        {"a.1": {"astar": times(0.2), "guided": times(0.2), "relational": times(0.1)}},
    )
    (row,) = table.rows
    assert row == ("a.1", "4", "2 of 3", "A*: 10.0", "A*; Guided: 0.20")


def test_rendering_again_gives_the_same_bytes_and_other_figures_are_optional(
    rendered: Path, tmp_path: Path, params: Params, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(render, "SceneBounds", outputs.Bounds)
    root = tmp_path / "again"
    shutil.copytree(rendered, root)
    (root / "reports/figures/old.png").touch()
    write_json(root / METRICS / "geometry.json", outputs.geometry())
    write_json(root / "reports/studies/spread.json", outputs.spread())
    write_json(root / "reports/cases.json", outputs.cases())
    write_json(root / "reports/cases_compared.json", outputs.cases_compared())
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
    assert new == {"reports/metrics/geometry.json", "reports/studies/spread.json"} | {
        f"reports/tables/{name}.{suffix}"
        for name in ("geometry", "draws", "case_rows", "cases_compared")
        for suffix in ("md", "tex", "csv")
    } | {"reports/figures/cases.png", "reports/figures/cases.svg"}
    assert all(after[path] == content for path, content in before.items())
    page = (root / "reports/report.html").read_text(encoding="utf-8")
    assert "The two bounds of the NLP on random sequences" in page
    assert "half the calls of the best search without one at every size." in page
    assert "needs 6.5, 6.5 calls of the coarse bound" in page
    (rival, *_) = rows_of(root / "reports/tables/cases_compared.md")
    assert rival[3:6] == ["18.5", "A\\*, facts", "0.35 (0.30 to 0.40)"]
    assert "learning is a convenience there, not a necessity" in page
    assert '<a href="../docs/studies.md">' in page
    rows = {row[0]: row[1:] for row in rows_of(root / "reports/tables/draws.md")}
    assert rows["Paper's networks"] == ["92.0% ± 2.0%"] * 6 + ["3"]
    assert rows["Relational policy"] == ["–"] * 2 + ["92.0% ± 2.0%"] * 2 + ["–"] * 2 + ["3"]


@pytest.mark.parametrize(
    ("missing", "stage"),
    [
        ("reports/metrics/generalization.json", "evaluate_generalization"),
        ("reports/metrics/scalability_timing.json", "compare_scalability"),
        ("reports/training/place.json", "train_policy@place"),
        ("reports/training/improved/place.json", "train_improved@place"),
        ("reports/training/relational.json", "train_relational"),
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
