"""Written plans against the independent checker, and the checker against spoilt plans."""

import copy
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from plan_checker import Fault, check

from guided_lgp.bounds.plan_file import write_plan
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.logic import parse_objective, parse_skeleton
from guided_lgp.params import load_params
from guided_lgp.paths import SOURCES
from guided_lgp.scene import Scene, generate, load_scene, parse_scene

EXAMPLES = Path(__file__).parents[2] / "examples"
TASKS = {
    "two_goals": ("three_boxes", "(on red green)", "(held blue)"),
    "tower": ("four_boxes_and_tray", "(on green red)", "(on red tray)"),
    "held": ("three_boxes", "(held green)"),
    "both_hands": ("three_boxes", "(held red)", "(on blue red)"),
    "both_held": ("three_boxes", "(held blue)", "(held red)"),
}
IN_TURN = {"both_held"}
"""Plans of one arm at a time: both hands would close at the same moment, in no order."""


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Plans of the command line, breadth-first: no weights needed."""
    plans, folder = {}, tmp_path_factory.mktemp("plans")
    for name, (scene, *goals) in TASKS.items():
        out = folder / f"{name}.json"
        command = [sys.executable, "-m", "guided_lgp.cli", "plan", str(EXAMPLES / f"{scene}.json")]
        command += [word for goal in goals for word in ("--goal", goal)]
        command += ["--planner", "breadth-first", "--out", str(out)]
        command += ["--no-coordinate"] * (name in IN_TURN)
        subprocess.run(command, check=True, capture_output=True, timeout=120)
        plans[name] = json.loads(out.read_text())
    return plans


@pytest.fixture
def plans(written: dict[str, Any]) -> dict[str, Any]:
    """A copy that a test may spoil."""
    return copy.deepcopy(written)


def kinds(faults: list[Fault]) -> set[str]:
    return {fault.kind for fault in faults}


def box(plan: dict[str, Any], name: str) -> dict[str, Any]:
    return next(item for item in plan["scene"]["boxes"] if item["name"] == name)


def column(plan: dict[str, Any], joint: str) -> int:
    return plan["joint_names"].index(joint)


def set_joint(plan: dict[str, Any], joint: str, value: float) -> None:
    """The joint stands at the value all the time."""
    for row in [*plan["path"]["q"], *(keyframe["q"] for keyframe in plan["keyframes"])]:
        row[column(plan, joint)] = value


def swing(plan: dict[str, Any], **by: float) -> None:
    """The idle arm leaves its place and comes back before anything is grasped, slowly."""
    rows = plan["path"]["q"][: plan["path"]["attachments"][0]["start"]]
    for row, part in zip(rows, np.sin(np.linspace(0, np.pi, len(rows))) ** 2, strict=True):
        for joint, angle in by.items():
            row[column(plan, joint)] += part * angle
    plan["path"]["times"] = [5 * time for time in plan["path"]["times"]]


@pytest.mark.parametrize("task", TASKS)
def test_plans_are_accepted(plans: dict[str, Any], task: str) -> None:
    _, *goals = TASKS[task]
    assert sorted(plans[task]["objective"]) == sorted(goals)
    assert check(plans[task]) == []


@pytest.mark.parametrize("axis", [0, 1])
def test_a_box_that_stands_elsewhere_is_not_grasped(plans: dict[str, Any], axis: int) -> None:
    plan = plans["held"]
    box(plan, "green")["position"][axis] += 0.06
    assert {"grasp", "keyframe"} <= kinds(check(plan))


def test_a_robot_that_stands_elsewhere_grasps_nothing(plans: dict[str, Any]) -> None:
    plan = plans["two_goals"]
    plan["scene"]["robot"]["base"] = [-0.08, 0, 0]
    assert {"grasp", "support", "keyframe"} <= kinds(check(plan))


def test_a_keyframe_off_the_path_is_found(plans: dict[str, Any]) -> None:
    plan = plans["tower"]
    plan["keyframes"][1]["boxes"]["blue"]["position"][1] += 0.01
    plan["keyframes"][2]["q"][3] += 0.01
    faults = check(plan)
    assert kinds(faults) == {"keyframe"}
    assert [fault.text.split()[1] for fault in faults] == ["1:", "2:"]


def test_a_jump_in_the_path_is_too_fast(plans: dict[str, Any]) -> None:
    plan = plans["held"]
    plan["path"]["q"][20][column(plan, "l_wrist_roll_joint")] += 0.6
    faults = check(plan)
    assert kinds(faults) == {"velocity"}
    assert "l_wrist_roll_joint" in faults[0].text
    assert faults[0].row in (19, 20)


def test_a_path_in_half_the_time_is_too_fast(plans: dict[str, Any]) -> None:
    plan = plans["tower"]
    plan["path"]["times"] = [time / 2 for time in plan["path"]["times"]]
    assert kinds(check(plan)) == {"velocity"}


def test_a_joint_beyond_its_limit_is_found(plans: dict[str, Any]) -> None:
    plan = plans["held"]
    set_joint(plan, "r_wrist_flex_joint", 0.1)
    faults = check(plan)
    assert [fault.kind for fault in faults] == ["limit"]
    assert "r_wrist_flex_joint" in faults[0].text


def test_a_finger_that_does_not_follow_is_found(plans: dict[str, Any]) -> None:
    plan = plans["held"]
    set_joint(plan, "r_gripper_r_finger_joint", 0.2)
    assert kinds(check(plan)) == {"mimic"}


def test_fingers_that_stay_open_hold_nothing(plans: dict[str, Any]) -> None:
    plan = plans["held"]
    for finger in ("l_finger", "r_finger", "l_finger_tip", "r_finger_tip"):
        set_joint(plan, f"l_gripper_{finger}_joint", 0.54)
    assert {"grasp", "fingers"} <= kinds(check(plan))


def test_fingers_that_stay_closed_do_not_let_go(plans: dict[str, Any]) -> None:
    plan = plans["tower"]
    rows, end = plan["path"]["q"], plan["path"]["attachments"][0]["end"]
    fingers = [index for index, name in enumerate(plan["joint_names"]) if "l_gripper" in name]
    for row in rows[end + 1 : end + 20]:
        for index in fingers:
            row[index] = rows[end][index]
    assert "fingers" in kinds(check(plan))


@pytest.mark.parametrize(
    ("task", "number"), [("two_goals", 0), ("two_goals", 1), ("both_hands", 2)]
)
def test_what_is_carried_must_be_attached(plans: dict[str, Any], task: str, number: int) -> None:
    plan = plans[task]
    del plan["path"]["attachments"][number]
    assert "attachment" in kinds(check(plan))


def test_what_is_not_carried_must_not_be_attached(plans: dict[str, Any]) -> None:
    plan = plans["held"]
    held = plan["path"]["attachments"][0]
    plan["path"]["attachments"].append(held | {"box": "blue"})
    faults = check(plan)
    assert "attachment" in kinds(faults)
    assert any("blue" in fault.text for fault in faults if fault.kind == "attachment")


def test_a_box_let_go_early_falls_beside_its_support(plans: dict[str, Any]) -> None:
    plan = plans["tower"]
    plan["path"]["attachments"][1]["end"] -= 20
    assert "support" in kinds(check(plan))


def test_actions_the_wrong_way_round_are_illegal(plans: dict[str, Any]) -> None:
    plan = plans["tower"]
    plan["actions"][:2] = reversed(plan["actions"][:2])
    assert kinds(check(plan)) == {"logic"}


def test_actions_of_both_hands_swapped_contradict_the_attachments(plans: dict[str, Any]) -> None:
    plan = plans["both_held"]
    plan["actions"][:2] = reversed(plan["actions"][:2])
    assert kinds(check(plan)) == {"order"}


def test_an_action_with_another_table_contradicts_the_path(plans: dict[str, Any]) -> None:
    plan = plans["tower"]
    plan["actions"][1] = "(place pr2L red tab2)"
    assert kinds(check(plan)) == {"support", "goal"}


def test_a_goal_that_does_not_hold_is_found(plans: dict[str, Any]) -> None:
    plan = plans["two_goals"]
    plan["objective"].append("(on red tab1)")
    faults = check(plan)
    assert [fault.kind for fault in faults] == ["goal"]
    assert "(on red tab1)" in faults[0].text


def test_a_link_through_the_table_collides(plans: dict[str, Any]) -> None:
    plan = plans["held"]
    swing(plan, r_shoulder_pan_joint=1.0, r_shoulder_lift_joint=0.6, r_elbow_flex_joint=1.2)
    faults = check(plan)
    assert kinds(faults) == {"collision"}
    assert any("r_forearm_link is" in fault.text and "tab2" in fault.text for fault in faults)


def test_an_arm_through_the_other_collides(plans: dict[str, Any]) -> None:
    plan = plans["held"]
    swing(plan, r_shoulder_pan_joint=1.9, r_upper_arm_roll_joint=-0.5)
    faults = check(plan)
    assert kinds(faults) == {"collision"}
    assert all("l_" in fault.text and " r_" in fault.text for fault in faults)


def test_a_carried_box_through_a_table_collides(plans: dict[str, Any]) -> None:
    plan = plans["tower"]
    x, y, z = box(plan, "red")["position"]
    beam = {"name": "beam", "position": [x, y, z + 0.12], "half_extents": [0.02, 0.02]}
    plan["scene"]["tables"].append(beam)
    faults = check(plan)
    assert kinds(faults) == {"collision"}
    assert any(fault.text.startswith("red is") and "inside beam" in fault.text for fault in faults)


def test_a_box_through_a_box_collides(plans: dict[str, Any]) -> None:
    plan = plans["tower"]
    other = box(plan, "yellow")
    other["position"] = [*box(plan, "red")["position"][:2], other["position"][2]]
    faults = check(plan)
    assert any("red is" in fault.text and "inside yellow" in fault.text for fault in faults)


@pytest.mark.parametrize(
    ("keys", "value"),
    [
        (("path", "times", 3), 0.0),
        (("path", "q", 3), [0.0]),
        (("path", "attachments", 0, "end"), 10_000),
        (("joint_names", 0), "l_tentacle_joint"),
        (("fixed_joints", "torso_lift_joint"), 0.1),
        (("actions", 0), "(throw pr2L green)"),
        (("keyframes",), []),
        (("scene", "boxes", 0, "on"), "red"),
    ],
)
def test_a_file_of_another_form_is_told(
    plans: dict[str, Any], keys: tuple[str | int, ...], value: object
) -> None:
    plan = item = plans["held"]
    *way, last = keys
    for key in way:
        item = item[key]
    item[last] = value
    assert [fault.kind for fault in check(plan)] == ["format"]


def written_plan(folder: Path, scene: Scene, skeleton: str, goal: str) -> dict[str, Any]:
    """The plan file of a skeleton that the bounds carry out."""
    result = SceneBounds(scene, load_params(SOURCES / "params.yaml").bounds).path(
        parse_skeleton(skeleton)
    )
    assert result.feasible, result.failure
    write_plan(folder / "plan.json", scene, parse_objective([goal]), result, {})
    document: dict[str, Any] = json.loads((folder / "plan.json").read_text())
    return document


@pytest.fixture(scope="module")
def handed_over(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    scene = generate("a", 1, 77, "handover").scenes[0].model_copy(update={"domain": "handover"})
    skeleton = "(grasp pr2L green) (take pr2R pr2L green) (place pr2R green blue)"
    return written_plan(tmp_path_factory.mktemp("take"), scene, skeleton, "(on green blue)")


def test_a_hand_over_is_accepted(handed_over: dict[str, Any]) -> None:
    assert check(handed_over) == []


def test_a_giver_that_does_not_let_go_at_the_take_is_told(handed_over: dict[str, Any]) -> None:
    plan = copy.deepcopy(handed_over)
    given = min(plan["path"]["attachments"], key=lambda attachment: attachment["start"])
    given["end"] += 5
    assert "attachment" in kinds(check(plan))


def test_a_take_from_an_empty_hand_is_told(handed_over: dict[str, Any]) -> None:
    plan = copy.deepcopy(handed_over)
    plan["actions"][1] = "(take pr2R pr2L blue)"
    assert kinds(check(plan)) == {"logic"}


def before_a_panda(**robot: Any) -> Scene:
    table = {"position": [0.5, 0.0, 0.4], "half_extents": [0.17, 0.4]}
    size = [0.12, 0.05, 0.08]
    return parse_scene(
        {
            "robot": {"model": "panda"} | robot,
            "tables": [{"name": "tab1", **table}],
            "boxes": [
                {"name": "red", "size": size, "position": [0.5, 0.25, 0.44], "on": "tab1"},
                {"name": "green", "size": size, "position": [0.5, -0.25, 0.44], "on": "tab1"},
            ],
        },
        "scene.json",
    )


def test_one_arm_on_a_column_is_accepted_and_its_faults_told(tmp_path: Path) -> None:
    scene = before_a_panda(height=0.4)
    skeleton = "(grasp panda red) (place panda red green)"
    plan = written_plan(tmp_path, scene, skeleton, "(on red green)")
    assert check(plan) == []
    set_joint(plan, "panda_finger_joint1", 0.0)
    assert {"mimic", "fingers", "grasp"} & kinds(check(plan))


@pytest.fixture(scope="module")
def in_kitchen(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """A box goes on what is fixed, past obstacles and under a shelf; a can goes on a mesh."""
    box = "(grasp pr2L 003_cracker_box) (place pr2L 003_cracker_box step)"
    skeleton = f"{box} (grasp pr2L can) (place pr2L can wedge)"
    scene = load_scene(EXAMPLES / "kitchen.json")
    return written_plan(tmp_path_factory.mktemp("kitchen"), scene, skeleton, "(on can wedge)")


def test_other_shapes_and_obstacles_are_accepted(in_kitchen: dict[str, Any]) -> None:
    assert check(in_kitchen) == []


def test_an_obstacle_in_the_way_is_told(in_kitchen: dict[str, Any]) -> None:
    plan = copy.deepcopy(in_kitchen)
    plan["scene"]["obstacles"][0]["position"][1] = 0.2
    assert "collision" in kinds(check(plan))


def test_a_pointed_support_carries_nothing(in_kitchen: dict[str, Any]) -> None:
    plan = copy.deepcopy(in_kitchen)
    wedge = box(plan, "wedge")
    wedge["vertices"] = [
        [0.1 * x if z > 0 else x, 0.1 * y if z > 0 else y, z] for x, y, z in wedge["vertices"]
    ]
    assert any("is not over it" in fault.text for fault in check(plan))


def test_an_arm_that_hangs_is_accepted_and_one_that_stands_there_is_not(tmp_path: Path) -> None:
    scene = before_a_panda(base=[0.1, 0.0, 0.2], height=1.25, tilt=[np.pi, 0.0])
    skeleton = "(grasp panda red) (place panda red green)"
    plan = written_plan(tmp_path, scene, skeleton, "(on red green)")
    assert check(plan) == []
    plan["scene"]["robot"]["tilt"] = [np.pi, 0.1]
    assert "grasp" in kinds(check(plan))
