"""The native plots of DVC: learning curves of two experiments over each other."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

ROOT = Path(__file__).parents[2]


def run(folder: Path, *command: str) -> str:
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {name: value for name, value in os.environ.items() if name[:4] != "DVC_"}
    done = subprocess.run(
        command,
        cwd=folder,
        env=environment | {"PATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def values(plots: dict[str, Any], name: str) -> list[dict[str, Any]]:
    """The points of a plot, as Vega draws them."""
    (plot,) = plots["data"][name]
    points: list[dict[str, Any]] = plot["content"]["data"]["values"]
    return points


def test_every_figure_is_a_plot_once(rendered: Path) -> None:
    figures = {path.stem for path in (rendered / "reports/figures").glob("*.svg")}
    plots = yaml.safe_load((ROOT / "dvc.yaml").read_text(encoding="utf-8"))["plots"]
    files = [plot for plot in plots if isinstance(plot, str)]
    assert sorted(files) == sorted(f"reports/figures/{name}.png" for name in figures)


def test_learning_curves_of_two_revisions_are_drawn_over_each_other(
    rendered: Path, tmp_path: Path
) -> None:
    for part in ("curves", "figures"):
        shutil.copytree(rendered / "reports" / part, tmp_path / "reports" / part)
    plots = yaml.safe_load((ROOT / "dvc.yaml").read_text(encoding="utf-8"))["plots"]
    (tmp_path / "dvc.yaml").write_text(yaml.safe_dump({"plots": plots}), encoding="utf-8")
    run(tmp_path, "git", "init", "-q")
    run(tmp_path, "dvc", "init", "-q")
    run(tmp_path, "git", "add", "-A")
    identity = ("-c", "user.name=test", "-c", "user.email=test@localhost")
    run(tmp_path, "git", *identity, "commit", "-qm", "first")

    shown = json.loads(run(tmp_path, "dvc", "plots", "show", "--json"))
    assert not shown.get("errors")
    files = {path.name for path in (tmp_path / "reports/curves").iterdir()}
    assert {Path(name).name for name in shown["data"]} >= files | {"tree_size.png"}

    curve = tmp_path / "reports/curves/paper_place_table.csv"
    changed = pd.read_csv(curve)
    changed["validation_loss"] /= 2
    changed.to_csv(curve, index=False)
    diff = json.loads(run(tmp_path, "dvc", "plots", "diff", "HEAD", "--json"))
    points = values(diff, "reports/curves/paper_place_table.csv")
    lines = {(point["rev"], point["field"]) for point in points}
    fields = ("training_loss", "validation_loss")
    assert lines == {(rev, field) for rev in ("HEAD", "workspace") for field in fields}
    assert {point["epoch"] for point in points} == set(map(str, range(1, 61)))
