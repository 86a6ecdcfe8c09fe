"""Forward kinematics: in compiled code, and by pinocchio, which reads the robot."""

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from guided_lgp.compiled import address, load_compiled
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
        self.names = tuple(joints)
        self.joints = tuple(joint_index(self.model, name) for name in joints)
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
            full[:, joint_index(self.model, joint).position] = value
        fill(full, self.joints, q)
        return full

    def link_poses(self, q: Array, fixed: Mapping[str, float], links: Sequence[str]) -> Array:
        """Poses (T, len(links), 7) of links in the root's frame; see :meth:`rows`."""
        library = _library()
        if library is None:
            return self.link_poses_by_pinocchio(q, fixed, links)
        return _links(self, tuple(sorted(fixed.items())), tuple(links)).poses(library, q)

    def link_poses_by_pinocchio(
        self, q: Array, fixed: Mapping[str, float], links: Sequence[str]
    ) -> Array:
        """The same without a compiler, many times slower."""
        import pinocchio

        frames = [self.model.getFrameId(link) for link in links]
        poses = np.empty((len(q), len(links), 7))
        for row, configuration in enumerate(self.rows(q, fixed)):
            pinocchio.forwardKinematics(self.model, self.data, configuration)
            for column, frame in enumerate(frames):
                placement = pinocchio.updateFramePlacement(self.model, self.data, frame)
                poses[row, column] = pinocchio.SE3ToXYZQUAT(placement)
        return poses


def joint_index(model: Any, name: str) -> JointIndex:
    """Where a joint stands in vectors of a model."""
    joint = model.joints[model.getJointId(name)]
    return JointIndex(joint.idx_q, joint.idx_v, joint.nq == 2)


def fill(full: Array, indices: Sequence[JointIndex], angles: Array) -> None:
    """Write joint angles (..., n) in rad into pinocchio configurations (..., nq)."""
    for column, index in enumerate(indices):
        if index.continuous:
            full[..., index.position] = np.cos(angles[..., column])
            full[..., index.position + 1] = np.sin(angles[..., column])
        else:
            full[..., index.position] = angles[..., column]


class _Tree(ctypes.Structure):
    """``tree`` of kinematics.c."""

    _fields_ = (
        ("joints", ctypes.c_int),
        *((name, ctypes.c_void_p) for name in ("parent", "column", "placement")),
        *((name, ctypes.c_void_p) for name in ("sine", "versine", "slide")),
        ("frames", ctypes.c_int),
        *((name, ctypes.c_void_p) for name in ("carrier", "frame")),
    )


class _Links:
    """Some links on the joints of the arms, for the compiled code."""

    def __init__(
        self, kinematics: Kinematics, fixed: Mapping[str, float], links: Sequence[str]
    ) -> None:
        model = kinematics.model
        numbers = [model.getJointId(name) for name in kinematics.names]
        template = kinematics.rows(np.zeros((1, len(numbers))), fixed)[0]
        parents, joints, carriers = moving_joints(model, template, sorted(numbers))
        frames = [model.frames[model.getFrameId(link)] for link in links]
        places = [carriers[frame.parentJoint][1] @ frame.placement.homogeneous for frame in frames]
        self._arrays: list[NDArray[Any]] = [
            parents,
            np.argsort(numbers).astype(np.intc),
            *joints,
            np.array([carriers[frame.parentJoint][0] for frame in frames], dtype=np.intc),
            np.array([flat(place) for place in places]),
        ]
        pointers = [array.ctypes.data for array in self._arrays]
        self._tree = _Tree(len(numbers), *pointers[:6], len(frames), *pointers[6:])

    def poses(self, library: ctypes.CDLL, q: Array) -> Array:
        """See :meth:`Kinematics.link_poses`."""
        rows = np.ascontiguousarray(q, dtype=float)
        found = np.empty((len(rows), self._tree.frames, 7))
        library.frame_poses(ctypes.byref(self._tree), len(rows), address(rows), address(found))
        return found


@lru_cache(maxsize=64)
def _links(
    kinematics: Kinematics, fixed: tuple[tuple[str, float], ...], links: tuple[str, ...]
) -> _Links:
    return _Links(kinematics, dict(fixed), links)


@cache
def _library() -> ctypes.CDLL | None:
    source = Path(__file__).with_name("kinematics.c").read_text(encoding="utf-8")
    return load_compiled("kinematics", source)


def moving_joints(
    model: Any, template: Array, moving: Sequence[int]
) -> tuple[NDArray[np.intc], list[Array], list[tuple[int, Array]]]:
    """The moving joints of a model alone, as compiled code wants them.

    The rotation of a joint in its parent is that of its placement, plus the sine of its value
    times a matrix, plus one minus the cosine times another.

    Args:
        model: by pinocchio.
        template: (nq,) of it; the joints that do not move stay there.
        moving: numbers of the joints that move, ascending.

    Returns:
        parent of each (-1: the world); placements (n, 12), sines (n, 3, 3), versines (n, 3, 3) and
        slides (n, 3); and for every joint of the model the moving one that it hangs on (-1: none),
        with its pose (4, 4) there.
    """
    import pinocchio

    data = model.createData()
    pinocchio.forwardKinematics(model, data, template)
    carriers: list[tuple[int, Array]] = [(-1, np.eye(4))]
    parents: list[int] = []
    rows: list[tuple[Array, ...]] = []
    for joint in range(1, model.njoints):
        carrier, offset = carriers[model.parents[joint]]
        if joint not in moving:
            carriers.append((carrier, offset @ data.liMi[joint].homogeneous))
            continue
        carriers.append((len(parents), np.eye(4)))
        parents.append(carrier)
        placement = offset @ model.jointPlacements[joint].homogeneous
        slide, axis = np.split(np.ravel(data.joints[joint].S), 2)
        cross = np.cross(axis, np.eye(3)).T
        turn = placement[:3, :3]
        rows.append((flat(placement), turn @ cross, turn @ cross @ cross, turn @ slide))
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    return np.array(parents, dtype=np.intc), columns, carriers


def flat(placement: Array) -> Array:
    """Rotation by rows, then position (12,), of a pose (4, 4)."""
    return np.concatenate([placement[:3, :3].ravel(), placement[:3, 3]])
