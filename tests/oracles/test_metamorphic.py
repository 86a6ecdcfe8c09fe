"""What must not change an answer: where the world's origin is, which side is left, names, order,
which of two equal descriptions of a body is given, and the direction of time.
"""

import json
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from plan_checker import check

from guided_lgp import plan
from guided_lgp.bounds.execution import final_boxes
from guided_lgp.bounds.plan_file import write_plan
from guided_lgp.bounds.results import Attachment, PathResult, Trajectory
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.bounds.verify import verify_path
from guided_lgp.logic import (
    Action,
    Skeleton,
    applicable_actions,
    format_skeleton,
    parse_objective,
    parse_skeleton,
    progress,
    successor,
)
from guided_lgp.params import load_params
from guided_lgp.paths import SOURCES
from guided_lgp.poses import compose, pose, yaw_of
from guided_lgp.scene import Scene, generate, load_scene
from guided_lgp.scene.world import World

ROOT = Path(__file__).parents[2]
PARAMS = load_params(SOURCES / "params.yaml").bounds
OTHER = {"pr2L": "pr2R", "pr2R": "pr2L"}
NAMES = {"red": "003_cracker_box", "green": "a", "blue": "Zebra", "yellow": "mug.001"}


def changed(scene: Scene, change: Callable[[dict[str, object]], dict[str, object]]) -> Scene:
    """The scene with every body changed."""
    document = scene.model_dump(mode="json")
    parts = {part: [change(body) for body in document[part]] for part in ("tables", "boxes")}
    return Scene.model_validate(document | parts)


def moved(scene: Scene) -> Scene:
    """Somewhere else, turned, with the robot."""
    frame = pose((1.3, -0.7, 0.0), 2.1)

    def change(body: dict[str, object]) -> dict[str, object]:
        there = compose(frame, pose(body["position"], body["yaw"]))
        return body | {"position": there[:3].tolist(), "yaw": float(yaw_of(there))}

    robot = scene.robot.model_copy(update={"base": (1.3, -0.7, 2.1)})
    return changed(scene, change).model_copy(update={"robot": robot})


def mirrored(scene: Scene) -> Scene:
    """At the plane between the arms."""

    def change(body: dict[str, object]) -> dict[str, object]:
        x, y, z = body["position"]
        return body | {"position": [x, -y, z], "yaw": -body["yaw"]}

    return changed(scene, change)


def redeclared(scene: Scene) -> Scene:
    """Boxes by another corner: turned by a half, and every other one by a quarter."""
    number = iter(range(100))

    def change(body: dict[str, object]) -> dict[str, object]:
        if "size" not in body:
            return body
        x, y, z = body["size"]
        if next(number) % 2:
            return body | {"yaw": body["yaw"] - np.pi}
        return body | {"size": [y, x, z], "yaw": body["yaw"] + np.pi / 2}

    return changed(scene, change)


def renamed(scene: Scene) -> Scene:
    def change(body: dict[str, object]) -> dict[str, object]:
        names = {key: NAMES.get(body[key], body[key]) for key in ("name", "on") if key in body}
        return body | names

    return changed(scene, change)


def with_names(skeleton: Skeleton, names: dict[str, str]) -> Skeleton:
    return tuple(
        Action(action.instruction, tuple(names.get(name, name) for name in action.symbols))
        for action in skeleton
    )


def random_skeletons(scene: Scene, length: int, count: int) -> Iterator[Skeleton]:
    for number in range(count):
        rng, state = np.random.default_rng([11, length, number]), scene.state
        skeleton: Skeleton = ()
        for _ in range(length):
            actions = list(applicable_actions(state, scene.symbols))
            skeleton = (*skeleton, actions[rng.integers(len(actions))])
            state = successor(state, skeleton[-1])
        yield skeleton


SCENES = [
    (generate(setup, 1, 8, "meta").scenes[0], length) for setup, length in (("a", 4), ("b", 6))
]


@pytest.mark.parametrize(
    ("change", "names"),
    [(moved, {}), (mirrored, OTHER), (redeclared, {}), (renamed, NAMES)],
    ids=["moved", "mirrored", "redeclared", "renamed"],
)
def test_verdicts_stay(change: Callable[[Scene], Scene], names: dict[str, str]) -> None:
    verdicts = []
    for scene, length in SCENES:
        before, after = SceneBounds(scene, PARAMS), SceneBounds(change(scene), PARAMS)
        for skeleton in random_skeletons(scene, length, 8):
            verdict = before.coarse(skeleton).feasible
            same = after.coarse(with_names(skeleton, names)).feasible
            assert same == verdict, format_skeleton(skeleton)
            verdicts.append(verdict)
    assert 0.2 < np.mean(verdicts) < 0.8


@pytest.mark.parametrize("goals", [["(on red green)"], ["(on blue red)", "(on green tab2)"]])
def test_names_and_order_do_not_change_a_plan(goals: list[str]) -> None:
    scene = load_scene(ROOT / "examples" / "three_boxes.json")
    found = plan(scene, goals)
    assert found.skeleton is not None
    texts = goals
    for name, other in NAMES.items():
        texts = [text.replace(name, other) for text in texts]
    other = plan(renamed(scene), texts)
    assert other.skeleton == with_names(found.skeleton, NAMES)
    turned = scene.model_copy(update={"boxes": scene.boxes[::-1], "tables": scene.tables[::-1]})
    assert plan(turned, goals).skeleton == found.skeleton


@pytest.mark.parametrize("yaw", [0.0, 0.3, 1.2])
def test_a_can_turned_about_its_axis_is_the_same(tmp_path: Path, yaw: float) -> None:
    scene = load_scene(ROOT / "tests" / "cases" / "can_between_walls.json")
    (can,) = scene.boxes
    turned = scene.model_copy(update={"boxes": (can.model_copy(update={"yaw": yaw}),)})
    found = plan(turned, "(on can right)")
    assert found.path is not None, found.explanation
    write_plan(tmp_path / "plan.json", turned, found.objective, found.path, {})
    assert check(json.loads((tmp_path / "plan.json").read_text())) == []


def backwards(
    scene: Scene, skeleton: Skeleton, trajectory: Trajectory
) -> tuple[Scene, Skeleton, Trajectory]:
    """What happens if a film of the plan runs backwards."""
    ends = final_boxes(scene, trajectory)
    state = progress(scene.state, skeleton)
    boxes = tuple(
        box.model_copy(
            update={
                "position": tuple(ends[box.name][:3].tolist()),
                "yaw": float(yaw_of(ends[box.name])),
                "on": state.support_of(box.name),
            }
        )
        for box in scene.boxes
    )
    undone, before = list[Action](), scene.state
    for action in skeleton:
        if action.instruction == "grasp":
            support = before.support_of(action.symbols[1])
            assert support is not None
            undone.append(Action("place", (*action.symbols, support)))
        elif action.instruction == "place":
            undone.append(Action("grasp", action.symbols[:2]))
        else:
            taker, giver, body = action.symbols
            undone.append(Action("take", (giver, taker, body)))
        before = successor(before, action)
    last = len(trajectory.times) - 1
    reversed_motion = Trajectory(
        trajectory.joint_names,
        trajectory.times[-1] - trajectory.times[::-1],
        trajectory.q[::-1],
        tuple(
            Attachment(a.box, a.gripper, last - a.end, last - a.start)
            for a in trajectory.attachments
        ),
    )
    end = scene.model_copy(update={"boxes": boxes})
    return end, tuple(reversed(undone)), reversed_motion


HAND_OVER = generate("a", 1, 77, "handover").scenes[0].model_copy(update={"domain": "handover"})


@pytest.mark.parametrize(
    ("scene", "skeleton", "goal"),
    [
        (
            HAND_OVER,
            "(grasp pr2L green) (take pr2R pr2L green) (place pr2R green blue)",
            "(on green tab1)",
        ),
        ("examples/three_boxes.json", "(grasp pr2L red) (place pr2L red green)", "(on red tab1)"),
        (
            "examples/four_boxes_and_tray.json",
            "(grasp pr2L red) (place pr2L red tray) (grasp pr2L green) (place pr2L green red)",
            "(on green tab1)",
        ),
        # A plan into a shelf is one out of it.
        (
            "tests/cases/into_shelf_24cm.json",
            "(grasp pr2L red) (place pr2L red board)",
            "(on red left)",
        ),
        (
            "tests/cases/out_of_shelf_24cm.json",
            "(grasp pr2R red) (place pr2R red left)",
            "(on red board)",
        ),
    ],
)
def test_a_plan_backwards_is_a_plan(
    tmp_path: Path, scene: str | Scene, skeleton: str, goal: str
) -> None:
    start = scene if isinstance(scene, Scene) else load_scene(ROOT / scene)
    actions = parse_skeleton(skeleton)
    found = SceneBounds(start, PARAMS).path(actions)
    assert found.trajectory is not None, found.failure
    end, undone, trajectory = backwards(start, actions, found.trajectory)
    with World(end) as world:
        assert verify_path(world, undone, trajectory).violation is None
    bounds = SceneBounds(end, PARAMS)
    coarse = bounds.coarse(undone)
    assert coarse.feasible, coarse.failure
    result = PathResult(undone, True, trajectory, coarse.at_switch)
    write_plan(tmp_path / "plan.json", end, parse_objective([goal]), result, {})
    faults = check(json.loads((tmp_path / "plan.json").read_text()))
    assert [fault for fault in faults if fault.kind != "keyframe"] == []
