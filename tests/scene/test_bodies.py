"""Bodies of the scene document: shapes, meshes, other faces, what is fixed or in the way."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from guided_lgp.errors import InputError
from guided_lgp.poses import apply, pose
from guided_lgp.scene import Scene, load_scene, parse_scene
from guided_lgp.scene.shapes import Convex, hull
from guided_lgp.scene.validate import validate_scene
from guided_lgp.scene.world import World

TABLE = {"name": "tab", "position": [0.54, 0.33, 0.6], "half_extents": [0.17, 0.2]}
RED = {"name": "red", "size": [0.15, 0.07, 0.1], "position": [0.5, 0.25, 0.65], "on": "tab"}
FRUSTUM = [
    (x * half, y * half, z)
    for z, half in ((0, 0.05), (0.06, 0.025))
    for x in (-1, 1)
    for y in (-1, 1)
]
CONE = [(0.05, 0, 0), (-0.05, 0.04, 0), (-0.05, -0.04, 0), (0, 0, 0.1)]


def scene(*boxes: dict[str, Any], **fields: Any) -> Scene:
    return parse_scene({"tables": [TABLE], "boxes": [RED, *boxes], **fields}, "mine.json")


def odd(**fields: Any) -> dict[str, Any]:
    return {"name": "odd", "position": [0.6, 0.43, 0.6], "on": "tab", **fields}


def test_volumes_are_those_of_their_hulls() -> None:
    corners = tuple(map(tuple, Convex("box", (0.1, 0.2, 0.3)).points()))
    cuboid = Convex("mesh", (0.1, 0.2, 0.3), corners)
    assert cuboid.volume == pytest.approx(Convex("box", (0.1, 0.2, 0.3)).volume) == 0.048
    cylinder = Convex("cylinder", (0.05, 0.05, 0.1))
    around = Convex("mesh", (0.05, 0.05, 0.1), tuple(map(tuple, cylinder.points())))
    assert cylinder.volume == pytest.approx(np.pi * 0.05**2 * 0.2)
    assert cylinder.volume < around.volume < 1.02 * cylinder.volume


def test_what_carries_lies_inside_top_and_base() -> None:
    assert Convex("box", (0.1, 0.2, 0.3)).rest == (0.1, 0.2)
    assert np.hypot(*Convex("cylinder", (0.05, 0.05, 0.1)).rest) == pytest.approx(0.05)
    frustum = scene(odd(vertices=FRUSTUM, shape="mesh")).boxes[1].convex
    assert frustum.rest == pytest.approx((0.025, 0.025), abs=1e-5)
    assert frustum.stands
    cone = scene(odd(vertices=CONE, shape="mesh")).boxes[1].convex
    assert cone.rest == (0.0, 0.0)
    assert cone.stands


def test_fingers_touch_what_is_there() -> None:
    """The sides of a box, the line of a cylinder, parallel faces of a mesh, of a cone nothing."""
    assert Convex("box", (0.1, 0.2, 0.3)).side(0) == (0.1, 0.2, 0.3)
    assert Convex("cylinder", (0.05, 0.05, 0.1)).side(0) == (0.05, 0.008, 0.1)
    prism = [
        (x * half, y, z)
        for z, half in ((0, 0.05), (0.06, 0.02))
        for x in (-1, 1)
        for y in (0, 0.05)
    ]
    body = scene(odd(vertices=prism, shape="mesh")).boxes[1].convex
    assert min(body.side(0)[1:]) == 0
    along, _, high = body.side(1)
    assert 0.02 < along < 0.05
    assert 0.005 < high < 0.03
    cone = scene(odd(vertices=CONE, shape="mesh")).boxes[1].convex
    assert min(cone.side(0)[1:]) == min(cone.side(1)[::2]) == 0


def test_the_frame_of_a_hull_is_at_its_centre_of_mass() -> None:
    rng = np.random.default_rng(3)
    points = np.array([1.0, 2.0, 3.0]) + rng.uniform(-0.1, 0.1, (40, 3))
    vertices, origin = hull(points)
    inside = rng.uniform(points.min(axis=0), points.max(axis=0), (40_000, 3))
    from scipy.spatial import Delaunay

    inside = inside[Delaunay(points).find_simplex(inside) >= 0]
    assert origin[:2] == pytest.approx(inside.mean(axis=0)[:2], abs=2e-3)
    assert vertices[:, 2].min() == pytest.approx(-vertices[:, 2].max(), abs=1e-6)
    again, moved = hull(vertices)
    assert np.array_equal(again, vertices)
    assert not moved.any()


def test_a_mesh_is_read_beside_the_scene_and_written_into_it(tmp_path: Path) -> None:
    faces = ["f 1 2 3", "f 2 3 4", "f 5 6 7", "f 6 7 8", "f 1 2 5", "f 3 4 7"]
    lines = [*(f"v {x} {y} {z}" for x, y, z in FRUSTUM), *faces]
    (tmp_path / "odd.obj").write_text("\n".join(lines))
    document = {"tables": [TABLE], "boxes": [odd(mesh="odd.obj", yaw=0.3)]}
    (tmp_path / "scene.json").write_text(json.dumps(document))
    found = load_scene(tmp_path / "scene.json")
    validate_scene(found)
    (box,) = found.boxes
    assert box.size == pytest.approx((0.1, 0.1, 0.06), abs=1e-5)
    corners = apply(pose((0.6, 0.43, 0.6), 0.3), np.array(FRUSTUM))
    placed = apply(box.placement, np.array(box.vertices))
    assert np.sort(placed, axis=0) == pytest.approx(np.sort(corners, axis=0), abs=1e-5)
    assert Scene.model_validate_json(found.model_dump_json()) == found


@pytest.mark.parametrize(
    ("quaternion", "size", "yaw"),
    [
        ([0, 0, 0, 1], (0.15, 0.07, 0.1), 0.0),
        ([0, 0, 0.7071068, 0.7071068], (0.15, 0.07, 0.1), np.pi / 2),
        ([0.7071068, 0, 0, 0.7071068], (0.15, 0.1, 0.07), 0.0),
        ([0, 0.7071068, 0, 0.7071068], (0.07, 0.1, 0.15), np.pi / 2),
        ([1, 0, 0, 0], (0.15, 0.07, 0.1), 0.0),
    ],
)
def test_a_box_on_another_face_is_one_of_other_extents(
    quaternion: list[float], size: tuple[float, ...], yaw: float
) -> None:
    """The same points of space are inside of it."""
    (_, box) = scene(odd(size=[0.15, 0.07, 0.1], quaternion=quaternion)).boxes
    assert box.size == size
    assert box.yaw == pytest.approx(yaw, abs=1e-6)
    assert box.quaternion is None
    as_given = np.array([0.6, 0.43, 0.6, *quaternion])
    corners = apply(as_given, Convex("box", (0.075, 0.035, 0.05)).points())
    found = apply(box.placement, box.convex.points())
    assert np.sort(found, axis=0) == pytest.approx(np.sort(corners, axis=0), abs=1e-6)


def test_a_mesh_on_another_face() -> None:
    """The frustum on its narrow end: what was its base is its top."""
    (_, box) = scene(odd(shape="mesh", vertices=FRUSTUM, quaternion=[1, 0, 0, 0])).boxes
    points = np.array(box.vertices)
    assert np.ptp(points[points[:, 2] < 0, 0]) == pytest.approx(0.05, abs=1e-5)
    assert np.ptp(points[points[:, 2] > 0, 0]) == pytest.approx(0.1, abs=1e-5)
    as_given = np.array([0.6, 0.43, 0.6, 1, 0, 0, 0])
    corners = apply(as_given, np.array(FRUSTUM))
    assert apply(box.placement, points).min(axis=0) == pytest.approx(corners.min(axis=0), abs=1e-5)


@pytest.mark.parametrize(
    ("body", "fault"),
    [
        (odd(), r"boxes\.1: size is missing"),
        (odd(size=[0.1, 0.1, 0.1], on=""), r"boxes\.1\.on: the name '' has other"),
        ({**odd(size=[0.1, 0.1, 0.1]), "on": "tap"}, "stands on unknown table 'tap'"),
        (odd(shape="cylinder", size=[0.1, 0.2, 0.1]), "as long as wide, not 0.1 by 0.2"),
        (odd(shape="ball", size=[0.1, 0.1, 0.1]), r"shape: 'ball' is not 'box', 'cylinder' or"),
        (odd(shape="mesh"), "a mesh has vertices, or the file"),
        (odd(vertices=FRUSTUM, size=[0.1, 0.1, 0.1]), "a mesh has vertices, or the file"),
        (odd(shape="mesh", vertices=FRUSTUM[:4]), "the points do not enclose a body"),
        (odd(mesh="nowhere.stl"), r"there is no file nowhere\.stl"),
        (odd(mesh="x" * 300), "there is no file x"),
        (odd(size=[0.1, 0.1, 0.1], quaternion=[0, 0, 0, 0.5]), "has length 1, not 0.5"),
        (odd(size=[0.1, 0.1, 0.1], quaternion=[0.3826834, 0, 0, 0.9238795]), "no flat face down"),
        (
            odd(shape="cylinder", size=[0.1, 0.1, 0.2], quaternion=[0.7071068, 0, 0, 0.7071068]),
            "no flat face down",
        ),
        (odd(size=[0.1, 0.1, 0.1], colour="mauve"), r"unknown colour 'mauve' \(#rrggbb, red, "),
    ],
)
def test_a_fault_of_a_body_is_told_in_one_line(body: dict[str, Any], fault: str) -> None:
    with pytest.raises(InputError, match=fault) as error:
        scene(body)
    assert len(str(error.value).splitlines()) == 1


def test_what_is_fixed_is_a_table_and_what_is_in_the_way_is_nothing() -> None:
    fixed = {"name": "step", "size": [0.1, 0.1, 0.05], "position": [0.6, 0.43, 0.9], "fixed": True}
    lamp = {"name": "lamp", "size": [0.1, 0.1, 0.1], "position": [0.6, 0.0, 1.0]}
    found = scene(fixed, odd(name="green", size=[0.1, 0.05, 0.1], on="step"), obstacles=[lamp])
    assert found.symbols.boxes == ("red", "green")
    assert found.symbols.surfaces == ("tab", "step")
    assert found.state.support == (("green", "step"), ("red", "tab"))
    assert "lamp" not in found.symbols.names
    assert found.model_dump(mode="json")["boxes"][1]["fixed"] is True
    with World(found) as world:
        assert set(world.boxes) == {"red", "green"}
        assert world.distance("lamp", "step") < 0.5


def test_what_overlaps_an_obstacle_or_falls_is_refused() -> None:
    wall = {"name": "wall", "size": [0.02, 0.3, 0.3], "position": [0.5, 0.25, 0.75]}
    with pytest.raises(InputError, match="red and wall overlap by"):
        validate_scene(scene(obstacles=[wall]))
    with pytest.raises(InputError, match=r"obstacles: wall is .* m inside the robot"):
        validate_scene(scene(obstacles=[{**wall, "position": [0.0, 0.0, 0.4]}]))
    tip = odd(shape="mesh", vertices=[(x, y, -z) for x, y, z in CONE], position=[0.6, 0.43, 0.7])
    with pytest.raises(InputError, match=r"boxes\.1 \(odd\): the mesh has no flat base below"):
        validate_scene(scene(tip))


def test_a_document_of_version_1_is_written_as_it_was() -> None:
    document = {
        "name": "old",
        "robot": {"model": "pr2", "base": [0.0, 0.0, 0.0], "torso": 0.28},
        "tables": [{**TABLE, "yaw": 0.0}],
        "boxes": [{**RED, "yaw": 0.0}],
    }
    written = parse_scene(document, "old.json").model_dump(mode="json")
    assert written == document
    assert list(written["boxes"][0]) == ["name", "size", "position", "yaw", "on"]
