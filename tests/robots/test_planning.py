"""Robots that the planner was not written for: plans are found, verified and carried out."""

from pathlib import Path

import numpy as np
import pytest

import guided_lgp.robots as robots_folder
from guided_lgp.bounds.execution import execute
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.logic import parse_objective, parse_skeleton
from guided_lgp.params import load_params
from guided_lgp.paths import SOURCES
from guided_lgp.robots import load_robot
from guided_lgp.scene import Box, PlacedRobot, Scene, Table
from guided_lgp.scene.validate import validate_scene

_WIDTHS = {"panda": 0.06, "ur5": 0.05}
"""Of the boxes (m), by robot: the UR5's jaws do not move."""


def scene(robot: str, base: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Scene:
    """Two boxes on one of two tables before a robot with one arm."""
    x, y, yaw = base
    turn = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])

    def at(ahead: float, aside: float, height: float) -> tuple[float, float, float]:
        moved = turn @ (ahead, aside) + (x, y)
        return float(moved[0]), float(moved[1]), height

    size = (0.12, _WIDTHS[robot], 0.08)
    tables = {"tab1": 0.27, "tab2": -0.27}
    places = {"red": (0.45, 0.2, 0.3), "green": (0.55, 0.38, -0.8)}
    return Scene(
        robot=PlacedRobot(model=robot, base=base),
        tables=tuple(
            Table(name=name, position=at(0.5, aside, 0.15), half_extents=(0.15, 0.2), yaw=yaw)
            for name, aside in tables.items()
        ),
        boxes=tuple(
            Box(name=name, size=size, position=at(px, py, 0.19), yaw=yaw + turned, on="tab1")
            for name, (px, py, turned) in places.items()
        ),
    )


@pytest.mark.parametrize("robot", _WIDTHS)
def test_a_plan_is_verified_and_carried_out(robot: str) -> None:
    placed = scene(robot, base=(0.2, -0.1, 0.7))
    validate_scene(placed)
    bounds = SceneBounds(placed, load_params(SOURCES / "params.yaml").bounds)
    skeleton = parse_skeleton(
        f"(grasp {robot} green) (place {robot} green tab2) "
        f"(grasp {robot} red) (place {robot} red green)"
    )
    result = bounds.path(skeleton)
    assert result.trajectory is not None, result.failure
    goals = parse_objective(["(on green tab2)", "(on red green)"])
    assert execute(placed, goals, skeleton, result.trajectory).success


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
