"""Scenes: what is accepted can be worked with, everything else is refused in one line."""

import copy
import json
from itertools import permutations
from math import cos, isfinite, sin
from pathlib import Path
from typing import Any

import numpy as np
from bad_input import EXAMPLE, UNICODE_NAMES, answer, examples, garbled, spoilt, write_json
from hypothesis import event, given
from hypothesis import strategies as st

from guided_lgp.scene import Box, Scene, Table, generate, load_scene, parse_scene
from guided_lgp.scene.validate import validate_scene

TABLES: tuple[dict[str, Any], ...] = (
    {"name": "tab1", "position": [0.54, 0.33, 0.60], "half_extents": [0.17, 0.20]},
    {"name": "tab2", "position": [0.54, -0.33, 0.60], "half_extents": [0.17, 0.20]},
)


def accepted(document: Any) -> Scene | None:
    """The scene, if both the reader and the checks of a scene made by hand pass it."""

    def read() -> Scene:
        scene = parse_scene(document, "file.json")
        validate_scene(scene, "file.json")
        return scene

    return answer(read, "file.json")


def corners(body: Box | Table) -> np.ndarray:
    """World coordinates (9, 3) of the corners and the centre of a box, or of a table's top."""
    turn = np.array([[cos(body.yaw), -sin(body.yaw)], [sin(body.yaw), cos(body.yaw)]])
    half = np.array([*body.half_extents, 0.0] if isinstance(body, Table) else body.size) / (
        1 if isinstance(body, Table) else 2
    )
    signs = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)] + [(0, 0, 0)])
    points = signs * half
    points[:, :2] = points[:, :2] @ turn.T
    return points + np.array(body.position)


def depth(box: Box, point: np.ndarray) -> float:
    """How deep (m) a point is inside a box; negative outside."""
    x, y, z = point - np.array(box.position)
    local = (cos(box.yaw) * x + sin(box.yaw) * y, cos(box.yaw) * y - sin(box.yaw) * x, z)
    return min(size / 2 - abs(value) for size, value in zip(box.size, local, strict=True))


def slab(table: Table) -> Box:
    """A table as a box, so that points can be looked for over it."""
    size = (2 * table.half_extents[0], 2 * table.half_extents[1], 1.0)
    return Box(name=table.name, size=size, position=table.position, yaw=table.yaw, on="floor")


def check_geometry(scene: Scene) -> None:
    """By other means than the program's: boxes rest on their supports and do not overlap."""
    bodies = {body.name: body for body in (*scene.tables, *scene.boxes)}
    for box in scene.boxes:
        support = bodies[box.on]
        assert abs(corners(box)[:, 2].min() - corners(support)[:, 2].max()) < 0.0021
        under = support if isinstance(support, Box) else slab(support)
        assert depth(under, np.array([*box.position[:2], under.position[2]])) > -1e-9
        seen = [box.name]
        while isinstance(support, Box):
            assert support.name not in seen
            seen.append(support.name)
            support = bodies[support.on]
    for one, other in permutations(scene.boxes, 2):
        assert max(depth(one, point) for point in corners(other)) < 0.0031, (one, other)


@st.composite
def handmade(draw: st.DrawFn) -> dict[str, Any]:
    """Scenes as somebody might write them: none to six boxes, on tables and on each other.

    With care, most of them stand; without, boxes float, overlap, hang over, stand on themselves
    through others, or on something that the scene does not have.
    """
    careful = draw(st.integers(0, 2)) > 0
    names = ["red", "green", "blue", "yellow", "purple", "orange"][: draw(st.integers(0, 6))]
    tables = copy.deepcopy(TABLES)
    for table in tables:
        table["yaw"] = draw(st.sampled_from((0.0, 0.0, 0.1, 1.5)))
    tops: dict[str, list[float]] = {table["name"]: table["position"] for table in tables}
    free = [(table["name"], x, y) for table in tables for x in (-0.09, 0.09) for y in (-0.13, 0.1)]
    boxes = []
    for name in names:
        size = [0.15, 0.07, draw(st.sampled_from((0.06, 0.10, 0.15)))]
        if careful:
            on, dx, dy = draw(st.sampled_from(free))
            free = [place for place in free if place != (on, dx, dy)] + [(name, 0.0, 0.0)]
            spread, lifts, turn = 0.02, (0.0, 0.0, 0.001, -0.001), 0.2
        else:
            on, dx, dy = draw(st.sampled_from([*tops, *tops, *names, "shelf"])), 0.0, 0.0
            spread, lifts, turn = 0.2, (0.0, 0.0, 0.003, 0.05, -0.02), 3.1
        x, y, top = tops.get(on, [0.5, 0.2, 0.6])
        x += dx + round(draw(st.floats(-spread, spread)), 3)
        y += dy + round(draw(st.floats(-spread, spread)), 3)
        z = top + size[2] / 2 + draw(st.sampled_from(lifts))
        yaw = round(draw(st.floats(-turn, turn)), 2)
        boxes.append({"name": name, "size": size, "position": [x, y, z], "yaw": yaw, "on": on})
        tops.setdefault(name, [x, y, z + size[2] / 2])
    return {"tables": list(tables), "boxes": boxes}


@examples(40)
@given(setup=st.sampled_from("abcd"), seed=st.integers(0, 2**63))
def test_generated_scenes_are_accepted(setup: str, seed: int) -> None:
    (scene,) = generate(setup, 1, seed, "scene").scenes
    assert accepted(json.loads(scene.model_dump_json())) == scene
    check_geometry(scene)


@examples(120)
@given(document=handmade())
def test_handmade_scenes_are_accepted_only_if_they_stand(document: dict[str, Any]) -> None:
    scene = accepted(document)
    event("refused" if scene is None else "accepted")
    if scene is not None:
        assert scene.boxes
        check_geometry(scene)


NUMBERS = (
    "yaw",
    *(("position", axis) for axis in range(3)),
    *(("size", axis) for axis in range(3)),
)


@examples(60)
@given(
    field=st.sampled_from(NUMBERS),
    value=st.booleans() | st.sampled_from(("0.4", "", "1e-1", "nan", None, [0.4], {}, 1e-9, 1e300)),
)
def test_only_numbers_of_a_sensible_size_are_numbers(
    field: str | tuple[str, int], value: Any, scene_document: dict[str, Any]
) -> None:
    document = copy.deepcopy(scene_document)
    box = document["boxes"][0]
    match field:
        case (name, axis):
            box[name][axis] = value
        case name:
            box[name] = value
    assert (accepted(document) is None) or (value == 1e-9 and field in ("yaw", ("position", 0)))


@examples(500)
@given(data=st.data())
def test_spoilt_documents(
    data: st.DataObject, scene_document: dict[str, Any], folder: Path
) -> None:
    file = write_json(folder / "scene.json", data.draw(spoilt(scene_document)))
    scene = answer(lambda: load_scene(file), file)
    if scene is not None:
        assert Scene.model_validate_json(scene.model_dump_json()) == scene
        assert all(isfinite(value) for box in scene.boxes for value in (*box.position, box.yaw))
        assert {box.on for box in scene.boxes} <= set(scene.symbols.tables)


@examples(150)
@given(data=st.data())
def test_spoilt_documents_of_version_2(data: st.DataObject, folder: Path) -> None:
    """Cylinders, meshes, obstacles, what is fixed, on another face or in a hand, and a start."""
    document = json.loads((EXAMPLE.parent / "kitchen.json").read_text())
    document["robot"]["joints"] = {"l_shoulder_pan_joint": 0.4}
    lying = {"quaternion": [0, 0.7071068, 0, 0.7071068], "position": [0.42, 0.45, 0.675]}
    held = {"on": "pr2R", "grasp": [0.03, 0, 0.01, 0, -0.3826834, 0, 0.9238795]}
    for name, fields in (("lying", {"on": "counter", **lying}), ("blue", held)):
        document["boxes"].append({"name": name, "size": [0.15, 0.07, 0.1], **fields})
    file = write_json(folder / "second.json", data.draw(spoilt(document)))
    scene = answer(lambda: load_scene(file), file)
    if scene is not None:
        assert Scene.model_validate_json(scene.model_dump_json()) == scene


@examples(200)
@given(data=st.data())
def test_garbled_files(data: st.DataObject, scene_document: dict[str, Any], folder: Path) -> None:
    content = json.dumps(scene_document, indent=1).encode()
    file = folder / "garbled.json"
    file.write_bytes(data.draw(garbled(content)))
    answer(lambda: load_scene(file), file)


@examples(60)
@given(
    field=st.sampled_from(("boxes.position", "boxes.size", "tables.position", "boxes.yaw")),
    index=st.integers(0, 1),
    factor=st.sampled_from((100, 1000, 1e6, 39.37)),
)
def test_other_units_are_refused(
    scene_document: dict[str, Any], field: str, index: int, factor: float
) -> None:
    """Centimetres, millimetres, micrometres, inches; degrees for angles."""
    document = copy.deepcopy(scene_document)
    part, name = field.split(".")
    body = document[part][index]
    if name == "yaw":
        body["yaw"] = (90 + factor) * (-1) ** index
    else:
        body[name] = [factor * value for value in body[name]]
    assert accepted(document) is None


@examples(60)
@given(name=st.sampled_from(UNICODE_NAMES) | st.text(max_size=40), field=st.integers(0, 3))
def test_names(scene_document: dict[str, Any], name: str, field: int) -> None:
    """A scene may be called anything; symbols are plain words, as they appear in goals."""
    document = copy.deepcopy(scene_document)
    holder: dict[str, Any] = (
        document,
        document["tables"][1],
        document["boxes"][0],
        document["boxes"][1],
    )[field]
    key = "on" if field == 3 else "name"
    holder[key] = name
    scene = answer(lambda: parse_scene(document, "file.json"), "file.json")
    if scene is not None and field == 0:
        assert scene.name == name
    elif scene is not None:
        assert name.isascii()
        assert name.translate(str.maketrans("-_.", "xxx")).isalnum()


@examples(12)
@given(count=st.sampled_from((0, 50, 112)), fault=st.sampled_from(("", "twice", "overlap")))
def test_no_box_or_many(count: int, fault: str) -> None:
    """Fifty narrow boxes stand side by side on one table; twice as many would not."""
    boxes = [
        {
            "name": f"box{index}",
            "size": [0.03, 0.03, 0.05],
            "position": [0.40 + 0.04 * (index % 8), 0.16 + 0.05 * (index // 8 % 7), 0.625],
            "on": "tab1",
        }
        for index in range(count)
    ]
    if boxes and fault == "twice":
        boxes[-1]["name"] = boxes[0]["name"]
    if boxes and fault == "overlap":
        boxes[-1]["position"] = boxes[0]["position"]
    scene = accepted({"tables": list(TABLES), "boxes": boxes})
    assert (scene is not None) == (count == 50 and not fault)


@examples(40)
@given(offset=st.tuples(st.floats(-0.16, 0.16), st.floats(-0.16, 0.16)), yaw=st.floats(-3.2, 3.2))
def test_overlapping_tables_are_refused(offset: tuple[float, float], yaw: float) -> None:
    first, second = copy.deepcopy(TABLES)
    x, y, z = first["position"]
    second |= {"position": [x + offset[0], y + offset[1], z], "yaw": yaw}
    box = {"name": "red", "size": [0.15, 0.07, 0.1], "position": [x, y, z + 0.05], "on": "tab1"}
    assert accepted({"tables": [first, second], "boxes": [box]}) is None
