"""Tests of counterweights: what a plan puts down stands without what it carries, where it can."""

import numpy as np
import pytest

from guided_lgp.bounds.checks import box_bodies, top_of
from guided_lgp.bounds.deadline import NEVER
from guided_lgp.bounds.results import Array
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.bounds.terms import balanced
from guided_lgp.explanation import users_bounds
from guided_lgp.logic import parse_skeleton
from guided_lgp.params import load_planning
from guided_lgp.scene import Scene
from guided_lgp.scene.generate import generate

ONTO_GREEN = "(grasp pr2R red) (place pr2R red blue) (grasp pr2L blue) (place pr2L blue green)"
CASES = [(8, ONTO_GREEN), (6, ONTO_GREEN)]
"""Near the first solution there is a better one; there is none, but elsewhere."""


def drawn(number: int) -> Scene:
    (scene,) = generate("a", 1, 30_000 + number, f"cw-{number:03d}").scenes
    return scene


def overhang(scene: Scene, boxes: dict[str, Array]) -> float:
    """By how much (m) blue, without red on it, is outside of where green would carry it."""
    poses = {name: pose.tolist() for name, pose in boxes.items()}
    masses = {name: body.volume for name, body in box_bodies(scene).items()}
    return balanced.check("blue", poses, masses, {}, top_of(scene, poses, "green"))


@pytest.mark.parametrize(("number", "actions"), CASES)
def test_counterweights_are_avoided_where_there_is_room(number: int, actions: str) -> None:
    scene, skeleton = drawn(number), parse_skeleton(actions)
    bounds = users_bounds(scene, load_planning().bounds, NEVER, ())
    plain = bounds.coarse(skeleton)
    paper = SceneBounds(scene, load_planning().bounds).coarse(skeleton)
    assert np.array_equal(plain.at_switch[-1].q, paper.at_switch[-1].q)
    assert overhang(scene, dict(plain.after_action[-1].boxes)) > 0
    solutions = bounds._coarse_bound.near(plain)
    assert overhang(scene, dict(next(solutions).after_action[-1].boxes)) <= 0
    assert next(solutions) is plain, "the last resort"


def test_the_motion_needs_no_counterweight() -> None:
    scene, skeleton = drawn(8), parse_skeleton(ONTO_GREEN)
    path = users_bounds(scene, load_planning().bounds, NEVER, ()).path(skeleton)
    assert path.trajectory is not None
    assert overhang(scene, dict(path.at_switch[-1].boxes)) <= 0


def test_what_carries_nothing_has_no_row_of_its_own() -> None:
    bounds = users_bounds(drawn(8), load_planning().bounds, NEVER, ())
    alone = parse_skeleton("(grasp pr2L blue) (place pr2L blue green)")
    coarse = bounds.coarse(alone)
    assert not bounds._coarse_bound.leans(coarse)
    assert list(bounds._coarse_bound.near(coarse)) == [coarse]
