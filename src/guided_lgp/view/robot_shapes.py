"""The robot as displays draw it: a tree of frames, one per moving joint, and meshes on them."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
import pinocchio
from numpy.typing import NDArray

from guided_lgp.poses import Array
from guided_lgp.scene.model import Scene

Colour = tuple[float, float, float]
"""RGB in 0..1."""

_SHELL: Colour = (0.89, 0.89, 0.88)
_HAND: Colour = (0.47, 0.48, 0.51)


@dataclass(frozen=True)
class Mesh:
    """A visible part of a link."""

    path: str
    """Below the frame of the joint that moves it."""
    vertices: Array
    """(V, 3) m."""
    triangles: NDArray[np.int64]
    """(F, 3) indices of vertices."""
    colour: Colour
    placement: Array
    """Pose (7,) in the joint's frame."""


class RobotShapes:
    """Where the frames of a scene's robot are, at first with all arms at their side."""

    def __init__(self, scene: Scene) -> None:
        self._robot = scene.robot.description
        self._model = pinocchio.buildModelFromUrdf(str(self._robot.urdf))
        self._data = self._model.createData()
        self._q = pinocchio.neutral(self._model)
        self.root = f"/{self._robot.name}"
        """Path of the base."""
        self._paths = [self.root]
        for index in range(1, self._model.njoints):
            parent = self._paths[self._model.parents[index]]
            self._paths.append(f"{parent}/{self._model.names[index]}")
        start = dict(zip(self._robot.joint_names, scene.robot.start.tolist(), strict=True))
        self.configure({**scene.robot.fixed_values, **start})

    def configure(self, joints: Mapping[str, float]) -> dict[str, Array]:
        """Move joints by name (rad, m where prismatic); the others stay.

        Returns:
            By path, the pose (7,) of each of these joints in its parent's frame.
        """
        for name, value in joints.items():
            joint = self._model.joints[self._model.getJointId(name)]
            # pinocchio stores a continuous joint as the cosine and sine of its angle.
            coordinates = value if joint.nq == 1 else (np.cos(value), np.sin(value))
            self._q[joint.idx_q : joint.idx_q + joint.nq] = coordinates
        pinocchio.forwardKinematics(self._model, self._data, self._q)
        moved = map(self._model.getJointId, joints)
        return {self._paths[index]: _array(self._data.liMi[index]) for index in moved}

    def all_frames(self) -> dict[str, Array]:
        """Pose (7,) of every joint in its parent's frame, by path, parents first."""
        poses = map(_array, self._data.liMi[1:])
        return dict(zip(self._paths[1:], poses, strict=True))

    def meshes(self) -> Iterator[Mesh]:
        """The visible parts of all links."""
        visuals = pinocchio.buildGeomFromUrdf(
            self._model, str(self._robot.urdf), pinocchio.GeometryType.VISUAL
        )
        hands = {link for arm in self._robot.arms.values() for link in arm.hand_links}
        for visual in visuals.geometryObjects:
            mesh = visual.geometry
            # The primitive shapes of the description mark sensor frames, a few mm wide.
            if hasattr(mesh, "num_tris"):
                link, _, _ = visual.name.rpartition("_")
                yield Mesh(
                    f"{self._paths[visual.parentJoint]}/{visual.name}",
                    np.asarray(mesh.vertices()),
                    np.array(
                        [[mesh.tri_indices(i)[k] for k in range(3)] for i in range(mesh.num_tris)]
                    ),
                    _HAND if link in hands else _SHELL,
                    _array(visual.placement),
                )


def _array(placement: pinocchio.SE3) -> Array:
    return np.array(pinocchio.SE3ToXYZQUAT(placement))
