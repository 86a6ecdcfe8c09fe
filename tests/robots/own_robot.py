"""A made-up robot: arms of six joints on one base, each with two fingers that slide."""

from pathlib import Path
from typing import Any

import yaml

_ROBOT = """<robot name="own">
  <link name="base"><collision><geometry><box size="0.2 0.2 0.1"/></geometry></collision></link>
  {parts}
</robot>
"""
_LINK = """<link name="{side}link{n}">
    <collision><geometry><box size="0.05 0.05 0.1"/></geometry></collision>
  </link>
  <joint name="{side}joint{n}" type="revolute">
    <parent link="{parent}"/><child link="{side}link{n}"/><origin xyz="0 {y} 0.15"/>
    <axis xyz="{axis}"/><limit lower="-3" upper="3" velocity="2" effort="10"/>
  </joint>
"""
_PALM = """<link name="{side}palm">
    <visual><geometry><mesh filename="package://own_description/palm.obj"/></geometry></visual>
    <collision><origin xyz="0 0 0.05"/><geometry><box size="0.1 0.1 0.02"/></geometry></collision>
  </link>
  <joint name="{side}wrist" type="fixed">
    <parent link="{side}link6"/><child link="{side}palm"/><origin xyz="0 0 0.1"/>
  </joint>
"""
_FINGER = """<link name="{side}{name}_finger">
    <collision>
      <origin xyz="0 {out} 0.1"/><geometry><box size="0.02 0.01 0.05"/></geometry>
    </collision>
  </link>
  <joint name="{side}{name}_joint" type="prismatic">
    <parent link="{side}palm"/><child link="{side}{name}_finger"/><axis xyz="0 1 0"/>
    <limit lower="{lower}" upper="{upper}" velocity="0.2" effort="10"/>{mimic}
  </joint>
"""
_AXES = ("0 0 1", "0 1 0", "0 1 0", "0 0 1", "0 1 0", "0 0 1")


def document(*sides: str) -> dict[str, Any]:
    """The robot file: an arm for each prefix of its names."""
    arm = {
        "joints": [f"<side>joint{n}" for n in range(1, 7)],
        "home": [0.0, 0.5, 1.0, 0.0, 1.0, 0.0],
        "tool": {"link": "<side>palm", "offset": [0, 0, 0.11], "approach": "z", "closing": "y"},
        "hand_links": ["<side>palm", "<side>left_finger", "<side>right_finger"],
        "fingers": {"joints": ["<side>left_joint", "<side>right_joint"]},
    }
    return {
        "description": {"urdf": "own_description/own.urdf", "srdf": "own_description/own.srdf"},
        "base_link": "base",
        "acceleration": 2.0,
        "arms": {f"{side}hand": {"side": side, **arm} for side in sides},
    }


def describe(folder: Path, *sides: str) -> None:
    """Write URDF, SRDF and a mesh; the right fingers open the other way round than the left."""
    description = folder / "own_description"
    description.mkdir()
    parts = "".join(_arm(side, 0.4 * number) for number, side in enumerate(sides))
    (description / "own.urdf").write_text(_ROBOT.format(parts=parts))
    pairs = [pair for side in sides for pair in _neighbours(side)]
    rows = "".join(f'<disable_collisions link1="{a}" link2="{b}"/>' for a, b in pairs)
    (description / "own.srdf").write_text(f"<robot>{rows}</robot>")
    (description / "palm.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")


def written(folder: Path, content: dict[str, Any]) -> str:
    """The path of the robot file with this content."""
    file = folder / "own.yaml"
    file.write_text(yaml.safe_dump(content, sort_keys=False))
    return str(file)


def _arm(side: str, y: float) -> str:
    links = "".join(
        _LINK.format(
            side=side, n=n + 1, parent=f"{side}link{n}" if n else "base", y=0 if n else y, axis=axis
        )
        for n, axis in enumerate(_AXES)
    )
    mimic = f'<mimic joint="{side}left_joint" multiplier="-1"/>'
    left = _FINGER.format(side=side, name="left", out=0.005, lower=0, upper=0.04, mimic="")
    right = _FINGER.format(side=side, name="right", out=-0.005, lower=-0.04, upper=0, mimic=mimic)
    return links + _PALM.format(side=side) + left + right


def _neighbours(side: str) -> list[tuple[str, str]]:
    hand = [f"{side}{part}" for part in ("palm", "left_finger", "right_finger")]
    chain = [(f"{side}link{n}", f"{side}link{n + 1}") for n in range(1, 6)]
    return [
        *chain,
        ("base", f"{side}link1"),
        *((f"{side}link6", part) for part in hand),
        *((hand[0], finger) for finger in hand[1:]),
    ]
