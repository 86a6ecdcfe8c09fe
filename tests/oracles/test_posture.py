"""Goals that say where arms end: read, planned for, and judged by the checker."""

import json
from pathlib import Path

import numpy as np
import pytest
from plan_checker import check

from guided_lgp import plan
from guided_lgp.bounds.execution import execute
from guided_lgp.bounds.goals import GoalTerms
from guided_lgp.bounds.plan_file import read_plan, write_plan
from guided_lgp.bounds.verify import verify_path
from guided_lgp.errors import InputError
from guided_lgp.logic import parse_objective
from guided_lgp.planning import PlanningResult
from guided_lgp.scene import load_scene
from guided_lgp.scene.world import World

SCENE = load_scene(Path(__file__).parents[2] / "examples" / "panda.json")
(BOX, *_), (TABLE, *_) = (box.name for box in SCENE.boxes), (t.name for t in SCENE.tables)
ASIDE = [0.8, -0.5, 0.1, -2.0, 0.0, 1.7, 0.5]
HOME = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]


def posture(values: list[float]) -> str:
    return f"(posture panda {' '.join(map(str, values))})"


def planned(*goals: str) -> PlanningResult:
    result = plan(SCENE, goals)
    assert result.path is not None, result.explanation
    return result


@pytest.mark.parametrize("goals", [(), (f"(held {BOX})",)])
def test_the_arm_ends_there(goals: tuple[str, ...], tmp_path: Path) -> None:
    result = planned(*goals, posture(ASIDE))
    assert len(result.skeleton) == len(goals)
    assert result.path is not None
    write_plan(tmp_path / "plan.json", SCENE, result.objective, result.path, {})
    document = json.loads((tmp_path / "plan.json").read_text())
    assert check(document) == []
    assert np.allclose(read_plan(tmp_path / "plan.json").trajectory.q[-1, :7], ASIDE, atol=1e-6)
    document["objective"][-1] = posture([ASIDE[0] + 0.01, *ASIDE[1:]])
    assert [fault.kind for fault in check(document)] == ["goal"]


def test_where_it_is_already_nothing_moves() -> None:
    result = planned(posture(HOME))
    assert result.path is not None
    assert result.path.trajectory is not None
    assert np.ptp(result.path.trajectory.q, axis=0).max() == 0


def test_verification_looks_at_it() -> None:
    result = planned(f"(held {BOX})")
    assert result.path is not None
    assert result.path.trajectory is not None
    goals = GoalTerms.of(parse_objective([posture(ASIDE)]), SCENE.symbols.domain)
    with World(SCENE) as world:
        fault = verify_path(world, result.skeleton, result.path.trajectory, goals).violation
    assert fault is not None
    assert fault.constraint == "posture panda"
    assert fault.amount == pytest.approx(0.8, abs=1e-6)


def test_its_execution_looks_at_the_joints() -> None:
    result = planned(posture(ASIDE))
    assert result.path is not None
    assert result.path.trajectory is not None
    aside, home = posture(ASIDE), posture(HOME)
    objective = parse_objective([aside, home])
    report = execute(SCENE, objective, result.skeleton, result.path.trajectory)
    assert dict(report.goals) == {str(objective[0]): True, str(objective[1]): False}
    assert not report.success


def test_a_posture_inside_something_is_the_reason() -> None:
    result = plan(SCENE, [posture([0.0, 1.2, 0.0, -1.2, 0.0, 2.5, 0.785])])
    assert not result.solved
    assert result.explanation == "no motion found to the posture at the end"


@pytest.mark.parametrize(
    ("goals", "fault"),
    [
        (["(posture panda 0 0)"], "2 values for 7 joints .accepted: panda_joint1, "),
        (["(posture panda)"], r"is not a goal .*\(posture gripper joint \.\.\.\)"),
        ([f"(posture {BOX} 0)"], "unknown gripper"),
        ([posture([4.0, *HOME[1:]])], r"panda_joint1 is 4.0 \(accepted: -2.897 to 2.897"),
        (["(posture panda a b c d e f g)"], "joint1 is 'a'"),
        ([posture(HOME), posture(ASIDE)], "panda is to end in two postures"),
    ],
)
def test_what_is_no_posture_is_told(goals: list[str], fault: str) -> None:
    with pytest.raises(InputError, match=fault):
        plan(SCENE, goals)
