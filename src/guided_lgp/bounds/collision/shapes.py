"""Convex shapes in coal: of a robot's links, and of bodies."""

import pickle
import xml.etree.ElementTree as ET
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from guided_lgp.bounds.results import Array
from guided_lgp.cache import made
from guided_lgp.scene.shapes import Convex


class LinkShape(NamedTuple):
    """A collision shape of a robot's link."""

    link: str
    joint: int
    """Of pinocchio's model, which moves it."""
    pose: Array
    """(4, 4) in the frame of the joint."""
    shape: Any


@cache
def robot_shapes(urdf: Path) -> tuple[LinkShape, ...]:
    """The convex shape of every collision geometry of a robot's links, made once per content."""
    meshes = ET.parse(urdf).getroot().findall("link/collision/geometry/mesh")
    files = (Path(mesh.get("filename", "")) for mesh in meshes)
    versions = f"{pin.__version__} {coal.__version__}".encode()
    digest = sha256(b"".join((versions, *(sha256(f.read_bytes()).digest() for f in files))))
    name = f"{urdf.stem}.{digest.hexdigest()[:16]}.shapes"  # the stem has the URDF's own digest
    file = made(name, lambda _: pickle.dumps(_made(urdf)))
    assert file is not None  # there is always something to write
    return tuple(LinkShape(*entry) for entry in pickle.loads(file.read_bytes()))


def _made(urdf: Path) -> list[tuple[Any, ...]]:
    model = pin.buildModelFromUrdf(str(urdf))
    geometry = pin.buildGeomFromUrdf(model, str(urdf), pin.GeometryType.COLLISION)
    found = []
    for body in geometry.geometryObjects:
        shape = body.geometry
        if isinstance(shape, coal.BVHModelBase):
            shape.buildConvexHull(True, "Qt")
            shape = shape.convex
        link = body.name[: body.name.rindex("_")]
        found.append((link, body.parentJoint, body.placement.homogeneous, shape))
    return found


def convex_shape(convex: Convex) -> Any:
    """A body in coal."""
    if convex.shape == "mesh":
        vertices = coal.StdVec_Vec3s()
        vertices.extend(np.array(vertex) for vertex in convex.vertices)
        return coal.ConvexBase.convexHull(vertices, True, "Qt")
    if convex.shape == "cylinder":
        return coal.Cylinder(convex.half[0], 2 * convex.half[2])
    return coal.Box(*(2 * half for half in convex.half))
