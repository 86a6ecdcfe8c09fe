"""A robot's description: its URDF and SRDF, found and made ready for PyBullet and pinocchio."""

import copy
import json
import os
import xml.etree.ElementTree as ET
from collections.abc import Container, Iterator, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property
from hashlib import sha256
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path

import numpy as np

from guided_lgp.cache import kept, made
from guided_lgp.errors import InputError
from guided_lgp.paths import DESCRIPTIONS
from guided_lgp.robots.document import DescriptionFiles
from guided_lgp.robots.measures.pairs import sampled_pairs
from guided_lgp.robots.urdf import read_urdf, read_xml

_STL_FACET = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])
_STL_HEADER = 84
_PACKAGE = "package://"


@dataclass(frozen=True)
class JointDescription:
    """A joint that can move, as the URDF has it: rad, or m where it slides."""

    limits: tuple[float, float] | None
    """None where the joint turns without end."""
    velocity: float
    effort: float
    """Nm, or N where it slides; infinite where the URDF says none, or zero."""
    mimic: float
    """Factor to the joint that it follows; 1 if it follows none."""
    unit: str
    """Of its value: ``rad`` or ``m``."""


@dataclass(frozen=True)
class Description:
    """URDF and SRDF of a robot."""

    where: str
    """The robot file, for messages."""
    source: Path
    """The URDF as it was shipped."""
    srdf: Path | None
    packages: Mapping[str, Path]
    """Folders for ``package://NAME``; others are looked for above the URDF."""
    soft_limits: bool
    """Whether the limits of safety controllers count."""

    @cached_property
    def _root(self) -> ET.Element:
        return read_urdf(self.source, f"{self.where}: description.urdf")

    @cached_property
    def links(self) -> tuple[str, ...]:
        """All links."""
        return tuple(link.get("name", "") for link in self._root.findall("link"))

    @cached_property
    def parents(self) -> dict[str, str]:
        """The link that each link but the root hangs on."""
        return {
            _link(joint, "child"): _link(joint, "parent") for joint in self._root.findall("joint")
        }

    @cached_property
    def children(self) -> dict[str, str]:
        """The link that each joint carries."""
        joints = self._root.findall("joint")
        return {joint.get("name", ""): _link(joint, "child") for joint in joints}

    @cached_property
    def joints(self) -> dict[str, JointDescription]:
        """The joints that can move, by name."""
        kinds = {"revolute", "continuous", "prismatic"}
        found = (joint for joint in self._root.findall("joint") if joint.get("type") in kinds)
        return {joint.get("name", ""): self._joint(joint) for joint in found}

    @cached_property
    def solid_links(self) -> tuple[str, ...]:
        """Links with collision geometry, each after the link that it hangs on."""
        solid = {
            link.get("name", "")
            for link in self._root.findall("link")
            if link.find("collision") is not None
        }
        (root,) = (link for link in self.links if link not in self.parents)
        return tuple(link for link in self._below(root) if link in solid)

    @cached_property
    def urdf(self) -> Path:
        """The URDF, ready for PyBullet and pinocchio.

        A copy in the user's cache folder (``$XDG_CACHE_HOME/guided-lgp``): meshes have the path of
        the installed files; pure frames, which have no inertia, get a mass of 1 g, where PyBullet
        would assume 1 kg; and meshes without normals, which would be drawn black, are drawn from
        repaired copies. Their names depend on their content.
        """
        root = copy.deepcopy(self._root)
        for mesh in root.iter("mesh"):
            mesh.set("filename", str(self._resolved(mesh.get("filename", ""))))
        for link in root.iter("link"):
            if link.find("inertial") is None:
                inertial = ET.SubElement(link, "inertial")
                ET.SubElement(inertial, "mass", value="0.001")
                moments = {"ixx": "1e-6", "iyy": "1e-6", "izz": "1e-6"}
                ET.SubElement(inertial, "inertia", moments | {"ixy": "0", "ixz": "0", "iyz": "0"})
        for mesh in root.findall("link/visual/geometry/mesh"):
            mesh.set("filename", str(_with_normals(Path(mesh.get("filename", "")))))
        return _by_content(self.source, ET.tostring(root))

    @cached_property
    def disabled_pairs(self) -> frozenset[frozenset[str]]:
        """Pairs of links that are not checked for self-collision: those of the SRDF.

        Without one, neighbours, and pairs that collide always or never in random configurations.

        Raises:
            InputError: the SRDF cannot be read, or names a link that the URDF does not have.
        """
        if self.srdf is None:
            return self._sampled_pairs
        where = f"{self.where}: description.srdf"
        root = read_xml(self.srdf, where, "an SRDF")
        pairs = [
            (pair.get("link1", ""), pair.get("link2", ""))
            for pair in root.iter("disable_collisions")
        ]
        for link in (link for pair in pairs for link in pair if link not in self.links):
            raise InputError(where, f"disables collisions of unknown link {link}", f"{self.source}")
        return frozenset(map(frozenset, pairs))

    @cached_property
    def _sampled_pairs(self) -> frozenset[frozenset[str]]:
        """Sampled once per content of the description, and kept beside its copy."""
        file = made(f"{self.urdf.stem}.pairs.json", lambda _: self._pairs_document())
        assert file is not None  # a document is always made
        return frozenset(map(frozenset, json.loads(file.read_text(encoding="utf-8"))))

    def _pairs_document(self) -> bytes:
        ranges = {name: joint.limits or (-np.pi, np.pi) for name, joint in self.joints.items()}
        pairs = sorted(sorted(pair) for pair in sampled_pairs(self.urdf, ranges))
        return json.dumps(pairs).encode()

    def require_links(self, field: str, *links: str) -> None:
        """Check that the URDF has some links.

        Raises:
            InputError: the first that it does not have.
        """
        for link in links:
            if link not in self.links:
                accepted = _similar(link, self.links)
                raise InputError(f"{self.where}: {field}", f"unknown link {link}", accepted)

    def require_joints(self, field: str, *joints: str) -> None:
        """Check that the URDF has some joints, and that they can move.

        Raises:
            InputError: the first of which that is not so.
        """
        for joint in joints:
            if joint not in self.joints:
                accepted = _similar(joint, tuple(self.joints))
                fault = f"{joint} is no joint that moves"
                raise InputError(f"{self.where}: {field}", fault, accepted)

    def require_chain(self, field: str, joints: Sequence[str], link: str) -> None:
        """Check that joints carry a link, in their order from the root.

        Raises:
            InputError: they do not.
        """
        turning = self.joints_above(link)
        if [joint for joint in turning if joint in joints] != list(joints):
            fault = f"{', '.join(joints)} do not carry {link} one after the other"
            raise InputError(f"{self.where}: {field}", fault, ", ".join(turning))

    def require_known(self, field: str, joints: Container[str], *links: str) -> None:
        """Check that all joints that move some links are among those that a file names.

        Raises:
            InputError: the first that is not.
        """
        for link in links:
            for joint in self.joints_above(link):
                if joint not in joints:
                    raise InputError(f"{self.where}: {field}", f"lack {joint}, which moves {link}")

    def joints_above(self, link: str) -> list[str]:
        """The joints that move a link, from the root on."""
        carrier = {child: joint for joint, child in self.children.items()}
        way = []
        while link in self.parents:
            way.append(carrier[link])
            link = self.parents[link]
        return [joint for joint in reversed(way) if joint in self.joints]

    def solid_links_below(self, joint: str) -> tuple[str, ...]:
        """Links with collision geometry that a joint moves."""
        below = set(self._below(self.children[joint]))
        return tuple(link for link in self.solid_links if link in below)

    def _below(self, link: str) -> Iterator[str]:
        """The link and all that hang on it."""
        yield link
        for child, parent in self.parents.items():
            if parent == link:
                yield from self._below(child)

    def _joint(self, joint: ET.Element) -> JointDescription:
        limit, mimic = joint.find("limit"), joint.find("mimic")
        stated = {} if limit is None else limit.attrib
        limits = None
        if joint.get("type") != "continuous":
            if not {"lower", "upper"} <= stated.keys():
                raise InputError(str(self.source), f"joint {joint.get('name')} has no limits")
            limits = float(stated["lower"]), float(stated["upper"])
            safety = joint.find("safety_controller")
            if self.soft_limits and safety is not None:
                limits = (
                    max(limits[0], float(safety.get("soft_lower_limit", limits[0]))),
                    min(limits[1], float(safety.get("soft_upper_limit", limits[1]))),
                )
        return JointDescription(
            limits,
            float(stated.get("velocity", "inf")),
            float(stated.get("effort", "inf")) or np.inf,
            1.0 if mimic is None else float(mimic.get("multiplier", "1")),
            "m" if joint.get("type") == "prismatic" else "rad",
        )

    def _resolved(self, name: str) -> Path:
        """The file that a URDF means, relative to itself or to a package."""
        where = f"{self.where}: description.packages"
        if not name.startswith(_PACKAGE):
            file = (self.source.parent / name.removeprefix("file://")).resolve()
            if not file.is_file():
                raise InputError(f"{self.where}: description.urdf", f"{file} is not a file")
            return file
        package, _, rest = name.removeprefix(_PACKAGE).partition("/")
        above = self.source.parents
        folders = [self.packages[package]] if package in self.packages else above
        for folder in folders:
            for candidate in (folder / package / rest, folder / rest):
                if candidate.is_file():
                    return candidate
        raise InputError(where, f"{name} is not above {self.source}", f"{package}: its folder")


def find_description(where: Path, stated: DescriptionFiles) -> Description:
    """Find the files of a description.

    Args:
        where: the robot file.
        stated: what it says about them.

    Raises:
        InputError: a package is not installed, or a file is missing.
    """

    def found(field: str, name: str) -> Path:
        if stated.package is not None:
            return _shipped(stated.package, name)
        file = (where.parent / name).resolve()
        if not file.is_file():
            raise InputError(f"{where}: description.{field}", f"{file} is not a file")
        return file

    return Description(
        where=str(where),
        source=found("urdf", stated.urdf),
        srdf=None if stated.srdf is None else found("srdf", stated.srdf),
        packages={name: where.parent / folder for name, folder in stated.packages.items()},
        soft_limits=stated.limits == "soft",
    )


def _shipped(package: str, name: str) -> Path:
    """A file that comes with this package, or of the installed one, by the end of its path."""
    if (DESCRIPTIONS / name).is_file():
        return DESCRIPTIONS / name
    try:
        recorded = files(package) or []
    except (PackageNotFoundError, ValueError):  # the second: no name of a package at all
        raise InputError(package, "is not installed", f"pip install {package}") from None
    parts = Path(name).parts
    for file in recorded:
        if file.parts[-len(parts) :] == parts:
            return Path(os.fspath(file.locate())).resolve()
    raise InputError(package, f"has no {name}")


def _link(joint: ET.Element, key: str) -> str:
    element = joint.find(key)
    return "" if element is None else element.get("link", "")


def _similar(name: str, accepted: tuple[str, ...]) -> str:
    """The most similar names, for a message."""
    return ", ".join(get_close_matches(name, accepted, 3, 0.0))


def _with_normals(mesh: Path) -> Path:
    """The mesh, or a copy with its facets' normals filled in, if it is an STL without them."""
    content = mesh.read_bytes() if mesh.suffix.lower() == ".stl" else b""
    facets = _facets(content)
    if facets is None or np.any(facets["normal"]):
        return mesh
    sides = np.diff(facets["vertices"].astype(float), axis=1)
    normals = np.cross(sides[:, 0], sides[:, 1])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    facets["normal"] = normals / np.maximum(lengths, 1e-12)
    return _by_content(mesh, content[:_STL_HEADER] + facets.tobytes())


def _facets(content: bytes) -> np.ndarray | None:
    """The facets of a binary STL, which has their number; None for other files."""
    count = int.from_bytes(content[_STL_HEADER - 4 : _STL_HEADER], "little")
    if len(content) != _STL_HEADER + count * _STL_FACET.itemsize or not count:
        return None
    return np.frombuffer(content, _STL_FACET, offset=_STL_HEADER).copy()


def _by_content(source: Path, content: bytes) -> Path:
    """A copy in the cache with another content, which is in its name."""
    return kept(f"{source.stem}-{sha256(content).hexdigest()[:16]}{source.suffix.lower()}", content)
