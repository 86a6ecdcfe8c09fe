"""All that writes files, each with an older and a newer version of its content."""

import os
from collections.abc import Callable
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pyarrow as pa
from matplotlib.figure import Figure

from guided_lgp import cache, compiled
from guided_lgp.bounds.plan_file import Plan, read_plan
from guided_lgp.documents import copy_whole, made_whole, write_json, write_text, written_whole
from guided_lgp.export import export_plan
from guided_lgp.policy.tensors import write_tensors
from guided_lgp.report.drawing import save
from guided_lgp.scene import generate
from guided_lgp.tables import write_table
from guided_lgp.view.replay import replay_html
from hostility.examples import ROOT, Examples, write_shard_in
from hostility.kills import Writer

PARAMS = ROOT / "tests" / "params.yaml"


def writers(examples: Examples) -> tuple[Writer, ...]:
    """All of them."""
    plan = read_plan(examples.scenes / "plan.json")
    weights = examples.models / "improved", examples.models
    return (
        Writer("JSON", lambda at, n: write_json(at / "a.json", {"numbers": [n] * 1000})),
        Writer("text", lambda at, n: write_text(at / "deep" / "a.txt", f"{n}" * 5000)),
        Writer("table", lambda at, n: write_table(at / "a.parquet", pa.table({"a": [n] * 1000}))),
        Writer("tensors", lambda at, n: write_tensors(at / "a", {"a": np.full(1000, n)})),
        Writer("file", _written),
        Writer("scenes", lambda at, n: generate("a", 2, n, "x").save(at / "a.json")),
        Writer("figure", lambda at, n: save(_figure(n), at, "figure")),
        Writer("CSV", lambda at, n: export_plan(plan, at / "plan.csv", 1.0 - n / 2)),
        Writer("messages", lambda at, n: export_plan(plan, at / "plan.json", 1.0 - n / 2)),
        Writer("replay", lambda at, n: replay_html(plan.trajectory, plan.scene, at / "a.html")),
        Writer("cached file", _in_cache(lambda n: cache.kept("a", b"%d" % n * 5000))),
        Writer("cache", _in_cache(lambda n: cache.made(f"a{n}", lambda _: b"%d" % n * 5000))),
        Writer("compiled", _in_cache(_compiled)),
        Writer("folder", _folder),
        Writer("shard", write_shard_in),
        Writer("bag", lambda at, n: _bag(plan, at / f"bag{n}")),
        Writer("weights", lambda at, n: copy_whole(weights[n], at / "models")),
    )


def _written(at: Path, n: int) -> None:
    with written_whole(at / "a") as unfinished:
        unfinished.write_bytes(b"%d" % n * 5000)


def _figure(n: int) -> Figure:
    figure = Figure(figsize=(1, 1))
    figure.subplots().plot([0, n])
    return figure


def _in_cache(work: Callable[[int], object]) -> Callable[[Path, int], object]:
    def at_folder(at: Path, n: int) -> None:
        with patch.dict(os.environ, XDG_CACHE_HOME=str(at)):
            work(n)

    return at_folder


def _compiled(n: int) -> None:
    library = compiled.load_compiled("number", f"int number(void) {{ return {n + 7}; }}")
    assert library is None or library.number() == n + 7  # None: no compiler can work


def _bag(plan: Plan, folder: Path) -> None:
    if not folder.exists():
        export_plan(plan, folder)


def _folder(at: Path, n: int) -> None:
    if not (at / f"folder{n}").exists():
        with made_whole(at / f"folder{n}") as folder:
            folder.mkdir()
            for name in "ab":
                (folder / name).write_bytes(b"content" * 1000)
