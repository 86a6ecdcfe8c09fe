"""The PyBullet world: what it finds does not depend on what was asked before."""

import gc
from collections.abc import Iterator

import numpy as np
import pytest

from guided_lgp.poses import pose
from guided_lgp.robots import load_robot
from guided_lgp.scene import generate
from guided_lgp.scene.bullet import pybullet
from guided_lgp.scene.tolerances import MARGIN
from guided_lgp.scene.world import Camera, World, initial_poses

PR2 = load_robot("pr2")
HAND = PR2.arms["pr2L"].fingers


@pytest.fixture
def world() -> Iterator[World]:
    with World(generate("d", 1, 1, "x").scenes[0]) as world:
        yield world


def test_start_is_free_of_penetrations(world: World) -> None:
    assert world.penetrations() == []


def test_box_in_a_box_is_found_with_its_depth(world: World) -> None:
    first, second = sorted(world.boxes)[:2]
    world.set(PR2.home, {first: pose((0.5, 0.9, 1.0)), second: pose((0.5, 0.96, 1.0))})
    (found,) = world.penetrations()
    assert (found.first, found.second) == (first, second)
    assert found.depth == pytest.approx(0.01, abs=1e-3)


def test_pairs_are_those_of_an_exhaustive_search(world: World) -> None:
    """The broad phase, the filters and the cached contacts lose nothing and add nothing."""
    rng = np.random.default_rng(0)
    arms = {link for g in PR2.grippers for link in (*PR2.arms[g].links, *PR2.arms[g].hand_links)}
    bodies = [*arms, *world.fixed_links, *world.boxes, *world.supports]
    moving = arms | set(world.boxes)
    pairs = {
        frozenset((one, other))
        for one in moving
        for other in bodies
        if one != other and frozenset((one, other)) not in PR2.disabled_pairs
    }
    for _ in range(25):
        turns = rng.normal(size=(len(world.boxes), 4))
        boxes = {
            box: np.r_[rng.uniform([0.3, -0.5, 0.5], [0.8, 0.5, 0.9]), turn / np.linalg.norm(turn)]
            for box, turn in zip(world.boxes, turns, strict=True)
        }
        world.set(rng.uniform(*PR2.position_limits.T), boxes)
        found = {overlap.bodies for overlap in world.penetrations()}
        assert found == {pair for pair in pairs if world.distance(*sorted(pair), 0.0) < -MARGIN}


def test_fingers_are_set(world: World) -> None:
    world.set(PR2.home, {}, {"pr2L": HAND.value(0.03)})
    tips = {g: [link for link in PR2.arms[g].hand_links if "tip" in link] for g in PR2.grippers}
    assert world.distance(*tips["pr2L"]) == pytest.approx(0.03, abs=0.002)
    assert world.distance(*tips["pr2R"]) == pytest.approx(HAND.widest, abs=0.002)


def test_clients_are_freed() -> None:
    scene = generate("a", 1, 1, "x").scenes[0]
    clients = set()
    for _ in range(3):
        with World(scene) as world:
            clients.add(world.client)
            client = world.client
        assert not pybullet.isConnected(client)
    assert len(clients) == 1


def test_a_forgotten_world_is_freed() -> None:
    world = World(generate("a", 1, 1, "x").scenes[0])
    client = world.client
    del world
    gc.collect()
    assert not pybullet.isConnected(client)


def test_close_twice(world: World) -> None:
    world.close()
    world.close()


def test_picture_shows_boxes_and_robot(world: World) -> None:
    world.set(PR2.home, initial_poses(world.scene))
    picture = world.render(Camera(width=320, height=240)).astype(int)
    assert picture.shape == (240, 320, 3)
    red = (picture[:, :, 0] > 100) & (picture[:, :, 1:].max(axis=2) < 60)
    assert 50 < red.sum() < 3000
    assert (picture.max(axis=2) < 20).mean() < 0.01  # nothing black: all normals are good
