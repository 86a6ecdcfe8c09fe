"""Plan files: what is read is whole, and a motion that has been tampered with does not verify."""

import copy
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bad_input import answer, examples, garbled, odd_values, spoilt, truncated, write_json
from hypothesis import given
from hypothesis import strategies as st

from guided_lgp.bounds.plan_file import Plan, read_plan, write_plan
from guided_lgp.bounds.verify import verify_path
from guided_lgp.logic import parse_objective
from guided_lgp.params import BoundsParams, load_params
from guided_lgp.planning import plan
from guided_lgp.scene import Scene
from guided_lgp.scene.world import World

GOALS = ["(on red green)"]


@pytest.fixture(scope="module")
def written(scene: Scene, folder: Path) -> Path:
    """A plan of two actions, as the command line writes it."""
    params = load_params(Path(__file__).parents[2] / "params.yaml")
    params = params.model_copy(update={"bounds": BoundsParams(coarse_restarts=4, path_solutions=2)})
    result = plan(scene, GOALS, "breadth-first", params=params)
    assert result.path is not None
    path = folder / "written.json"
    write_plan(path, scene, parse_objective(GOALS), result.path, {"tree_size": result.tree_size})
    return path


@pytest.fixture(scope="module")
def document(written: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads(written.read_text(encoding="utf-8"))
    return found


def check(found: Plan) -> None:
    """Lengths fit, numbers are finite, times increase, names are known."""
    motion = found.trajectory
    assert motion.q.shape == (len(motion.times), len(motion.joint_names))
    assert np.isfinite(motion.q).all()
    assert np.isfinite(motion.times).all()
    assert (np.diff(motion.times) > 0).all()
    assert len(found.keyframes) == len(found.skeleton)
    for attachment in motion.attachments:
        assert attachment.box in found.scene.symbols.boxes
        assert 0 <= attachment.start <= attachment.end < len(motion.times)
    assert all(np.isfinite(keyframe.q).all() for keyframe in found.keyframes)


def short(document: dict[str, Any]) -> dict[str, Any]:
    """The same plan with few samples, which faults are more likely to hit."""
    few = copy.deepcopy(document)
    path = few["path"]
    path["times"], path["q"] = path["times"][:6], path["q"][:6]
    for number, attachment in enumerate(path["attachments"]):
        attachment |= {"start": number, "end": number + 2}
    return few


@examples(300)
@given(data=st.data())
def test_spoilt_documents(data: st.DataObject, document: dict[str, Any], folder: Path) -> None:
    file = write_json(folder / "plan.json", data.draw(spoilt(short(document))))
    found = answer(lambda: read_plan(file), file)
    if found is not None:
        check(found)


@examples(60)
@given(data=st.data())
def test_truncated_files(data: st.DataObject, written: Path, folder: Path) -> None:
    file = folder / "plan.json"
    file.write_bytes(data.draw(truncated(written.read_bytes().rstrip())))
    assert answer(lambda: read_plan(file), file) is None


@examples(60)
@given(data=st.data())
def test_garbled_files(data: st.DataObject, document: dict[str, Any], folder: Path) -> None:
    file = folder / "plan.json"
    file.write_bytes(data.draw(garbled(json.dumps(short(document)).encode())))
    found = answer(lambda: read_plan(file), file)
    if found is not None:
        check(found)


LISTS: tuple[Callable[[dict[str, Any]], list[Any]], ...] = (
    lambda plan: plan["path"]["times"],
    lambda plan: plan["path"]["q"],
    lambda plan: plan["path"]["q"][3],
    lambda plan: plan["joint_names"],
    lambda plan: plan["keyframes"],
    lambda plan: plan["keyframes"][0]["q"],
    lambda plan: plan["actions"],
)


@examples(120)
@given(
    which=st.sampled_from(LISTS), change=st.sampled_from(("drop", "repeat", "none")), data=st.data()
)
def test_lists_of_wrong_lengths(
    which: Callable[[dict[str, Any]], list[Any]],
    change: str,
    data: st.DataObject,
    document: dict[str, Any],
    folder: Path,
) -> None:
    spoiled = short(document)
    values = which(spoiled)
    index = data.draw(st.integers(0, len(values) - 1))
    if change == "drop":
        del values[index]
    elif change == "repeat":
        values.insert(index, copy.deepcopy(values[index]))
    else:
        values.clear()
    file = write_json(folder / "plan.json", spoiled)
    assert answer(lambda: read_plan(file), file) is None


@examples(150)
@given(
    value=odd_values.filter(lambda value: not isinstance(value, bool)),
    part=st.sampled_from(("times", "q", "keyframe", "position", "start", "fixed")),
    row=st.integers(0, 5),
)
def test_numbers_that_are_none(
    value: Any, part: str, row: int, document: dict[str, Any], folder: Path
) -> None:
    spoiled = short(document)
    holder, key = {
        "times": (spoiled["path"]["times"], row),
        "q": (spoiled["path"]["q"][row], 2 * row),
        "keyframe": (spoiled["keyframes"][row % 2]["q"], row),
        "position": (spoiled["scene"]["boxes"][row % 3]["position"], row % 3),
        "start": (spoiled["path"]["attachments"][0], "start"),
        "fixed": (spoiled["fixed_joints"], "torso_lift_joint"),
    }[part]
    holder[key] = value
    file = write_json(folder / "plan.json", spoiled)
    found = answer(lambda: read_plan(file), file)
    if found is not None:
        assert np.isfinite(float(value))
        check(found)


def _jump(plan: dict[str, Any], row: int, joint: int) -> None:
    plan["path"]["q"][row][joint] += 0.5


def _hurry(plan: dict[str, Any], row: int, joint: int) -> None:
    plan["path"]["times"] = [time * (0.1 + row / 1e4) for time in plan["path"]["times"]]


def _degrees(plan: dict[str, Any], row: int, joint: int) -> None:
    plan["path"]["q"] = np.degrees(plan["path"]["q"]).tolist()


def _cut_out(plan: dict[str, Any], row: int, joint: int) -> None:
    """The motion begins later than at the side of the robot."""
    first = plan["path"]["attachments"][0]["start"]
    rows = first // 2 + row % (first // 2)
    plan["path"]["times"] = plan["path"]["times"][rows:]
    plan["path"]["q"] = plan["path"]["q"][rows:]
    for attachment in plan["path"]["attachments"]:
        attachment["start"] -= rows
        attachment["end"] -= rows


def _other_hand(plan: dict[str, Any], row: int, joint: int) -> None:
    other = {"pr2L": "pr2R", "pr2R": "pr2L"}
    for attachment in plan["path"]["attachments"]:
        attachment["gripper"] = other[attachment["gripper"]]
    for old, new in (("pr2L", "x"), ("pr2R", "pr2L"), ("x", "pr2R")):
        plan["actions"] = [action.replace(old, new) for action in plan["actions"]]


def _other_box(plan: dict[str, Any], row: int, joint: int) -> None:
    for attachment in plan["path"]["attachments"]:
        attachment["box"] = "blue"
    plan["actions"] = [action.replace(" red", " blue") for action in plan["actions"]]


def _other_table(plan: dict[str, Any], row: int, joint: int) -> None:
    table = ("blue", "tab1", "tab2")[row % 3]
    plan["actions"][1] = plan["actions"][1].replace("green", table)


def _box_moved(plan: dict[str, Any], row: int, joint: int) -> None:
    plan["scene"]["boxes"][row % 2]["position"][joint % 2] += 0.16


def _early_grasp(plan: dict[str, Any], row: int, joint: int) -> None:
    plan["path"]["attachments"][0]["start"] //= 2


def _no_grasp(plan: dict[str, Any], row: int, joint: int) -> None:
    plan["path"]["attachments"] = []


def _another_grasp(plan: dict[str, Any], row: int, joint: int) -> None:
    plan["path"]["attachments"].append({"box": "blue", "gripper": "pr2L", "start": 0, "end": 1})


def _action_left_out(plan: dict[str, Any], row: int, joint: int) -> None:
    del plan["actions"][1], plan["keyframes"][1]


def _stands_still(plan: dict[str, Any], row: int, joint: int) -> None:
    plan["path"]["q"] = [plan["path"]["q"][0]] * len(plan["path"]["q"])


HARM = (
    *(_jump, _jump, _jump, _hurry, _degrees, _cut_out, _other_hand, _other_box, _other_table),
    *(_box_moved, _box_moved, _early_grasp, _no_grasp, _another_grasp, _action_left_out),
    _stands_still,
)


@examples(80)
@given(harm=st.sampled_from(HARM), row=st.integers(0, 10_000), joint=st.integers(0, 13))
def test_a_motion_that_was_tampered_with_does_not_verify(
    harm: Callable[[dict[str, Any], int, int], None],
    row: int,
    joint: int,
    document: dict[str, Any],
    folder: Path,
) -> None:
    """Whatever such a file says, it is not taken for a solution."""
    spoiled = copy.deepcopy(document)
    harm(spoiled, row % len(spoiled["path"]["times"]), joint)
    file = write_json(folder / "plan.json", spoiled)
    found = answer(lambda: read_plan(file), file)
    if found is not None:
        with World(found.scene) as world:
            assert verify_path(world, found.skeleton, found.trajectory).violation is not None


def test_the_plan_itself_verifies(written: Path) -> None:
    found = read_plan(written)
    check(found)
    with World(found.scene) as world:
        assert verify_path(world, found.skeleton, found.trajectory).violation is None
