"""The coarse bound with robots of one arm: six or seven joints, solved by the general formulas."""

import numpy as np
import pytest

from guided_lgp.bounds.coarse import CoarseBound
from guided_lgp.bounds.coarse.formulation import Formulator
from guided_lgp.bounds.program.geometry import Margins, SceneGeometry
from guided_lgp.bounds.verify import verify_keyframes
from guided_lgp.logic import parse_skeleton
from guided_lgp.scene import Box, PlacedRobot, Scene, Table
from guided_lgp.scene.world import World


def _scene(robot: str) -> Scene:
    return Scene(
        robot=PlacedRobot(model=robot),
        tables=(
            Table(name="tab1", position=(0.45, 0.27, 0.15), half_extents=(0.17, 0.22)),
            Table(name="tab2", position=(0.45, -0.27, 0.15), half_extents=(0.17, 0.22)),
        ),
        boxes=(
            Box(name="red", size=(0.12, 0.05, 0.08), position=(0.42, 0.2, 0.19), on="tab1"),
            Box(name="blue", size=(0.12, 0.05, 0.08), position=(0.48, -0.25, 0.19), on="tab2"),
        ),
    )


@pytest.mark.parametrize("robot", ["panda", "ur5"])
def test_boxes_are_stacked_by_one_arm(robot: str) -> None:
    scene = _scene(robot)
    (hand,) = scene.robot.description.grippers
    text = f"(grasp {hand} red) (place {hand} red blue) (grasp {hand} red) (place {hand} red tab1)"
    result = CoarseBound(scene, 9).solve(parse_skeleton(text))
    assert result.feasible, str(result.failure)
    with World(scene) as world:
        fault = verify_keyframes(world, result.skeleton, result.at_switch, result.after_action)
    assert fault is None, str(fault)


@pytest.mark.parametrize(("robot", "shared"), [("pr2", 0), ("panda", 6), ("ur5", None)])
def test_segments_share_the_redundant_joint_only(robot: str, shared: int | None) -> None:
    scene = _scene(robot)
    hand = scene.robot.description.grippers[0]
    formulation = Formulator(SceneGeometry(scene), Margins()).build(
        parse_skeleton(f"(grasp {hand} red)")
    )
    (contact,) = formulation.configurations[formulation.grips[0]]
    assert len(contact.segments) == 2
    for segment in contact.segments:
        same = np.flatnonzero(np.equal(contact.joints, segment.joints)).tolist()
        assert same == ([] if shared is None else [shared])
