"""A plan of the version before the second scene document."""

import json
from pathlib import Path

from plan_checker import check

from guided_lgp.bounds.plan_file import read_plan
from guided_lgp.scene import load_scene
from guided_lgp.scene.validate import validate_scene

ROOT = Path(__file__).parents[2]
PLAN = ROOT / "tests" / "pins" / "plan_of_version_1.json"


def test_it_loads_and_is_accepted() -> None:
    plan, document = read_plan(PLAN), json.loads(PLAN.read_text())
    validate_scene(plan.scene)
    assert plan.scene == load_scene(ROOT / "examples" / "three_boxes.json")
    assert plan.scene.model_dump(mode="json") == document["scene"]
    assert check(document) == []
