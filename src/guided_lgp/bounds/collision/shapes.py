"""Convex shapes in coal: of a robot's links, and of bodies."""

import json
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
from guided_lgp.poses import IDENTITY
from guided_lgp.scene import Scene
from guided_lgp.scene.shapes import Convex

_KINDS = {
    kind.__name__: kind
    for kind in (coal.Convex, coal.Box, coal.Cylinder, coal.Capsule, coal.Sphere)
}
"""The shapes that a link may have, meshes as convex hulls."""


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
    # What is in the URDF itself is in its name.
    name = f"{urdf.stem}.{digest.hexdigest()[:16]}.shapes.json"
    file = made(name, lambda _: json.dumps(_written(urdf)).encode())
    assert file is not None  # there is always something to write
    return tuple(
        LinkShape(link, joint, np.array(pose), _read(kind, text))
        for link, joint, pose, kind, text in json.loads(file.read_bytes())
    )


def _read(kind: str, text: str) -> Any:
    shape = _KINDS[kind]()
    shape.loadFromString(text)
    return shape


def _written(urdf: Path) -> list[tuple[Any, ...]]:
    """Link, joint, pose, kind and what coal writes of every shape."""
    model = pin.buildModelFromUrdf(str(urdf))
    geometry = pin.buildGeomFromUrdf(model, str(urdf), pin.GeometryType.COLLISION)
    found = []
    for body in geometry.geometryObjects:
        shape = body.geometry
        if isinstance(shape, coal.BVHModelBase):
            shape.buildConvexHull(True, "Qt")
            shape = shape.convex
        link = body.name[: body.name.rindex("_")]
        pose, kind = body.placement.homogeneous.tolist(), type(shape).__name__
        found.append((link, body.parentJoint, pose, kind, shape.saveToString()))
    return found


def bodies_of(scene: Scene) -> tuple[Any, Any]:
    """Pinocchio's model of a scene's robot where it stands, and all bodies by their names.

    First the shapes of the links, then what never moves, then the boxes, which are nowhere yet.
    """
    robot, base = scene.robot.description, pin.XYZQUATToSE3(scene.robot.base_pose)
    model, geometry = robot.kinematics.model.copy(), pin.GeometryModel()

    def add(name: str, joint: int, placement: Any, shape: Any) -> None:
        geometry.addGeometryObject(pin.GeometryObject(name, joint, placement, shape))

    for link, joint, pose, shape in robot_shapes(robot.urdf):
        add(link, joint, pin.SE3(pose) if joint else base * pin.SE3(pose), shape)
    for joint in range(1, model.njoints):
        if model.parents[joint] == 0:
            model.jointPlacements[joint] = base * model.jointPlacements[joint]
    for body in (*scene.in_the_way, *scene.supports):
        add(body.name, 0, pin.XYZQUATToSE3(body.placement), convex_shape(body.convex))
    for box in scene.movable:
        add(box.name, 0, pin.XYZQUATToSE3(IDENTITY), convex_shape(box.convex))
    return model, geometry


def convex_shape(convex: Convex) -> Any:
    """A body in coal."""
    if convex.shape == "mesh":
        vertices = coal.StdVec_Vec3s()
        vertices.extend(np.array(vertex) for vertex in convex.vertices)
        return coal.ConvexBase.convexHull(vertices, True, "Qt")
    if convex.shape == "cylinder":
        return coal.Cylinder(convex.half[0], 2 * convex.half[2])
    return coal.Box(*(2 * half for half in convex.half))
