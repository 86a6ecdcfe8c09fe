"""Faults of a robot file are told in one line: file, field, fault, what is accepted."""

import copy
from pathlib import Path

import numpy as np
import pytest
from own_robot import describe, document, written

from guided_lgp.errors import InputError
from guided_lgp.robots import load_robot

DOCUMENT = document("")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A description of one's own."""
    describe(tmp_path, "")
    return tmp_path


def test_a_description_of_ones_own_is_read(folder: Path) -> None:
    robot = load_robot(written(folder, DOCUMENT))
    fingers = robot.arms["hand"].fingers
    assert robot.name == "own"
    assert robot.grippers == ("hand",)
    assert str(folder / "own_description" / "palm.obj") in robot.urdf.read_text()
    assert fingers.ratios.tolist() == [1, -1]
    assert fingers.opening(0.04) - fingers.opening(0.0) == pytest.approx(0.08)
    row = [0.0] * 6 + [0.03, -0.03]
    assert robot.finger_values(np.array(row)) == {"hand": 0.03}


@pytest.mark.parametrize(
    ("keys", "value", "fault"),
    [
        (("arms", "hand", "tool"), None, r"arms\.hand\.tool: is missing"),
        (("arms", "hand", "tool", "link"), "pam", r"tool\.link: unknown link pam .accepted: palm"),
        (("arms", "hand", "tool", "closing"), "-z", r"tool\.closing: -z is along the approach"),
        (("arms", "hand", "joints", 2), "join3", r"joints: join3 is no joint .*accepted: joint3"),
        (("arms", "hand", "home"), [0.0], r"home has 1 values for 6 joints"),
        (
            ("arms", "hand", "redundant"),
            "elbow",
            r"arms\.hand: an arm of 6 joints, redundant: elbow",
        ),
        (("arms", "hand", "hand_links", 1), "thumb", r"hand_links: unknown link thumb"),
        (("arms", "hand", "fingers", "joints", 0), "wrist", r"fingers\.joints: wrist is no joint"),
        (("base_link",), "link1", r"base_link: link1 is not the root .*accepted: base"),
        (("description", "urdf"), "gone.urdf", r"description\.urdf: .*gone\.urdf is not a file"),
        (("description", "srdf"), "own_description/own.urdf", None),
        (("description", "package"), "no-such-package", "no-such-package: is not installed"),
        (
            ("fixed_joints",),
            {"lift": {"joint": "lift", "limits": [0, 1], "default": 0}},
            "lift is no",
        ),
        (("arms",), {}, r"arms: has 0 values, fewer than 1"),
        (("legs",), 2, r"own\.yaml: unknown field 'legs' .known: description, .*arms"),
    ],
)
def test_a_fault_is_named_in_one_line(
    folder: Path, keys: tuple[str | int, ...], value: object, fault: str | None
) -> None:
    content = item = copy.deepcopy(DOCUMENT)
    *way, last = keys
    for key in way:
        item = item[key]
    if value is None:
        del item[last]
    else:
        item[last] = value
    file = written(folder, content)
    if fault is None:
        assert load_robot(file).disabled_pairs == frozenset()
        return
    with pytest.raises(InputError, match=fault) as error:
        load_robot(file)
    assert len(str(error.value).splitlines()) == 1


def test_an_srdf_that_names_an_unknown_link_is_refused(folder: Path) -> None:
    srdf = folder / "own_description" / "own.srdf"
    srdf.write_text(srdf.read_text().replace("link3", "link33"))
    with pytest.raises(InputError, match=r"description\.srdf: .*unknown link link33"):
        load_robot(written(folder, DOCUMENT))


def test_a_mesh_that_is_nowhere_is_named(folder: Path) -> None:
    (folder / "own_description" / "palm.obj").unlink()
    with pytest.raises(InputError, match=r"package://own_description/palm\.obj"):
        _ = load_robot(written(folder, DOCUMENT)).urdf


@pytest.mark.parametrize("text", ["- a list", "{", "\x00", "3"])
def test_a_file_of_another_form_is_told(tmp_path: Path, text: str) -> None:
    (tmp_path / "robot.yaml").write_text(text)
    with pytest.raises(InputError, match=r"robot\.yaml: ") as error:
        load_robot(str(tmp_path / "robot.yaml"))
    assert len(str(error.value).splitlines()) == 1


def test_a_key_twice_is_refused(folder: Path) -> None:
    file = Path(written(folder, DOCUMENT))
    file.write_text(file.read_text() + "acceleration: 3.0\n")
    with pytest.raises(
        InputError, match=r"own\.yaml: is not YAML: has the key 'acceleration' twice"
    ):
        load_robot(str(file))


@pytest.mark.parametrize(
    ("old", "new", "fault"),
    [
        ('parent link="link1"', 'parent link="link0"', "'joint2' does not connect two links"),
        ('child link="link2"', 'child link="link1"', "link 'link1' hangs on two joints"),
        ('parent link="base"', 'parent link="link6"', "link 'link1' hangs on itself"),
        ('link name="link2"', 'link name="link1"', "'link1' comes 2 times"),
        ('type="fixed"', 'type="welded"', "'welded' is none of revolute"),
        ('upper="3" velocity', 'upper="three" velocity', "limit upper: 'three' is not 1 sensible"),
        ('upper="3" velocity', 'upper="nan" velocity', "limit upper: 'nan' is not 1 sensible"),
        ('effort="10"', "", "'joint1' does not have the limits lower, upper, velocity, effort"),
        ('xyz="0 0 0.15"', 'xyz="0 0.15"', "origin xyz: '0 0.15' is not 3 sensible numbers"),
        ('box size="0.2 0.2 0.1"', 'box size="0.2 0 0.1"', "box: its size is not positive"),
        ('box size="0.2 0.2 0.1"', "ball", "a geometry is not one of box"),
        ("</robot>", "", "no element found"),
    ],
)
def test_a_urdf_that_describes_no_robot(folder: Path, old: str, new: str, fault: str) -> None:
    urdf = folder / "own_description" / "own.urdf"
    content = urdf.read_text()
    assert old in content
    urdf.write_text(content.replace(old, new, 1))
    with pytest.raises(InputError, match=rf"description\.urdf: .*({fault})") as error:
        load_robot(written(folder, DOCUMENT))
    assert len(str(error.value).splitlines()) == 1
