"""Bodies that are held in given ways only: read, planned for, and judged by the checker."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from plan_checker import check

from guided_lgp import plan
from guided_lgp.bounds.path.task import Task
from guided_lgp.bounds.plan_file import write_plan
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.errors import InputError
from guided_lgp.logic import parse_skeleton
from guided_lgp.params import load_planning
from guided_lgp.poses import apply, compose, inverse
from guided_lgp.scene import Scene, parse_scene

HALF = math.sqrt(0.5)
DOWN, AHEAD = [0, HALF, 0, HALF], [0, 0, 0, 1]
SLOPING = [0, math.sin(math.pi / 8), 0, math.cos(math.pi / 8)]
LOW = [0.03, 0.001, 0.01, *DOWN]  # 4 cm under the top, 3 cm and 1 mm beside the middle


WEDGE = [[x, y, z] for x, y in ((0.06, 0), (-0.03, 0.03), (-0.03, -0.03)) for z in (0, 0.12)]
"""It has no parallel sides for fingers."""


def scene(**box: Any) -> Scene:
    tables = [
        {"name": name, "position": [0.5, y, 0.2], "half_extents": [0.15, 0.15]}
        for name, y in (("left", 0.25), ("right", -0.25))
    ]
    red = {"name": "red", "position": [0.5, 0.25, 0.25], "on": "left"} | box
    size = {} if "vertices" in box else {"size": [0.12, 0.06, 0.1]}
    document = {"robot": {"model": "panda"}, "tables": tables, "boxes": [red | size]}
    return parse_scene(document, "mine.json")


def held(start: Scene) -> np.ndarray:
    """The tool in the frame of the box, at the contacts of a plan to the other table."""
    result = plan(start, ["(on red right)"])
    assert result.path is not None, result.explanation
    return np.array(
        [
            compose(inverse(at.boxes["red"]), start.robot.tool_pose(at.q, "panda"))
            for at in result.path.at_switch
        ]
    )


def same(tools: np.ndarray, grasp: list[float]) -> bool:
    turn = np.abs(tools[:, 3:] @ grasp[3:])
    return bool(np.allclose(tools[:, :3], grasp[:3], atol=1e-9) and np.allclose(turn, 1))


@pytest.mark.parametrize("grasp", [LOW, [-0.02, 0, 0.02, *SLOPING]])
def test_the_hand_holds_exactly_so(grasp: list[float], tmp_path: Path) -> None:
    start = scene(grasps=[grasp])
    assert Scene.model_validate(start.model_dump(mode="json")) == start
    assert same(held(start), grasp)
    result = plan(start, ["(on red right)"])
    assert result.path is not None
    write_plan(tmp_path / "plan.json", start, result.objective, result.path, {})
    document = json.loads((tmp_path / "plan.json").read_text())
    assert check(document) == []
    document["scene"]["boxes"][0]["grasps"] = [[grasp[0] + 0.01, *grasp[1:]]]
    assert [fault.kind for fault in check(document)] == ["grasp"]


def test_where_none_of_them_is_free_there_is_no_motion(monkeypatch: pytest.MonkeyPatch) -> None:
    bounds = SceneBounds(scene(grasps=[LOW]), load_planning().bounds)
    skeleton = parse_skeleton("(grasp panda red) (place panda red right)")
    assert bounds.coarse(skeleton).feasible
    monkeypatch.setattr(Task, "blocked", lambda *_: True)
    assert not bounds.path(skeleton).feasible


def test_what_has_no_upright_sides_is_held_where_the_scene_says() -> None:
    mesh = {"shape": "mesh", "position": [0.5, 0.25, 0.2], "vertices": WEDGE}
    start = scene(**mesh, grasps=[[0, 0, 0.08, *DOWN]])
    (box,) = start.boxes
    assert same(held(start), list(box.grasps[0]))
    # the frame has moved to the centre of mass, at half the height; the grasp has not
    there = apply(box.placement, np.array(box.grasps[0][:3]))
    assert there == pytest.approx([0.5, 0.25, 0.28], abs=1e-6)


def test_a_body_on_another_face_takes_its_grasps_along() -> None:
    lying = [0, HALF, 0, HALF]  # about y: its x axis points down
    side = [-0.03, 0, 0, *AHEAD]  # against its x axis, so from above as it lies
    (box,) = scene(quaternion=lying, position=[0.5, 0.25, 0.26], grasps=[side]).boxes
    standing = compose(box.placement, np.array(box.grasps[0]))
    given = compose(np.array([0.5, 0.25, 0.26, *lying]), np.array(side))
    assert standing[:3] == pytest.approx(given[:3])
    assert abs(standing[3:] @ given[3:]) == pytest.approx(1)
    assert same(
        held(scene(quaternion=lying, position=[0.5, 0.25, 0.26], grasps=[side])),
        list(box.grasps[0]),
    )


def test_it_begins_in_the_hand_so() -> None:
    in_hand = {"on": "panda", "position": [0, 0, 0]}
    (box,) = scene(**in_hand, grasps=[LOW]).boxes
    assert box.grasp is not None
    assert compose(inverse(np.array(LOW)), inverse(np.array(box.grasp))) == pytest.approx(
        [0, 0, 0, 0, 0, 0, 1], abs=1e-9
    )
    assert same(held(scene(**in_hand, grasps=[LOW])), LOW)
    with pytest.raises(InputError, match="grasp is none of its grasps"):
        scene(**in_hand, grasps=[LOW], grasp=[0.08, 0, 0, *inverse(np.array(LOW))[3:]])


@pytest.mark.parametrize(
    ("grasp", "fault"),
    [
        ([0, 0.01, 0, *DOWN], r"boxes\.0: grasps\.0: the middle between .* is 10\.0 mm beside"),
        ([0, 0, 0, 0, -HALF, 0, HALF], "the hand comes from below"),
        ([0, 0, 0, 0.5, 0.5, 0.5, 0.5], "the fingers close along neither x nor y"),
        ([0, 0, 0, 1, 1, 0, 0], "a quaternion has length 1"),
        ([0, 0, 0], r"boxes\.0\.grasps\.0"),
    ],
)
def test_what_is_no_grasp_is_told(grasp: list[float], fault: str) -> None:
    with pytest.raises(InputError, match=fault):
        scene(grasps=[grasp])


def test_nobody_holds_what_is_fixed() -> None:
    with pytest.raises(InputError, match="nobody holds a fixed body"):
        scene(fixed=True, grasps=[LOW])


def test_a_grasp_across_too_wide_a_side_is_the_reason() -> None:
    across = [0, 0, 0.01, 0.5, 0.5, -0.5, 0.5]
    result = plan(scene(grasps=[across]), ["(on red right)"])
    assert not result.solved
    assert "red is too wide for the fingers: 0.120 m" in result.explanation
