"""Every robot that ships: a plan is found, verified, accepted by the checker, and carried out."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from plan_checker import check

import guided_lgp.robots as robots_folder
from guided_lgp.bounds.execution import execute
from guided_lgp.bounds.plan_file import write_plan
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.bounds.verify import efforts
from guided_lgp.bounds.verify.attachments import switches_of
from guided_lgp.bounds.verify.joints import rows_outside_limits
from guided_lgp.documents import read_json
from guided_lgp.logic import Skeleton, parse_objective, parse_skeleton
from guided_lgp.params import load_params
from guided_lgp.paths import EXAMPLES, SOURCES
from guided_lgp.planning import plan
from guided_lgp.robots import load_robot, robot_names
from guided_lgp.scene import Box, PlacedRobot, Scene, Table
from guided_lgp.scene.validate import validate_scene


@dataclass(frozen=True)
class Layout:
    """Where a robot works: tables ahead of it, and boxes that its hand can hold."""

    gripper: str
    ahead: float
    """Of the tables' centres (m)."""
    height: float
    """Of their tops (m)."""
    width: float
    """Of the boxes (m)."""


LAYOUTS = {
    "baxter": Layout("left", ahead=0.62, height=-0.10, width=0.04),
    "panda": Layout("panda", ahead=0.50, height=0.15, width=0.06),
    "pr2": Layout("pr2L", ahead=0.54, height=0.60, width=0.07),
    "ur5": Layout("ur5", ahead=0.50, height=0.15, width=0.05),
}


def scene(robot: str, base: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Scene:
    """Two boxes on one of two tables before a robot."""
    layout, (x, y, yaw) = LAYOUTS[robot], base
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])

    def at(ahead: float, aside: float, up: float) -> tuple[float, float, float]:
        moved = turn @ (layout.ahead + ahead, aside) + (x, y)
        return float(moved[0]), float(moved[1]), layout.height + up

    size = (0.12, layout.width, 0.08)
    tables = {"tab1": 0.27, "tab2": -0.27}
    places = {"red": (-0.05, 0.2, 0.3), "green": (0.05, 0.38, -0.8)}
    return Scene(
        robot=PlacedRobot(model=robot, base=base),
        tables=tuple(
            Table(name=name, position=at(0, aside, 0), half_extents=(0.15, 0.2), yaw=yaw)
            for name, aside in tables.items()
        ),
        boxes=tuple(
            Box(name=name, size=size, position=at(px, py, 0.04), yaw=yaw + turned, on="tab1")
            for name, (px, py, turned) in places.items()
        ),
    )


@pytest.mark.parametrize("robot", robot_names())
def test_a_plan_is_verified_accepted_and_carried_out(robot: str, tmp_path: Path) -> None:
    assert robot in LAYOUTS, f"no layout in which the robot {robot} plans"
    placed, hand = scene(robot, base=(0.2, -0.1, 0.7)), LAYOUTS[robot].gripper
    validate_scene(placed)
    bounds = SceneBounds(placed, load_params(SOURCES / "params.yaml").bounds)
    skeleton = parse_skeleton(
        f"(grasp {hand} green) (place {hand} green tab2) "
        f"(grasp {hand} red) (place {hand} red green)"
    )
    result = bounds.path(skeleton)
    assert result.trajectory is not None, result.failure
    goals = parse_objective(["(on green tab2)", "(on red green)"])
    file = tmp_path / "plan.json"
    write_plan(file, placed, goals, result, {})
    assert check(read_json(file, "the plan")) == []
    assert execute(placed, goals, skeleton, result.trajectory).success


def _baxter(ahead: float) -> tuple[SceneBounds, Skeleton]:
    """A box that the left arm takes somewhere ahead (m), and puts down again."""
    near = scene("baxter")
    red = near.boxes[0].model_copy(update={"position": (ahead, 0.40, -0.06), "yaw": -1.3})
    placed = near.model_copy(update={"boxes": (red,)})
    skeleton = parse_skeleton("(grasp left red) (place left red tab1)")
    return SceneBounds(placed, load_params(SOURCES / "params.yaml").bounds), skeleton


def test_a_stretched_arm_moves_as_slowly_as_its_motors_need() -> None:
    bounds, skeleton = _baxter(0.74)
    result = bounds.path(skeleton)
    assert result.trajectory is not None, result.failure
    times, q = result.trajectory.times, result.trajectory.q
    switches = switches_of(bounds.scene, skeleton, result.trajectory)
    assert isinstance(switches, list)
    assert not rows_outside_limits(bounds.scene, skeleton, switches, q, times)["effort"]
    assert rows_outside_limits(bounds.scene, skeleton, switches, q, times / 2)["effort"]


def test_what_motors_cannot_hold_is_infeasible(monkeypatch: pytest.MonkeyPatch) -> None:
    bounds, skeleton = _baxter(0.62)
    assert bounds.coarse(skeleton).feasible
    monkeypatch.setattr(efforts, "BOX_DENSITY", 20_000.0)  # kg/m³: as heavy as gold
    result = _baxter(0.62)[0].coarse(skeleton)
    assert not result.feasible
    assert str(result.failure).startswith("action 1: effort left_")


def test_what_the_arm_cannot_reach_is_infeasible() -> None:
    near = scene("panda")
    far = Table(name="tab2", position=(1.5, 0.0, 0.15), half_extents=(0.15, 0.2))
    placed = near.model_copy(update={"tables": (near.tables[0], far)})
    bounds = SceneBounds(placed, load_params(SOURCES / "params.yaml").bounds)
    result = bounds.coarse(parse_skeleton("(grasp panda red) (place panda red tab2)"))
    assert not result.feasible


def test_what_a_file_states_goes_before_what_is_derived(tmp_path: Path) -> None:
    derived = load_robot("panda").arms["panda"]
    robots = Path(robots_folder.__file__).parent
    text = (robots / "panda.yaml").read_text().replace("../shipped", str(robots / "../shipped"))
    file = tmp_path / "mine.yaml"
    file.write_text(text + "    hand_radius: 0.2\n    lever_arms: [1, 1, 1, 1, 1, 1, 1]\n")
    arm = load_robot(str(file)).arms["panda"]
    assert arm.hand_radius == 0.2
    assert arm.lever_arms.tolist() == [1.0] * 7
    assert arm.palm_front == derived.palm_front


def test_a_policy_trained_with_one_robot_guides_another() -> None:
    """Greedy: four actions, and no more nodes than their children."""
    goals = ["(on blue green)", "(on red blue)"]
    result = plan(EXAMPLES / "panda.json", goals, "guided", policy="relational")
    assert result.solved, result.explanation
    assert result.skeleton is not None
    assert len(result.skeleton) == 4
    assert result.tree_size < 30
