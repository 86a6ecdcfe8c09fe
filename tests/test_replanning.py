"""Going on from what is observed, and plans in closed loop."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from guided_lgp import load_scene, plan
from guided_lgp.bounds.execution.run import final_boxes
from guided_lgp.cli.app import main
from guided_lgp.errors import InputError
from guided_lgp.logic import format_skeleton, parse_skeleton
from guided_lgp.observed import Observed, ObservedBox, observed_scene, read_observed
from guided_lgp.paths import EXAMPLES
from guided_lgp.poses import compose, pose
from guided_lgp.replanning import (
    MIDDLE,
    Course,
    Laboratory,
    first_actions,
    follow,
    in_the_middle,
    replan,
)
from guided_lgp.scene import Scene
from guided_lgp.scene.world import initial_poses

GOALS = ["(on red green)"]


@pytest.fixture(scope="module")
def course() -> Course:
    result = plan(load_scene(EXAMPLES / "three_boxes.json"), GOALS)
    assert result.path is not None
    assert result.path.trajectory is not None
    skeleton = result.path.skeleton
    return Course(result.scene, result.objective, skeleton, result.path.trajectory)


def _as_it_is(scene: Scene, **moved: tuple[float, ...]) -> Observed:
    boxes = {
        name: ObservedBox(position=tuple(at[:3].tolist()), quaternion=tuple(at[3:].tolist()))
        for name, at in (initial_poses(scene) | {k: np.array(v) for k, v in moved.items()}).items()
    }
    return Observed(boxes=boxes)


def test_what_is_as_planned_keeps_the_plan(course: Course) -> None:
    found = replan(course, 0, _as_it_is(course.scene))
    assert found.how == "kept"
    assert found.course.skeleton == course.skeleton


def test_a_box_that_is_gone_is_named_if_a_goal_asks_for_it(course: Course) -> None:
    seen = _as_it_is(course.scene)
    without = {box: at for box, at in seen.boxes.items() if box != "blue"}
    assert replan(course, 0, Observed(boxes=without)).how == "kept"
    del without["green"]
    with pytest.raises(InputError, match=r"green is gone, and \(on red green\) asks for it"):
        replan(course, 0, Observed(boxes=without))


def test_a_place_that_has_come_undone_is_repaired(course: Course) -> None:
    """Both actions are said to be made, and the box is still at its start."""
    found = replan(course, 2, _as_it_is(course.scene))
    assert found.how == "repaired"
    assert found.course.skeleton == course.skeleton


def test_what_is_put_on_a_box_to_stay_there_is_put_in_its_middle(course: Course) -> None:
    found = replan(course, 0, _as_it_is(course.scene)).course
    boxes = final_boxes(found.scene, found.trajectory)
    assert np.linalg.norm((boxes["red"] - boxes["green"])[:2]) < MIDDLE


@pytest.mark.parametrize(
    ("way", "goal"),
    [
        ("(grasp pr2L red) (place pr2L red green)", "at red green"),
        ("(grasp pr2L red) (place pr2L red tab1)", ""),
        ("(grasp pr2L red) (place pr2L red green) (grasp pr2L red)", ""),
        ("(grasp pr2L red) (place pr2L red green) (grasp pr2R green)", ""),
        ("(grasp pr2R green) (grasp pr2L red) (place pr2L red green)", ""),
        ("(grasp pr2L red)", ""),
    ],
)
def test_only_what_stays_is_put_in_the_middle(course: Course, way: str, goal: str) -> None:
    found = in_the_middle(course.scene, parse_skeleton(way))
    assert [" ".join((one.kind, *one.symbols[:2])) for one in found] == list(filter(None, [goal]))


def test_a_box_that_others_stand_on_is_found_at_its_height(course: Course) -> None:
    on_green = (0.5, -0.25, 0.755, 0.0, 0.02, 0.0, 1.0)
    scene = observed_scene(course.scene, _as_it_is(course.scene, red=on_green))
    red = next(box for box in scene.boxes if box.name == "red")
    assert (red.on, red.position[2]) == ("green", pytest.approx(0.75))


def test_a_box_on_its_side_lies_on_another_face(course: Course) -> None:
    side = pose((0.48, 0.25, 0.635))
    turned = compose(side, np.array([0, 0, 0, np.sqrt(0.5), 0, 0, np.sqrt(0.5)]))
    scene = observed_scene(course.scene, _as_it_is(course.scene, red=tuple(turned)))
    red = next(box for box in scene.boxes if box.name == "red")
    np.testing.assert_allclose(red.size, (0.15, 0.10, 0.07))


@pytest.mark.parametrize(
    ("pose", "fault"),
    [
        ((0.48, 0.25, 0.80, 0.0, 0.0, 0.0, 1.0), "stands on nothing"),
        ((0.48, 0.25, 0.65, 0.3, 0.0, 0.0, 0.954), "tilted"),
    ],
)
def test_a_box_that_cannot_stand_so_is_one_line(
    course: Course, pose: tuple[float, ...], fault: str
) -> None:
    with pytest.raises(InputError, match=f"boxes.red.*{fault}"):
        observed_scene(course.scene, _as_it_is(course.scene, red=pose))


@pytest.mark.parametrize(
    ("box", "fault"),
    [
        ({"position": [0.5, 0.2]}, "position"),
        (
            {"position": [0.5, 0.2, 0.65], "quaternion": [0, 0, 0, 0]},
            "quaternion: is not of length",
        ),
    ],
)
def test_a_faulty_file_is_one_line(box: dict[str, object], fault: str, tmp_path: Path) -> None:
    file = tmp_path / "state.json"
    file.write_text(json.dumps({"boxes": {"red": box}}))
    with pytest.raises(InputError, match=rf"state\.json: boxes\.red\.{fault}"):
        read_observed(file)


def test_a_cylinder_on_its_side_and_fingers_above_and_below_are_one_line() -> None:
    kitchen, boxes = (load_scene(EXAMPLES / f"{name}.json") for name in ("kitchen", "three_boxes"))
    can = next(box for box in kitchen.boxes if box.name == "can")
    lying = ObservedBox(position=can.position, quaternion=(math.sqrt(0.5), 0, 0, math.sqrt(0.5)))
    with pytest.raises(InputError, match=r"boxes\.can: .*no flat face down"):
        observed_scene(kitchen, Observed(boxes={"can": lying}))
    quarter = np.array([0, 0, 0, math.sqrt(0.5), 0, 0, math.sqrt(0.5)])
    upright = compose(boxes.robot.tool_pose(boxes.robot.start, "pr2L"), quarter)
    held = ObservedBox(position=tuple(upright[:3]), quaternion=tuple(upright[3:]))
    with pytest.raises(InputError, match=r"held\.red: is held from above and below"):
        observed_scene(boxes, Observed(boxes={"red": held}, held={"red": "pr2L"}))


def test_the_first_action_ends_when_the_hand_has_gone(course: Course) -> None:
    part = first_actions(course)
    assert format_skeleton(part.skeleton) == format_skeleton(course.skeleton[:1])
    (attachment,) = part.trajectory.attachments
    assert attachment.end == len(part.trajectory.times) - 1
    assert part.trajectory.times[-1] < course.trajectory.times[-1]


def test_a_box_that_is_lost_is_taken_again(course: Course) -> None:
    def lose(world: Laboratory, made: int) -> None:
        if made == 1:
            world.drop(world.held()["red"])

    followed = follow(course, disturb=lose)
    assert followed.decisions[0].startswith("repaired: (grasp")
    assert followed.report.success


def test_a_box_that_moves_away_is_followed(course: Course) -> None:
    """The box on which red is to be placed, before that."""

    def push(world: Laboratory, made: int) -> None:
        if made == 1:
            aside = pose((-0.03, 0.04, 0.0))
            world.put("green", compose(aside, world.boxes()["green"]))

    assert follow(course, disturb=push).report.success


def test_commands_go_on_and_carry_out(
    course: Course, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    written, state, rest = (tmp_path / name for name in ("plan.json", "state.json", "rest.json"))
    _run("plan", str(EXAMPLES / "three_boxes.json"), "--goal", GOALS[0], "--out", str(written))
    state.write_text(_as_it_is(course.scene).model_dump_json())
    _run("replan", str(written), "--observed", str(state), "--out", str(rest))
    printed = capsys.readouterr().out
    assert "the rest of the plan: kept" in printed
    assert printed.count("smallest distance:") == 2
    _run("execute", str(rest))
    printed = capsys.readouterr().out
    assert "physics: all goals hold" in printed
    assert "smallest distance:" in printed


def _run(*words: str, code: int = 0) -> None:
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert (ended.value.code or 0) == code


@pytest.mark.parametrize(
    ("option", "value", "fault"),
    [
        ("--friction", "0", "friction: 0 is out of range"),
        ("--force", "-3", "force: -3 is out of range"),
        ("--noise", "1", "noise: 1 is out of range"),
        ("--noise", "nan", "noise: nan is out of range"),
    ],
)
def test_a_condition_out_of_range_is_one_line(
    option: str, value: str, fault: str, capsys: pytest.CaptureFixture[str]
) -> None:
    _run("execute", "plan.json", option, value, code=2)
    assert fault in capsys.readouterr().err


def test_a_plan_that_is_too_fast_is_not_carried_out(
    course: Course, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "plan.json"
    _run("plan", str(EXAMPLES / "three_boxes.json"), "--goal", GOALS[0], "--out", str(file))
    document = json.loads(file.read_text())
    document["path"]["times"] = [time / 2 for time in document["path"]["times"]]
    file.write_text(json.dumps(document))
    _run("execute", str(file), code=2)
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert re.search(r"is not carried out: (velocity|acceleration|jerk|effort) \w+ by ", line)
