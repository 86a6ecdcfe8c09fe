"""A plan out of a shelf, reversed in time, is a plan into it: one verdict for both."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from guided_lgp import plan
from guided_lgp.bounds.execution import final_boxes
from guided_lgp.bounds.results import Attachment, Trajectory
from guided_lgp.bounds.verify import verify_path
from guided_lgp.logic import Action, Skeleton
from guided_lgp.poses import Array, yaw_of
from guided_lgp.scene import Scene, load_scene
from guided_lgp.scene.world import World

CASES = Path(__file__).parent / "cases"


def reversed_in_time(trajectory: Trajectory) -> Trajectory:
    last = len(trajectory.times) - 1
    return replace(
        trajectory,
        times=trajectory.times[-1] - trajectory.times[::-1],
        q=trajectory.q[::-1],
        attachments=tuple(
            Attachment(a.box, a.gripper, last - a.end, last - a.start)
            for a in trajectory.attachments
        ),
    )


def ended(scene: Scene, boxes: dict[str, Array], on: str) -> Scene:
    """The scene at the end of a plan that puts its only box on something else."""
    (box,) = scene.boxes
    place = boxes[box.name]
    position = tuple(float(value) for value in place[:3])
    moved = box.model_copy(update={"position": position, "yaw": float(yaw_of(place)), "on": on})
    return scene.model_copy(update={"boxes": (moved,)})


@pytest.mark.parametrize("name", ["out_of_shelf_24cm", "out_of_low_shelf"])
def test_a_plan_out_of_a_shelf_is_reversed_one_into_it(name: str) -> None:
    scene = load_scene(CASES / f"{name}.json")
    found = plan(scene, "(on red left)")
    assert found.path is not None
    trajectory = found.path.trajectory
    assert trajectory is not None
    hand, red = found.path.skeleton[0].symbols
    skeleton: Skeleton = (Action("grasp", (hand, red)), Action("place", (hand, red, "board")))
    turned_round = ended(scene, final_boxes(scene, trajectory), "left")
    with World(turned_round) as world:
        report = verify_path(world, skeleton, reversed_in_time(trajectory))
    assert report.violation is None
    assert plan(turned_round, "(on red board)").solved


def test_a_reversed_plan_that_leaves_its_box_elsewhere_is_refused() -> None:
    scene = load_scene(CASES / "out_of_shelf_24cm.json")
    found = plan(scene, "(on red left)")
    assert found.path is not None
    assert found.path.trajectory is not None
    boxes = final_boxes(scene, found.path.trajectory)
    boxes["red"] = boxes["red"] + np.array([0.03, 0, 0, 0, 0, 0, 0])
    hand, red = found.path.skeleton[0].symbols
    skeleton: Skeleton = (Action("grasp", (hand, red)), Action("place", (hand, red, "board")))
    with World(ended(scene, boxes, "left")) as world:
        report = verify_path(world, skeleton, reversed_in_time(found.path.trajectory))
    assert report.violation is not None
