"""Arms that misplace boxes: only what is put down ends beside its place."""

import numpy as np
import pytest
from motions import scene

from guided_lgp.bounds.execution.noise import misplaced
from guided_lgp.bounds.results import Trajectory
from guided_lgp.logic import parse_skeleton
from guided_lgp.robots import load_robot

SCENE = scene(red=(0.52, 0.30, 0.65, 0.2, "tab1")).model_copy(update={"domain": "handover"})
ROBOT = load_robot("pr2")
STILL = Trajectory(
    ROBOT.moving_joints,
    np.arange(9.0),
    np.tile([*ROBOT.home, *(0.0 for _ in ROBOT.moving_joints[len(ROBOT.home) :])], (9, 1)),
    (),
)
"""8 s at home: what counts is which actions there are, at rows 2 and 5."""


@pytest.mark.parametrize(
    ("last", "moves"),
    [("(place pr2L red tab2)", True), ("(take pr2R pr2L red)", False)],
)
def test_a_box_that_goes_from_hand_to_hand_is_not_misplaced(last: str, moves: bool) -> None:
    skeleton = parse_skeleton(f"(grasp pr2L red) {last}")
    noisy = misplaced(SCENE, skeleton, [2, 5], STILL, 0.005, seed=1)
    off = np.abs(noisy.q - STILL.q).max(axis=1)
    assert (off[5] > 0) is np.bool_(moves)
    assert off[[0, 1, 2, 8]].max() == 0
    tools = [SCENE.robot.tool_poses(q[:, : len(ROBOT.home)])["pr2L"] for q in (noisy.q, STILL.q)]
    shift = (tools[0] - tools[1])[5, :3]
    assert (0.001 < np.linalg.norm(shift) < 0.02) is np.bool_(moves)
    assert abs(shift[2]) < 0.001
