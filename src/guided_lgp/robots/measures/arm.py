"""Measures of an arm and its hand, derived from the description; a robot file may state others."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from guided_lgp.robots.chain import Array, Chain, Joint, path_between, read_chain, read_joints
from guided_lgp.robots.measures.hand import HandShape, measure_hand
from guided_lgp.robots.measures.hulls import link_hulls
from guided_lgp.robots.measures.levers import lever_arms
from guided_lgp.robots.measures.spheres import kept_spheres

_LOAD = 0.15
"""Reach (m) of a held object or of the hand beyond the tool frame's origin, for the metric."""
_SLACK = 0.005
"""By how much (m) an object is narrower than the widest gap of the fingers."""


@dataclass(frozen=True)
class SegmentMeasures:
    """Links at the ends of an arm's segments, and how far the links reach beyond the axes (m)."""

    ends: tuple[str, ...]
    radius: float


@dataclass(frozen=True)
class ArmMeasures:
    """What a URDF tells about one arm."""

    where: str
    """File and field of the arm, for messages."""
    urdf: Path
    """Ready for pinocchio, with plain paths of meshes."""
    root: str
    joints: tuple[str, ...]
    tool: tuple[str, Array, Array]
    """Link, and rotation (3, 3) and position (3,) of the tool frame in it."""
    links: tuple[str, ...]
    """Links with collision geometry that the arm moves, the hand left out."""
    hand_links: tuple[str, ...]
    fingers: Mapping[str, float]
    """The joints that open the hand, and the factor that each has to their common value."""
    finger_limits: tuple[float, float]

    @cached_property
    def chain(self) -> Chain:
        """From the root to the tool frame, all other joints at zero."""
        link, rotation, position = self.tool
        return read_chain(self.urdf, self.root, link, self.joints).extended(rotation, position)

    @cached_property
    def hand(self) -> HandShape:
        """Palm and fingers."""
        return measure_hand(
            self.where, self.urdf, self.tool, self.hand_links, self.fingers, self.finger_limits
        )

    @property
    def grasp_width(self) -> float:
        """Widest side (m) of an object that the fingers close across."""
        return float(self.hand.gaps.max()) - _SLACK

    @cached_property
    def lever_arms(self) -> tuple[float, ...]:
        """How far (m) each joint moves the tool frame per rad, at most."""
        return tuple(lever_arms(self.chain).tolist())

    @property
    def metric(self) -> tuple[float, ...]:
        """How far (m) each joint moves a point of hand or held object per rad."""
        return tuple(lever + _LOAD for lever in self.lever_arms)

    @cached_property
    def segments(self) -> SegmentMeasures:
        """The links between the origins of neighbouring joints."""
        joints = read_joints(self.urdf)
        path = path_between(joints, self.root, self.tool[0])
        moving = [joint.child for joint in path if joint.name in self.joints]
        hulls = link_hulls(self.urdf)
        radius = 0.0
        for link, next_link in pairwise(moving):
            end = _position(path_between(joints, link, next_link))
            for vertices in hulls.get(link, ()):
                radius = max(radius, _beyond(vertices, end))
        return SegmentMeasures(tuple(moving[1:]), radius)

    @cached_property
    def spheres(self) -> dict[str, tuple[tuple[float, float, float, float], ...]]:
        """Spheres (x, y, z, radius) that cover arm and open hand, by link of the chain.

        A link beside the chain counts to the nearest one in the chain above it.
        """
        joints = read_joints(self.urdf)
        path = path_between(joints, self.root, self.tool[0])
        chain = {joint.child for joint in path}
        frames = self._frames()
        spheres: dict[str, list[tuple[float, float, float, float]]] = {}
        links = (*self.links, *self.hand_links)
        shapes = [np.concatenate(link_hulls(self.urdf)[link]) for link in links]
        for link, covering in zip(links, kept_spheres(shapes), strict=True):
            above = link
            while above not in chain:
                above = joints[above].parent
            place = frames[above].actInv(frames[link])
            centres = covering.centres @ place.rotation.T + place.translation
            rows = np.column_stack([centres, covering.radii]).round(4)
            spheres.setdefault(above, []).extend(tuple(row) for row in rows.tolist())
        return {link: tuple(rows) for link, rows in spheres.items()}

    def _frames(self) -> dict[str, Any]:
        """Where the links are with all joints at zero and the hand open."""
        import pinocchio as pin  # heavy: only where a robot is measured

        model = pin.buildModelFromUrdf(str(self.urdf))
        data, q = model.createData(), pin.neutral(model)
        for joint, ratio in self.fingers.items():
            q[model.joints[model.getJointId(joint)].idx_q] = ratio * self.hand.opened
        pin.framesForwardKinematics(model, data, q)
        return {frame.name: data.oMf[i] for i, frame in enumerate(model.frames)}


def _position(path: Sequence[Joint]) -> Array:
    """Origin (3,) of the last link in the frame of the first, joints at zero."""
    rotation, position = np.eye(3), np.zeros(3)
    for joint in path:
        turned, shift = joint.moved(0.0)
        position = position + rotation @ shift
        rotation = rotation @ turned
    return position


def _beyond(vertices: Array, end: Array) -> float:
    """Largest distance (m) of points (n, 3) from the segment from the origin to ``end`` (3,)."""
    share = np.clip(vertices @ end / max(float(end @ end), 1e-12), 0.0, 1.0)
    return float(np.linalg.norm(vertices - share[:, None] * end, axis=1).max())
