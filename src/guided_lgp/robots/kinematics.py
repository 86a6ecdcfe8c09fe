"""Forward kinematics by pinocchio."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from guided_lgp.poses import Array


@dataclass(frozen=True)
class JointIndex:
    """Where a joint stands in pinocchio's configuration and velocity vectors."""

    position: int
    velocity: int
    continuous: bool
    """A continuous joint is stored as cosine and sine."""


class Kinematics:
    """Pinocchio's model of a robot, driven by the joints of its arms."""

    def __init__(self, urdf: Path, joints: Sequence[str]) -> None:
        import pinocchio  # heavy: only where kinematics are needed

        self.model: Any = pinocchio.buildModelFromUrdf(str(urdf))
        self.data: Any = self.model.createData()
        self.joints = tuple(map(self._index, joints))
        """Where the arms' joints stand, in the order of a configuration."""

    def rows(self, q: Array, fixed: Mapping[str, float]) -> Array:
        """Pinocchio configurations (T, nq) of configurations (T, n); fingers are at zero.

        Args:
            q: (T, n) rad.
            fixed: values of other joints by name.
        """
        import pinocchio

        full = np.tile(pinocchio.neutral(self.model), (len(q), 1))
        for joint, value in fixed.items():
            full[:, self._index(joint).position] = value
        fill(full, self.joints, q)
        return full

    def link_poses(self, q: Array, fixed: Mapping[str, float], links: Sequence[str]) -> Array:
        """Poses (T, len(links), 7) of links in the root's frame; see :meth:`rows`."""
        import pinocchio

        frames = [self.model.getFrameId(link) for link in links]
        poses = np.empty((len(q), len(links), 7))
        for row, configuration in enumerate(self.rows(q, fixed)):
            pinocchio.forwardKinematics(self.model, self.data, configuration)
            for column, frame in enumerate(frames):
                placement = pinocchio.updateFramePlacement(self.model, self.data, frame)
                poses[row, column] = pinocchio.SE3ToXYZQUAT(placement)
        return poses

    def _index(self, name: str) -> JointIndex:
        joint = self.model.joints[self.model.getJointId(name)]
        return JointIndex(joint.idx_q, joint.idx_v, joint.nq == 2)


def fill(full: Array, indices: Sequence[JointIndex], angles: Array) -> None:
    """Write joint angles (..., n) in rad into pinocchio configurations (..., nq)."""
    for column, index in enumerate(indices):
        if index.continuous:
            full[..., index.position] = np.cos(angles[..., column])
            full[..., index.position + 1] = np.sin(angles[..., column])
        else:
            full[..., index.position] = angles[..., column]
