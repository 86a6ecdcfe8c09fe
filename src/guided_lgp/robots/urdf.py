"""A URDF, read and checked: a tree of links, and numbers where numbers belong.

What comes after, here and in the readers of PyBullet and pinocchio, takes both for granted.
"""

import math
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from guided_lgp.errors import InputError

_NUMBERS = {
    "origin": {"xyz": 3, "rpy": 3},
    "axis": {"xyz": 3},
    "limit": {"lower": 1, "upper": 1, "velocity": 1, "effort": 1},
    "safety_controller": {"soft_lower_limit": 1, "soft_upper_limit": 1},
    "mimic": {"multiplier": 1, "offset": 1},
    "mass": {"value": 1},
    "inertia": dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 1),
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "mesh": {"scale": 3},
}
"""How many numbers an attribute of an element has, where it is there."""
_JOINTS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_LIMITED = ("revolute", "prismatic")
_LIMITS = ("lower", "upper", "velocity", "effort")
_LARGEST = 1e6
"""m, rad, kg: nothing of a robot is larger."""
_SHAPES = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",), "mesh": ()}
"""The shapes, and what each must have."""


def read_xml(file: Path, where: str, accepted: str) -> ET.Element:
    """Read an XML file.

    Args:
        file: the file.
        where: the field that names it, for the message.
        accepted: what it should be.

    Raises:
        InputError: it cannot be read or is not XML.
    """
    try:
        return ET.parse(file).getroot()
    except (OSError, ET.ParseError, ValueError, LookupError) as error:
        raise InputError(where, str(error), accepted) from None


def read_urdf(file: Path, where: str) -> ET.Element:
    """Read a URDF.

    Raises:
        InputError: it cannot be read, its links are no tree, or something in it is no number.
    """
    root = read_xml(file, where, "a URDF")
    fault = next(_faults(root), None)
    if fault is not None:
        raise InputError(f"{where}: {file}", fault, "a URDF")
    return root


def _faults(root: ET.Element) -> Iterator[str]:
    yield from _faults_of_the_tree(root)
    for element in root.iter():
        for name, count in _NUMBERS.get(element.tag, {}).items():
            text = element.get(name)
            if text is not None and not _are_numbers(text, count):
                yield f"{element.tag} {name}: {text!r:.60} is not {count} sensible numbers"
    for geometry in root.iter("geometry"):
        yield from _faults_of_a_shape(geometry)


def _faults_of_the_tree(root: ET.Element) -> Iterator[str]:
    links = Counter(link.get("name", "") for link in root.findall("link"))
    joints = Counter(joint.get("name", "") for joint in root.findall("joint"))
    for names in (links, joints):
        yield from (f"{name!r:.60} comes {n} times" for name, n in names.items() if n > 1)
    parents: dict[str, str] = {}
    for joint in root.findall("joint"):
        parent, child = (_link_of(joint, key) for key in ("parent", "child"))
        if parent not in links or child not in links:
            yield f"joint {joint.get('name')!r:.60} does not connect two links"
        elif child in parents:
            yield f"link {child!r:.60} hangs on two joints"
        kind, limit = joint.get("type"), joint.find("limit")
        if kind not in _JOINTS:
            yield f"joint {joint.get('name')!r:.60}: {kind!r:.60} is none of {', '.join(_JOINTS)}"
        if kind in _LIMITED and not (limit is not None and {*_LIMITS} <= limit.attrib.keys()):
            yield f"joint {joint.get('name')!r:.60} does not have the limits {', '.join(_LIMITS)}"
        parents[child] = parent
    roots = [name for name in links if name not in parents]
    if len(roots) != 1 or len(parents) != len(links) - 1:
        yield "its links are not one tree"
    for link in links:
        above = link
        for _ in links:
            above = parents.get(above, above)
        if above not in roots:
            yield f"link {link!r:.60} hangs on itself"


def _faults_of_a_shape(geometry: ET.Element) -> Iterator[str]:
    shapes = [shape for shape in geometry if shape.tag in _SHAPES]
    if len(shapes) != 1:
        yield f"a geometry is not one of {', '.join(_SHAPES)}"
    for shape in shapes:
        for name in _SHAPES[shape.tag]:
            if not all(float(word) > 0 for word in shape.get(name, "0").split()):
                yield f"{shape.tag}: its {name} is not positive"


def _are_numbers(text: str, count: int) -> bool:
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        return False
    return len(values) == count and all(math.isfinite(v) and abs(v) < _LARGEST for v in values)


def _link_of(joint: ET.Element, key: str) -> str:
    element = joint.find(key)
    return "" if element is None else element.get("link", "")
