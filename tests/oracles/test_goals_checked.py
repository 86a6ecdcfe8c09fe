"""Plans for goals that say more than symbols: planned, written, and judged by the checker."""

import json
from pathlib import Path
from typing import Any

import pytest
from plan_checker import check

from guided_lgp import plan
from guided_lgp.bounds.execution import execute
from guided_lgp.bounds.plan_file import read_plan, write_plan
from guided_lgp.scene import load_scene

SCENE = Path(__file__).parents[2] / "examples" / "three_boxes.json"
PLANNED = {
    "named gripper": ["(heldby red pr2R)"],
    "empty gripper": ["(held blue)", "(empty pr2L)"],
    "empty hands": ["(on red green)", "(handempty)"],
    "pose where another box is": ["(at red 0.54 -0.33 0.65 0.3)"],
    "pose with tolerances": ["(at red tab2 0.6 -0.45 0.65 1.5 0.005 0.02)"],
    "region": ["(in red tab2 -0.1 0.0 0.15 0.2)"],
    "region of its own table": ["(in red tab1 0 0 0.17 0.2)"],
    "upright": ["(on red tab2)", "(upright red)"],
}


def document(goals: list[str], folder: Path) -> dict[str, Any]:
    """The plan file of goals in the scene of three boxes."""
    result = plan(load_scene(SCENE), goals, timeout=120)
    assert result.path is not None, result.explanation
    write_plan(folder / "plan.json", result.scene, result.objective, result.path, {})
    found: dict[str, Any] = json.loads((folder / "plan.json").read_text())
    return found


@pytest.mark.parametrize("kind", PLANNED)
def test_the_checker_accepts_it_and_physics_agrees(kind: str, tmp_path: Path) -> None:
    assert check(document(PLANNED[kind], tmp_path)) == []
    written = read_plan(tmp_path / "plan.json")
    report = execute(written.scene, written.goals, written.skeleton, written.trajectory)
    assert report.success, report


@pytest.mark.parametrize(
    ("kind", "goal"),
    [
        ("named gripper", "(heldby red pr2L)"),
        ("named gripper", "(empty pr2R)"),
        ("named gripper", "(handempty)"),
        ("named gripper", "(upright red)"),
        ("pose with tolerances", "(at red tab2 0.6 -0.45 0.65 1.0 0.005 0.02)"),
        ("pose with tolerances", "(at red tab2 0.62 -0.45 0.65 1.5 0.005 0.02)"),
        ("pose with tolerances", "(in red tab2 0 0 0.17 0.2)"),
    ],
)
def test_another_goal_does_not_hold(kind: str, goal: str, tmp_path: Path) -> None:
    spoilt = document(PLANNED[kind], tmp_path)
    spoilt["objective"] = [goal]
    assert [fault.kind for fault in check(spoilt)] == ["goal"]
