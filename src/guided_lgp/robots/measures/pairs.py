"""Which pairs of a robot's links are not checked for collisions."""

from collections.abc import Collection, Mapping
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np

from guided_lgp.robots.chain import Array, read_joints

Pairs = frozenset[frozenset[str]]

_SAMPLES = 2000
"""Configurations that decide about a pair."""
_ALWAYS = 0.98
"""Share of them from which on a pair is said to collide always."""


def sampled_pairs(urdf: Path, limits: Mapping[str, tuple[float, float]]) -> Pairs:
    """Pairs of neighbours, and those that collide always or never.

    Args:
        urdf: the description's file, with plain paths of meshes.
        limits: ranges (rad or m) of the joints that move; the others stay at zero.
    """
    import pinocchio as pin  # heavy: only where there is no SRDF

    model = pin.buildModelFromUrdf(str(urdf))
    geometry = _hulls(model, urdf)
    collisions = np.zeros(len(geometry.collisionPairs))
    data, shapes = model.createData(), geometry.createData()
    for q in _configurations(model, limits):
        pin.computeCollisions(model, data, geometry, shapes, q, False)
        collisions += [result.isCollision() for result in shapes.collisionResults]
    share: dict[frozenset[str], float] = {}
    for pair, count in zip(geometry.collisionPairs, collisions, strict=True):
        ends = frozenset(_link(model, geometry, body) for body in (pair.first, pair.second))
        share[ends] = max(share.get(ends, 0.0), count / _SAMPLES)
    settled = {ends for ends, s in share.items() if s == 0.0 or s >= _ALWAYS}
    return frozenset(settled | _neighbours(urdf, share))


def _hulls(model: Any, urdf: Path) -> Any:
    """The links' shapes, meshes as their hulls, with all pairs of different links."""
    import pinocchio as pin

    geometry = pin.buildGeomFromUrdf(model, str(urdf), pin.GeometryType.COLLISION)
    for body in geometry.geometryObjects:
        if hasattr(body.geometry, "buildConvexHull"):
            body.geometry.buildConvexHull(True, "Qt")
            body.geometry = body.geometry.convex
    for first, second in combinations(range(geometry.ngeoms), 2):
        if _link(model, geometry, first) != _link(model, geometry, second):
            geometry.addCollisionPair(pin.CollisionPair(first, second))
    return geometry


def _link(model: Any, geometry: Any, body: int) -> str:
    return str(model.frames[geometry.geometryObjects[body].parentFrame].name)


def _configurations(model: Any, limits: Mapping[str, tuple[float, float]]) -> Array:
    """Random configurations (samples, nq)."""
    import pinocchio as pin

    random = np.random.default_rng(0)
    full = np.tile(pin.neutral(model), (_SAMPLES, 1))
    for name in sorted(limits):
        joint = model.joints[model.getJointId(name)]
        low, high = np.clip(limits[name], -np.pi, np.pi)
        values = random.uniform(low, high, _SAMPLES)
        if joint.nq == 2:
            full[:, joint.idx_q] = np.cos(values)
            full[:, joint.idx_q + 1] = np.sin(values)
        else:
            full[:, joint.idx_q] = values
    return full


def _neighbours(urdf: Path, pairs: Collection[frozenset[str]]) -> set[frozenset[str]]:
    """Those of the pairs with one joint between them, links without a shape left out."""
    joints = read_joints(urdf)
    shaped = {link for pair in pairs for link in pair}

    def above(link: str) -> str:
        while link in joints:
            link = joints[link].parent
            if link in shaped:
                return link
        return ""

    return {frozenset((link, above(link))) for link in shaped} & set(pairs)
