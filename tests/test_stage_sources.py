"""A stage depends on what of the package it loads and reads, and on nothing else of it.

So on its case's domain, robot and terms: another domain or robot makes no stage stale.
"""

from pathlib import Path

import pytest

from stage_sources import (
    CASES,
    PACKAGE,
    PIPELINE,
    RUNS,
    Stage,
    dependencies,
    is_source,
    listed,
    run_all,
)

OTHERS = [
    PACKAGE / "bounds" / "terms" / "slide.py",
    PACKAGE / "domains" / "handover.py",
    PACKAGE / "domains" / "hook.py",
    PACKAGE / "policy" / "goals_first" / "__init__.py",
    PACKAGE / "robots" / "foo.yaml",
    PACKAGE / "robots" / "panda.yaml",
    PACKAGE / "scene" / "families" / "heaps.py",
    PACKAGE / "shipped" / "robots" / "panda_description" / "urdf" / "panda.urdf",
]
OWN = [
    PACKAGE / "bounds" / "terms" / "hold.py",
    PACKAGE / "domains" / "pick_and_place.py",
    PACKAGE / "robots" / "pr2.yaml",
    PACKAGE / "shipped" / "robots" / "pr2_description" / "urdf" / "pr2.urdf",
]


def stages_with(file: Path) -> set[Stage]:
    """The stages that a change of a file, or a new one, makes stale."""
    return {
        name
        for name in RUNS
        if any(file.is_relative_to(dependency) for dependency in dependencies(name))
    }


@pytest.mark.parametrize("file", OTHERS, ids=str)
def test_another_declaration_makes_no_stage_stale(file: Path) -> None:
    assert not stages_with(file)


@pytest.mark.parametrize("file", OWN, ids=str)
def test_the_cases_own_declarations_do(file: Path) -> None:
    paper = ("enumerate_sequences", "evaluate_generalization", "compare_scalability")
    cases = ("demonstrate", "evaluate_case", "replay_case")
    assert stages_with(file) >= {*((PIPELINE, name) for name in paper)}
    assert stages_with(file) >= {*((CASES, name) for name in cases)}


def test_every_stage_lists_what_it_loads_and_reads(tmp_path: Path) -> None:
    """Of all stages at a tiny scale; ``make sources`` writes the lists."""
    for stage, sources in run_all(tmp_path):
        declared = sorted(filter(is_source, dependencies(stage)))
        assert declared == listed(sources), f"{stage}: run make sources"
