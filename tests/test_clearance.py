"""How near plans come to what they do not touch."""

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent / "bounds"))
from motions import CLOSED, PR2, Motion, from_above, reach, scene, shifted

from guided_lgp import plan
from guided_lgp.bounds.verify import verify_path
from guided_lgp.bounds.verify.phase import Phase
from guided_lgp.clearance import _SLACK, _asked, clearance_of, verify_apart
from guided_lgp.errors import InputError
from guided_lgp.logic import parse_skeleton
from guided_lgp.scene.world import initial_poses, world_of

SCENE = scene(red=(0.52, 0.30, 0.65, 0.2, "tab1"), green=(0.52, -0.30, 0.65, 0.1, "tab2"))
BOTH = parse_skeleton("(grasp pr2L red) (grasp pr2R green)")
HANDS = {"pr2L": "red", "pr2R": "green"}


def both_grasped(lift: float) -> Motion:
    """Both hands close before the first of them lifts."""
    motion, boxes = Motion(SCENE), {box.name: box for box in SCENE.boxes}
    above = {}
    for gripper, box in HANDS.items():
        tool = from_above(boxes[box], gripper)
        at = reach(SCENE, gripper, tool)
        above[gripper] = reach(SCENE, gripper, shifted(tool, z=lift), at)
        high = reach(SCENE, gripper, shifted(tool, z=0.15), at)
        motion.move(gripper, high).move(gripper, at).hand(gripper, CLOSED).attach(box, gripper)
    for gripper in HANDS:
        motion.move(gripper, above[gripper])
    return motion


def test_a_box_keeps_no_distance_from_its_table_as_it_is_lifted() -> None:
    """Also after another hand has acted; what it comes nearest to then is something else."""
    found = clearance_of(SCENE, BOTH, both_grasped(0.10).trajectory())
    assert found.distance > 0.005
    assert (found.part, found.body) != ("red", "tab1")


@pytest.mark.parametrize("wished", [0.0, 0.002, 0.06, float("nan")])
def test_a_clearance_that_cannot_be_wished_is_refused(wished: float) -> None:
    with pytest.raises(InputError, match=r"clearance: .* out of range \(accepted: 0.003 to 0.05\)"):
        plan(SCENE, "(held red)", clearance=wished)


def test_a_box_that_comes_back_to_its_table_is_near_it() -> None:
    motion = both_grasped(0.10)
    tool = from_above(SCENE.boxes[0], "pr2L")
    low = reach(SCENE, "pr2L", shifted(tool, y=0.06, z=0.004), motion.q[PR2.arms["pr2L"].slice])
    found = clearance_of(SCENE, BOTH, motion.move("pr2L", low).trajectory())
    assert (found.part, found.body) == ("red", "tab1")
    assert found.distance == pytest.approx(0.004, abs=0.002)


@pytest.mark.parametrize(("height", "refused"), [(0.0004, True), (0.004, False)])
def test_what_comes_nearer_than_a_millimetre_is_refused_by_name(
    height: float, refused: bool
) -> None:
    """Penetration is tolerated by verification up to 5 mm: plans of users keep a distance."""
    motion = both_grasped(0.10)
    tool = from_above(SCENE.boxes[0], "pr2L")
    low = shifted(tool, y=0.06, z=height)
    motion.move("pr2L", reach(SCENE, "pr2L", low, motion.q[PR2.arms["pr2L"].slice]))
    trajectory = motion.trajectory()
    assert verify_path(world_of(SCENE), BOTH, trajectory).violation is None
    found = verify_apart(world_of(SCENE), BOTH, trajectory).violation
    assert (found is not None) == refused
    if found is not None:
        assert found.constraint == "beside red tab1"
        assert 0 < found.amount <= 0.001
        assert found.action == 1


def test_what_stands_nearer_at_the_start_may_be_lifted_off() -> None:
    near = scene(red=(0.46, 0.30, 0.65, 0.0, "tab1"), green=(0.6104, 0.30, 0.65, 0.0, "tab1"))
    red, green = near.boxes
    assert 0 < abs(red.position[0] - green.position[0]) - red.size[0] < 0.001
    found = plan(near, "(held red)")
    assert found.solved
    assert found.clearance is not None
    assert found.clearance.distance < 0.001


def test_nothing_is_nearer_than_the_smallest_clearance() -> None:
    """Measured in PyBullet for all that should not touch; coal only says where to look first."""
    trajectory = both_grasped(0.10).trajectory()
    found, world = clearance_of(SCENE, BOTH, trajectory), world_of(SCENE)
    q = trajectory.joints(PR2.moving_joints)
    phase = Phase(SCENE, SCENE.state, initial_poses(SCENE), q[:40], trajectory.times[:40])
    samples = np.arange(len(phase.q))
    pairs, least = phase.gaps(samples)
    asked = _asked(phase, samples, pairs, [set()] * len(samples), ())
    assert asked.any(axis=0).sum() > 20
    for sample in samples[::5].tolist():
        phase.show(world, sample, everything=True)
        for number in np.flatnonzero(asked[sample]).tolist():
            distance = world.distance(*pairs[number], limit=5.0)
            assert distance > least[sample, number] - _SLACK
            assert distance > found.distance - 1e-9
