"""The registry: every row runs, and a row that nobody can serve is refused by name."""

from dataclasses import replace

import pytest
from scripted import UNIFORM, ScriptedBounds

from guided_lgp.cases.policies import SIGHTS
from guided_lgp.errors import InputError
from guided_lgp.logic import parse_objective, progress, satisfied
from guided_lgp.params import SearchLimits
from guided_lgp.policy.registry import POLICIES
from guided_lgp.report.style import planner_style
from guided_lgp.scene.model import Scene
from guided_lgp.search import planners
from guided_lgp.search.planners import (
    CASE_PLANNERS,
    PLANNERS,
    SEARCHES,
    TABLE_1,
    TABLE_3,
    check_planners,
)
from guided_lgp.search.problem import Problem

OBJECTIVE = parse_objective(["(on red tab2)"])


@pytest.mark.parametrize("name", SEARCHES)
def test_every_search_plans(name: str, scene: Scene, limits: SearchLimits) -> None:
    problem = Problem(scene, OBJECTIVE, limits, ScriptedBounds(scene), UNIFORM)
    result = SEARCHES[name].plan(problem)
    assert result.skeleton is not None
    assert satisfied(progress(scene.state, result.skeleton), OBJECTIVE)


@pytest.mark.parametrize("name", PLANNERS)
def test_every_row_is_whole(name: str) -> None:
    planner = PLANNERS[name]
    assert planner.name == name
    assert SEARCHES[planner.search].follows_policy == bool(planner.policy)
    assert (planner.table_1 in TABLE_1) == bool(planner.table_1)
    if planner.table_3:
        assert planner_style(planner)["color"].startswith("#")


def test_rows_of_cases_name_what_there_is() -> None:
    for name, row in CASE_PLANNERS.items():
        assert row.name == name
        assert SEARCHES[row.search].follows_policy == bool(row.policy)
        assert row.policy in {"", planners.UNIFORM, *SIGHTS}
    assert len({row.label for row in CASE_PLANNERS.values()}) == len(CASE_PLANNERS)


def test_no_two_rows_look_the_same() -> None:
    shown = list(TABLE_3.values())
    assert len({planner.label for planner in shown}) == len(shown)
    assert len({tuple(planner_style(planner).values()) for planner in shown}) == len(shown)


def test_a_row_with_an_unknown_policy_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    check_planners(POLICIES)
    row = replace(PLANNERS["guided"], policy="oracle")
    monkeypatch.setattr(planners, "PLANNERS", {"guided": row})
    with pytest.raises(InputError, match=r"guided, policy: 'oracle' is unknown .*paper"):
        check_planners(POLICIES)
