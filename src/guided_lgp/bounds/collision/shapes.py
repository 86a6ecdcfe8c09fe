"""Convex shapes in coal: of a robot's links, and of bodies."""

from functools import cache
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from guided_lgp.scene.shapes import Convex


@cache
def robot_shapes(urdf: Path) -> tuple[tuple[Any, Any], ...]:
    """Geometry object and convex shape of every collision geometry of a robot's links."""
    model = pin.buildModelFromUrdf(str(urdf))
    geometry = pin.buildGeomFromUrdf(model, str(urdf), pin.GeometryType.COLLISION)
    bodies = []
    for body in geometry.geometryObjects:
        shape = body.geometry
        if isinstance(shape, coal.BVHModelBase):
            shape.buildConvexHull(True, "Qt")
            shape = shape.convex
        bodies.append((body, shape))
    return tuple(bodies)


def convex_shape(convex: Convex) -> Any:
    """A body in coal."""
    if convex.shape == "mesh":
        vertices = coal.StdVec_Vec3s()
        vertices.extend(np.array(vertex) for vertex in convex.vertices)
        return coal.ConvexBase.convexHull(vertices, True, "Qt")
    if convex.shape == "cylinder":
        return coal.Cylinder(convex.half[0], 2 * convex.half[2])
    return coal.Box(*(2 * half for half in convex.half))
