"""Of several motions the one whose grips hold is taken."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest

from guided_lgp.bounds.checks import box_bodies
from guided_lgp.bounds.execution.forces import grips_of
from guided_lgp.bounds.path import Style
from guided_lgp.bounds.path.firm import firmest
from guided_lgp.bounds.plan_file import write_plan
from guided_lgp.bounds.results import CoarseResult, PathResult
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.bounds.terms.steady import RATIO, check
from guided_lgp.bounds.verify.attachments import switches_of
from guided_lgp.cli.app import main
from guided_lgp.logic import parse_skeleton
from guided_lgp.params import load_planning
from guided_lgp.scene.generate import generate

(SCENE,) = generate("a", 1, 30_003, "execution-003").scenes
LOADED = parse_skeleton(
    "(grasp pr2R green) (place pr2R green red) (grasp pr2R red) (grasp pr2L green)"
)
"""The coarse solution has red held so far from its middle that green turns it in the hand."""


@cache
def motion(firm: bool) -> PathResult:
    return SceneBounds(SCENE, load_planning().bounds, style=Style(firm=firm)).path(LOADED)


def load(found: PathResult) -> float:
    assert found.trajectory is not None
    rows = switches_of(SCENE, LOADED, found.trajectory)
    assert isinstance(rows, list)
    return max(grip.ratio for grip in grips_of(SCENE, LOADED, rows, found.trajectory))


def test_a_stack_is_held_where_the_pads_can_carry_it() -> None:
    assert load(motion(firm=False)) > 0.6
    assert load(motion(firm=True)) == pytest.approx(RATIO, abs=1e-6)


def test_a_grip_that_does_not_hold_is_refused_by_name() -> None:
    refused = firmest(SCENE, iter([motion(firm=False)]))
    assert refused is not None
    assert not refused.feasible
    assert refused.failure is not None
    assert refused.failure.constraint == "grip pr2R red"
    assert refused.failure.action == 2
    assert refused.failure.violation > 0.1
    assert firmest(SCENE, iter([])) is None


def test_a_foreign_plan_whose_grip_does_not_hold_is_not_carried_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "plan.json"
    write_plan(file, SCENE, (), motion(firm=False), {})
    with pytest.raises(SystemExit) as ended:
        main(("execute", str(file), "--grip", "friction"))
    assert ended.value.code == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert "plan.json: is not carried out: grip pr2R red by " in line


def test_the_firmest_is_taken_where_none_holds_firmly(monkeypatch: pytest.MonkeyPatch) -> None:
    loose = motion(firm=False)
    monkeypatch.setattr("guided_lgp.bounds.execution.forces.MOST", load(loose))
    found = firmest(SCENE, iter([loose]))
    assert found is not None
    assert found.trajectory is loose.trajectory


def test_the_next_motion_is_taken_where_one_does_not_hold() -> None:
    motions = iter([motion(firm=False), motion(firm=True), motion(firm=False)])
    found = firmest(SCENE, motions)
    assert found is not None
    assert found.trajectory is motion(firm=True).trajectory
    assert found.load > 20
    assert len(list(motions)) == 1


def test_the_program_takes_the_box_nearer_to_what_it_will_carry() -> None:
    """The verdict on the sequence is the same; then red is held where green does not turn it."""
    bound = SceneBounds(SCENE, load_planning().bounds, style=Style(firm=True))
    for length in range(1, len(LOADED) + 1):
        plain = bound.coarse(LOADED[:length])
    assert plain.feasible
    paper = SceneBounds(SCENE, load_planning().bounds).coarse(LOADED)
    assert np.array_equal(plain.at_switch[2].q, paper.at_switch[2].q)
    first, steady, again = bound._coarse_bound.near(plain)
    assert first is again is plain, "the second time for grips that load the pads least"
    assert steady.feasible
    assert at_rest(plain) > 0.6
    assert at_rest(steady) < 0.5


def at_rest(found: CoarseResult) -> float:
    """The share of what its pads can carry that the hand with red needs, green on it."""
    keyframe, bodies = found.after_action[2], box_bodies(SCENE)
    tool = SCENE.robot.tool_pose(keyframe.q, "pr2R").tolist()
    loads = [(bodies[box].volume, tuple(keyframe.boxes[box][:3])) for box in ("red", "green")]
    fingers = SCENE.robot.description.arms["pr2R"].fingers
    return check(bodies["red"], keyframe.boxes["red"].tolist(), tool, fingers, loads)
