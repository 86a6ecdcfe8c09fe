"""Hulls and the spheres around them, against PyBullet and by random points."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pybullet
import pytest
from descriptions import ARMS, ArmDescription

from guided_lgp.robots.measures.hulls import between, link_hulls
from guided_lgp.robots.measures.spheres import covering_spheres, kept_spheres

_ROBOTS = {name: ARMS[name] for name in ("pr2, left", "panda", "ur5", "baxter", "tiago")}


@pytest.mark.parametrize("arm", _ROBOTS.values(), ids=_ROBOTS)
def test_spheres_contain_every_point_of_the_hull(arm: ArmDescription) -> None:
    random = np.random.default_rng(0)
    for shapes in link_hulls(arm.urdf).values():
        vertices = np.concatenate(shapes)
        spheres = covering_spheres(vertices)
        weights = random.dirichlet(np.full(len(vertices), 0.1), 200)
        points = np.concatenate([vertices, weights @ vertices])
        distance = np.linalg.norm(points[:, None] - spheres.centres, axis=-1) - spheres.radii
        assert distance.min(axis=1).max() < 1e-9
        around = np.linalg.norm(vertices - vertices.mean(axis=0), axis=1).max()
        assert spheres.radii.max() <= 1.01 * around


def test_spheres_are_kept_to_the_last_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    shapes = [np.random.default_rng(seed).normal(size=(20, 3)) for seed in range(3)]
    made, kept = kept_spheres(shapes), kept_spheres(shapes)
    for shape, first, again in zip(shapes, made, kept, strict=True):
        expected = covering_spheres(shape)
        for found in (first, again):
            np.testing.assert_array_equal(found.centres, expected.centres)
            np.testing.assert_array_equal(found.radii, expected.radii)
    assert len(list((tmp_path / "guided-lgp").glob("spheres-*.json"))) == 1
    kept_spheres(shapes[:2])
    assert len(list((tmp_path / "guided-lgp").glob("spheres-*.json"))) == 2


def test_a_long_link_gets_smaller_spheres_than_one() -> None:
    rod = np.array([[x, y, z] for x in (0, 1.0) for y in (0, 0.1) for z in (0, 0.1)])
    spheres = covering_spheres(rod)
    assert len(spheres.radii) == 3
    assert spheres.radii.max() < 0.2
    assert len(covering_spheres(rod, most=1).radii) == 1


def test_slices_of_a_hull_are_parts_of_it() -> None:
    cube = np.array([[x, y, z] for x in (0, 1.0) for y in (0, 1.0) for z in (0, 1.0)])
    axis = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
    for low, high in pairwise(np.linspace(0, np.sqrt(2), 5)):
        part = between(cube, axis, low, high)
        assert np.all((part > -1e-12) & (part < 1 + 1e-12))
        assert (part @ axis).min() == pytest.approx(low, abs=1e-9)
        assert (part @ axis).max() == pytest.approx(high, abs=1e-9)


@pytest.mark.parametrize("name", ["panda", "ur5"])
def test_hulls_are_where_pybullet_has_them(name: str) -> None:
    client = pybullet.connect(pybullet.DIRECT)
    try:
        robot = pybullet.loadURDF(str(ARMS[name].urdf), useFixedBase=True, physicsClientId=client)
        hulls = link_hulls(ARMS[name].urdf)
        for index in range(pybullet.getNumJoints(robot, physicsClientId=client)):
            link = pybullet.getJointInfo(robot, index, physicsClientId=client)[12].decode()
            if link not in hulls:
                continue
            low, high = pybullet.getAABB(robot, index, physicsClientId=client)
            state = pybullet.getLinkState(robot, index, physicsClientId=client)
            turn = np.array(pybullet.getMatrixFromQuaternion(state[5])).reshape(3, 3)
            vertices = np.concatenate(hulls[link]) @ turn.T + state[4]
            assert np.all(vertices.min(axis=0) > np.array(low) - 2e-3)
            assert np.all(vertices.max(axis=0) < np.array(high) + 2e-3)
    finally:
        pybullet.disconnect(client)
