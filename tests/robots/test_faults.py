"""Faults of a robot file are told in one line: file, field, fault, what is accepted."""

import copy
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from guided_lgp.errors import InputError
from guided_lgp.robots import load_robot

URDF = """<robot name="own">
  <link name="base"><collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision></link>
  {arm}
  <link name="palm">
    <visual><geometry><mesh filename="package://own_description/palm.obj"/></geometry></visual>
    <collision><origin xyz="0 0 0.05"/><geometry><box size="0.1 0.1 0.02"/></geometry></collision>
  </link>
  <joint name="wrist" type="fixed">
    <parent link="link6"/><child link="palm"/><origin xyz="0 0 0.1"/>
  </joint>
  {fingers}
</robot>
"""
LINK = """<link name="link{n}">
    <collision><geometry><box size="0.05 0.05 0.1"/></geometry></collision>
  </link>
  <joint name="joint{n}" type="revolute">
    <parent link="{parent}"/><child link="link{n}"/><origin xyz="0 0 0.15"/><axis xyz="{axis}"/>
    <limit lower="-3" upper="3" velocity="2" effort="10"/>
  </joint>
"""
FINGER = """<link name="{side}_finger">
    <collision>
      <origin xyz="0 {out} 0.1"/><geometry><box size="0.02 0.01 0.05"/></geometry>
    </collision>
  </link>
  <joint name="{side}_joint" type="prismatic">
    <parent link="palm"/><child link="{side}_finger"/><axis xyz="0 {axis} 0"/>
    <limit lower="0" upper="0.04" velocity="0.2" effort="10"/>{mimic}
  </joint>
"""
AXES = ("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "0 0 1")
DOCUMENT: dict[str, Any] = {
    "description": {"urdf": "own_description/own.urdf", "srdf": "own_description/own.srdf"},
    "base_link": "base",
    "acceleration": 2.0,
    "arms": {
        "hand": {
            "joints": [f"joint{n}" for n in range(1, 7)],
            "home": [0.0, 0.5, 1.0, 0.0, 1.0, 0.0],
            "tool": {"link": "palm", "offset": [0, 0, 0.11], "approach": "z", "closing": "y"},
            "hand_links": ["palm", "left_finger", "right_finger"],
            "fingers": {"joints": ["left_joint", "right_joint"]},
        }
    },
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A description of one's own: six joints, two fingers of which one mimics the other."""
    arm = "".join(
        LINK.format(n=n + 1, parent=f"link{n}" if n else "base", axis=axis)
        for n, axis in enumerate(AXES)
    )
    mimic = '<mimic joint="left_joint" multiplier="-1"/>'
    fingers = FINGER.format(side="left", out=0.005, axis=1, mimic="")
    # opens the other way round: its value is minus the first one's
    fingers += FINGER.format(side="right", out=-0.005, axis=1, mimic=mimic).replace(
        'lower="0" upper="0.04" velocity="0.2" effort="10"/><mimic',
        'lower="-0.04" upper="0" velocity="0.2" effort="10"/><mimic',
    )
    description = tmp_path / "own_description"
    description.mkdir()
    (description / "own.urdf").write_text(URDF.format(arm=arm, fingers=fingers))
    pairs = [*((f"link{n}", f"link{n + 1}") for n in range(1, 6)), ("base", "link1")]
    hand = ("palm", "left_finger", "right_finger")
    pairs += [("link6", part) for part in hand] + [("palm", part) for part in hand[1:]]
    rows = "".join(f'<disable_collisions link1="{a}" link2="{b}"/>' for a, b in pairs)
    (description / "own.srdf").write_text(f"<robot>{rows}</robot>")
    (description / "palm.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    return tmp_path


def written(folder: Path, document: dict[str, Any]) -> str:
    file = folder / "own.yaml"
    file.write_text(yaml.safe_dump(document, sort_keys=False))
    return str(file)


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
        (("arms", "hand", "tool"), None, r"arms\.hand\.tool: Field required"),
        (("arms", "hand", "tool", "link"), "pam", r"tool\.link: unknown link pam .accepted: palm"),
        (("arms", "hand", "tool", "closing"), "-z", r"tool\.closing: -z is along the approach"),
        (("arms", "hand", "joints", 2), "join3", r"joints: join3 is no joint .*accepted: joint3"),
        (("arms", "hand", "home"), [0.0], r"home has 1 values for 6 joints"),
        (("arms", "hand", "redundant"), "elbow", r"redundant elbow is no joint of the arm"),
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
        (("arms",), {}, r"arms: Dictionary should have at least 1 item"),
        (("legs",), 2, r"legs: Extra inputs"),
    ],
)
def test_a_fault_is_named_in_one_line(
    folder: Path, keys: tuple[str | int, ...], value: object, fault: str | None
) -> None:
    document = item = copy.deepcopy(DOCUMENT)
    *way, last = keys
    for key in way:
        item = item[key]
    if value is None:
        del item[last]
    else:
        item[last] = value
    file = written(folder, document)
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
