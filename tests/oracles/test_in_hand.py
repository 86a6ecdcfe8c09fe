"""Plans that begin with a box in a hand."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from plan_checker import check

from guided_lgp import plan
from guided_lgp.bounds.execution import execute
from guided_lgp.bounds.plan_file import write_plan
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.errors import InputError
from guided_lgp.logic import parse_objective, parse_skeleton
from guided_lgp.observed import Observed, ObservedBox, observed_scene
from guided_lgp.params import load_params
from guided_lgp.paths import SOURCES
from guided_lgp.poses import compose, pose
from guided_lgp.scene import Scene, load_scene, parse_scene
from guided_lgp.scene.validate import validate_scene
from guided_lgp.scene.world import initial_poses

PARAMS = load_params(SOURCES / "params.yaml").bounds
SIZE = [0.15, 0.07, 0.1]
STACK = Path(__file__).parents[1] / "cases" / "stack_in_hand.json"
"""A tray in a hand, level, with a cup on it."""


def scene(*others: dict[str, Any], **held: Any) -> Scene:
    tables = [
        {"name": name, "position": [0.54, y, 0.6], "half_extents": [0.17, 0.2]}
        for name, y in (("left", 0.33), ("right", -0.33))
    ]
    red = {"name": "red", "size": SIZE, "position": [0.48, 0.25, 0.65], "on": "left"}
    boxes = [red, {"name": "blue", "size": SIZE, "on": "pr2R", **held}, *others]
    return parse_scene({"tables": tables, "boxes": boxes}, "mine.json")


@pytest.mark.parametrize(
    ("grasp", "skeleton", "goal"),
    [
        (None, "(place pr2R blue right)", "(on blue right)"),
        (None, "(grasp pr2L red) (place pr2L red right) (place pr2R blue red)", "(on blue red)"),
        # from the front, 45 degrees down, a little off the middle
        (
            [0.03, 0, 0.01, 0, -0.3826834, 0, 0.9238795],
            "(place pr2R blue right)",
            "(on blue right)",
        ),
    ],
)
def test_what_is_in_a_hand_is_put_down(
    tmp_path: Path, grasp: list[float] | None, skeleton: str, goal: str
) -> None:
    start = scene(**({} if grasp is None else {"grasp": grasp}))
    validate_scene(start)
    assert Scene.model_validate(start.model_dump(mode="json")) == start
    result = SceneBounds(start, PARAMS).path(parse_skeleton(skeleton))
    assert result.feasible, result.failure
    objective = parse_objective([goal])
    assert result.trajectory is not None
    assert execute(start, objective, parse_skeleton(skeleton), result.trajectory).success
    write_plan(tmp_path / "plan.json", start, objective, result, {})
    plan = json.loads((tmp_path / "plan.json").read_text())
    assert check(plan) == []
    plan["scene"]["boxes"][1]["grasp"][2] += 0.01
    assert check(plan) != []


def test_a_can_may_be_turned_in_the_hand(tmp_path: Path) -> None:
    can = {"shape": "cylinder", "size": [0.06, 0.06, 0.12]}
    above = next(box for box in scene(**can).movable if box.name == "blue").grasp
    assert above is not None
    turned = compose(np.array(above), pose((0.0, 0.0, 0.0), 0.4)).tolist()
    start, placing = scene(**can, grasp=turned), parse_skeleton("(place pr2R blue right)")
    result = SceneBounds(start, PARAMS).path(placing)
    assert result.feasible, result.failure
    write_plan(tmp_path / "plan.json", start, parse_objective(["(on blue right)"]), result, {})
    assert check(json.loads((tmp_path / "plan.json").read_text())) == []


@pytest.mark.parametrize(
    ("others", "held", "fault"),
    [
        ([], {"size": [0.15, 0.12, 0.1]}, r"pr2R cannot hold 'blue': no side of at most"),
        ([{"name": "c", "size": SIZE, "on": "pr2R"}], {}, "pr2R holds 2 boxes at the start"),
        ([{"name": "c", "size": SIZE, "on": "left"}], {}, "'c' has no position"),
    ],
)
def test_a_hand_that_cannot_hold_is_told(
    others: list[dict[str, Any]], held: dict[str, Any], fault: str
) -> None:
    with pytest.raises(InputError, match=fault):
        scene(*others, **held)


def test_a_grasp_that_is_none_is_told() -> None:
    tilted = scene(grasp=[0.03, 0, 0, 0.3, 0, 0, 0.953939])
    with pytest.raises(InputError, match=r"blue\.grasp: pr2R does not hold the body so"):
        SceneBounds(tilted, PARAMS).coarse(parse_skeleton("(place pr2R blue right)"))


@pytest.mark.parametrize(
    ("goal", "actions"),
    [("(on tray right)", 1), ("(on cup right)", 2), ("(on can cup)", 2), ("(on tray can)", 1)],
)
def test_what_a_held_box_carries_at_the_start(tmp_path: Path, goal: str, actions: int) -> None:
    start = load_scene(STACK)
    validate_scene(start)
    assert (start.loaded, start.state.support_of("cup")) == ({"tray": "pr2L"}, "tray")
    result = plan(start, goal, timeout=300)
    assert result.path is not None, result.explanation
    assert len(result.skeleton or ()) == actions
    write_plan(tmp_path / "plan.json", result.scene, result.objective, result.path, {})
    assert check(json.loads((tmp_path / "plan.json").read_text())) == []


def test_what_carries_others_is_level_in_the_hand() -> None:
    start = load_scene(STACK)
    joints = start.robot.joints | {"l_wrist_roll_joint": 0.3}
    robot = start.robot.model_copy(update={"joints": joints})
    with pytest.raises(InputError, match=r"boxes\.0 \(tray\)\.grasp: pr2L holds it tilted by 1\."):
        validate_scene(start.model_copy(update={"robot": robot}))


def test_a_stack_in_a_hand_is_seen_as_such() -> None:
    """What is observed while a plan is carried out may be carried on a held box."""
    start = load_scene(STACK)
    observed = Observed(
        joints=start.robot.joints,
        boxes={
            name: ObservedBox(position=tuple(at[:3].tolist()), quaternion=tuple(at[3:].tolist()))
            for name, at in initial_poses(start).items()
        },
        held={"tray": "pr2L"},
    )
    seen = observed_scene(start, observed)
    validate_scene(seen)
    assert seen.state == start.state
    (cup,) = (box for box in seen.movable if box.name == "cup")
    assert cup.placement == pytest.approx(initial_poses(start)["cup"], abs=1e-3)
