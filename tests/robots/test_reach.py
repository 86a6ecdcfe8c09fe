"""The figures on reach (``make reach``): what they have to be, and a few of them again."""

import json
from importlib import import_module
from itertools import islice
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from guided_lgp.logic import format_skeleton

ROOT = Path(__file__).parents[2]
FIGURES: dict[str, Any] = json.loads((ROOT / "reports" / "metrics" / "reach.json").read_text())
LEAST = {"panda_2": 0.95, "panda_4": 0.95, "ur5_2": 0.9, "baxter_2": 0.9, "handover": 0.9}
"""Share of coarse-feasible sequences with a verified path, and of those executed that hold."""
AGAIN = ("panda_4", "ur5_2", "handover")


@pytest.fixture
def robots(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The benchmark."""
    monkeypatch.syspath_prepend(str(ROOT / "benchmarks"))
    return import_module("robots")


def test_every_part_is_measured(robots: ModuleType) -> None:
    assert set(FIGURES) == set(robots.PARTS) == set(LEAST)


@pytest.mark.parametrize("name", LEAST)
def test_nearly_all_that_is_coarse_feasible_is_carried_out(name: str, robots: ModuleType) -> None:
    figures = FIGURES[name]
    assert figures["coarse_feasible"] == len(figures["rows"]) == robots.PARTS[name].wanted
    assert figures["verified"] >= LEAST[name] * figures["coarse_feasible"]
    assert figures["goals_hold"] >= LEAST[name] * figures["verified"]


@pytest.mark.parametrize("name", AGAIN)
def test_the_first_rows_come_out_again(name: str, robots: ModuleType) -> None:
    feasible = (
        (bounds, skeleton)
        for bounds, skeleton in robots.PARTS[name].sequences()
        if bounds.coarse(skeleton).feasible
    )
    for row, (bounds, skeleton) in zip(FIGURES[name]["rows"][:2], islice(feasible, 2), strict=True):
        again = bounds.scene.name, format_skeleton(skeleton), robots.outcome(bounds, skeleton)
        assert list(again) == row
