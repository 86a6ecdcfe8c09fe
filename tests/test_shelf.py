"""The shelf task of another benchmark: its figures, the way there and back, and a row again."""

import math
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from guided_lgp import plan
from guided_lgp.documents import read_json
from guided_lgp.paths import METRICS
from guided_lgp.poses import Array, compose, inverse, pose
from guided_lgp.scene.validate import validate_scene

ROOT = Path(__file__).parents[1]
FILE = ROOT / METRICS / "shelf.json"

sys.path.append(str(ROOT / "benchmarks"))

import shelf  # noqa: E402
import shelf_scenes  # noqa: E402

HALF = math.sqrt(0.5)
GRIPPER = [0, 0, 0.12, 0.5, 0.5, 0.5, -0.5]
"""The hand's z axis is the x axis of the gripper's frame."""
START = [0, -math.pi / 4, 0, -3 * math.pi / 4, 0, math.pi / 2, math.pi / 4, 0, 0]
TURN = 0.4
"""Of the carton's sides in its frame (rad)."""
HANDLES = [[0, 0, z, *q] for z, q in ((0.04, [0, HALF, 0, HALF]), (-0.04, [0, -HALF, 0, HALF]))]


def rectangle(x: float, y: float, z: float, length: float, width: float) -> list[list[float]]:
    signs = ((1, 1), (-1, 1), (-1, -1), (1, -1))
    return [[x + a * length / 2, y + b * width / 2, z] for a, b in signs]


def task(*standing: str) -> dict[str, Any]:
    """A carton that is to go from a table onto a shelf, in the form of the package; and others."""
    turn = pose(np.zeros(3), TURN)
    corners = [[a * 0.03, b * 0.05, c * 0.08] for a in (-1, 1) for b in (-1, 1) for c in (-1, 1)]
    turned = compose(turn, np.array([[*corner, 0, 0, 0, 1] for corner in corners]))[:, :3]
    carton = {
        "name": "carton",
        "vertices": turned.tolist(),
        "corners": turned.tolist(),
        "handles": compose(turn, np.array(HANDLES)).tolist(),
        "start": pose([0.5, 0.2, 0.581], 0.3).tolist(),
        "goal": pose([0.5, -0.3, 0.681], -0.2).tolist(),
    }
    places = [pose([0.4 + 0.2 * n, 0.38, 0.581]).tolist() for n in range(len(standing))]
    others = [
        carton | {"name": name, "start": place, "goal": place}
        for name, place in zip(standing, places, strict=True)
    ]
    return {
        "name": "carton",
        "robot": {"base": [0, 0, 0.5, 0, 0, 0, 1], "joints": START, "gripper": GRIPPER},
        "surfaces": [
            {"name": "table", "corners": rectangle(0.5, 0.2, 0.5, 0.4, 0.5)},
            {"name": "shelf", "corners": rectangle(0.5, -0.4, 0.6, 0.4, 0.5)},
        ],
        "boxes": [
            {"name": "desk", "size": [0.4, 0.5, 0.03], "pose": [0.5, 0.2, 0.485, 0, 0, 0, 1]},
            {"name": "chest", "size": [0.4, 0.5, 0.6], "pose": [0.5, -0.4, 0.3, 0, 0, 0, 1]},
            {"name": "box", "size": [0.3, 0.2, 0.5], "pose": [-0.05, 0, 0.25, 0, 0, 0, 1]},
        ],
        "bodies": [carton, *others],
    }


def test_the_figures_are_those_of_the_rows() -> None:
    written = read_json(FILE)
    assert shelf.summary(written["rows"]) == written
    assert shelf.table(written) in (ROOT / shelf.PAGE).read_text(encoding="utf-8")
    assert written["rejected_by_its_check"] == 0
    assert written["solved"] <= written["problems"] == sum(r["problem"] for r in written["rows"])


def test_a_task_becomes_a_scene() -> None:
    scene = shelf_scenes.scene_of(task())
    validate_scene(scene)
    assert [table.name for table in scene.tables] == ["table", "shelf"]
    # the desk is the table; of the chest and the robot's box, what is below stays
    tops = {one.name: one.top[2] for one in scene.obstacles}
    assert tops == pytest.approx({"chest": 0.56, "box": 0.497})
    (box,) = scene.movable
    assert box.size == pytest.approx((0.06, 0.1, 0.161))
    assert (box.on, len(box.grasps)) == ("table", 1)  # nobody comes from below
    assert box.yaw == pytest.approx(0.3 + TURN)


def motion(given: dict[str, Any]) -> tuple[Array, Array]:
    """Joints and poses of a plan."""
    scene = shelf_scenes.scene_of(given)
    result = plan(scene, shelf_scenes.objective_of(given, scene))
    assert result.path is not None, result.explanation
    assert result.path.trajectory is not None
    return shelf_scenes.samples(given, scene, result.path.trajectory)


def test_a_motion_goes_back_as_the_package_wants_it() -> None:
    (body,), (joints, poses) = task()["bodies"], motion(task())
    assert joints[0] == pytest.approx(START, abs=1e-9)
    assert joints[-1] == pytest.approx(START, abs=1e-9)
    assert poses[0, 0] == pytest.approx(body["start"], abs=1e-6)
    assert np.abs(poses[-1, 0] - body["goal"]).max() < 1e-3
    assert len(joints) > 1000
    # where it stands neither at its start nor at its goal, the gripper is at the handle
    still = np.abs(poses - poses[0]).max(axis=(1, 2)) < 1e-9
    still |= np.abs(poses - poses[-1]).max(axis=(1, 2)) < 1e-9
    scene, handle = shelf_scenes.scene_of(task()), inverse(np.array(body["handles"][0]))
    hand = scene.robot.link_poses(joints[~still, :7], ["panda_hand"])[:, 0]
    held = compose(inverse(compose(hand, np.array(GRIPPER))), poses[~still, 0])
    assert len(held) > 100
    assert np.abs(held[:, :3] - handle[:3]).max() < 1e-6
    assert np.abs(held[:, 3:] @ handle[3:]) == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize(("standing", "most"), [((), 0.005), (("second", "third"), 0.001)])
def test_of_three_bodies_none_moves_by_more_than_the_package_sees(
    standing: tuple[str, ...], most: float
) -> None:
    _, poses = motion(task(*standing))
    steps = compose(inverse(poses[:-1]), poses[1:])
    assert 0.5 * most < np.abs(steps[..., :3]).max() < most
    assert 2 * np.abs(steps[..., 3:6]).max() < most
    assert np.ptp(poses[:, 1:], axis=0).max(initial=0.0) < 1e-9


@pytest.mark.skipif(not shelf.PYTHON.exists(), reason="make shelf installs the package")
def test_a_row_comes_out_again(tmp_path: Path) -> None:
    name = "shelf_0_5"
    (known,) = (r for r in read_json(FILE)["rows"] if (r["demonstration"], r["base"]) == (0, 5))
    (one,) = shelf.tasks(tmp_path, name)
    row = shelf.judged(name, shelf.answer(one, tmp_path / f"{name}.npz"), tmp_path)
    assert {**row, "seconds": 0} == {**known, "seconds": 0}
