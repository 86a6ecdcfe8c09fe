"""Configurations that are surely free of collisions, found many at once by compiled code.

The test is sufficient, not necessary: oriented boxes around bodies, and their vertices along the
axes of the other's box. What it leaves open is for an exact check to decide, so a verdict is the
same with it and without.
"""

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from guided_lgp.bounds.collision.shapes import robot_shapes
from guided_lgp.bounds.results import Array
from guided_lgp.compiled import address, load_compiled
from guided_lgp.robots.kinematics import flat, moving_joints
from guided_lgp.robots.measures.hulls import shape_vertices

_MANY, _FEW = 16, 4
"""Configurations at once: of motions, and of keyframes, which come in pairs."""
_ROUNDING = 1e-5
"""What single precision may be off by (m): more padding than that."""


class _Scene(ctypes.Structure):
    """``scene`` of certificate.c."""

    _fields_ = (
        ("joints", ctypes.c_int),
        *((name, ctypes.c_void_p) for name in ("parent", "placement", "sine", "versine", "slide")),
        ("loose", ctypes.c_int),
        ("bodies", ctypes.c_int),
        *((name, ctypes.c_void_p) for name in ("joint", "frame", "half")),
        *((name, ctypes.c_void_p) for name in ("start", "vertices", "radius")),
    )


@dataclass(frozen=True)
class _Body:
    """A convex body in an oriented box around it."""

    frame: Array
    """(4, 4) of the box, in the frame of the shape."""
    half: Array
    """(3,) m."""
    vertices: Array
    """(n, 3) in the box's frame."""


class Certificate:
    """Says of configurations in one scene which bodies are surely apart."""

    def __init__(
        self,
        urdf: Path,
        model: Any,
        template: Array,
        geometry: Any,
        moving: Sequence[str],
        loose: Sequence[int] = (),
    ) -> None:
        """Prepare a scene.

        Args:
            urdf: of the robot.
            model: of it, by pinocchio.
            template: (nq,) of the model; the joints that do not move stay there.
            geometry: all bodies, by pinocchio, those of the robot first; each hangs on a joint.
            moving: the joints of a configuration.
            loose: numbers of the bodies that hang on none, but are where each configuration says.
        """
        self._library = _library(_FEW if loose else _MANY)
        numbers = [model.getJointId(name) for name in moving]
        columns = np.argsort(numbers, kind="stable")  # from the root to the tips
        self._columns = columns.astype(np.intc)
        parents, joints, self._carriers = moving_joints(model, template, sorted(numbers))
        links = _boxed_links(urdf)
        others = list(geometry.geometryObjects)[len(links) :]
        bodies = [*links, *(_boxed(shape_vertices(body.geometry)) for body in others)]
        self._boxes = [body.frame for body in bodies]
        self._joint = np.empty(len(bodies), dtype=np.intc)
        self._frame = np.empty((len(bodies), 12), dtype=np.float32)
        radii = [np.linalg.norm(body.vertices, axis=1).max() for body in bodies]
        self._arrays = [
            parents,
            *(array.astype(np.float32) for array in joints),
            np.array([body.half for body in bodies], dtype=np.float32),
            np.cumsum([0, *(len(body.vertices) for body in bodies)]).astype(np.intc),
            np.concatenate([body.vertices for body in bodies]).astype(np.float32),
            np.array(radii, dtype=np.float32),
        ]
        pointers = [array.ctypes.data for array in self._arrays]
        own = [self._joint.ctypes.data, self._frame.ctypes.data]
        self._scene = _Scene(
            len(moving), *pointers[:5], len(loose), len(bodies), *own, *pointers[5:]
        )
        for number, body in enumerate(geometry.geometryObjects):
            self.move(number, body.parentJoint, body.placement.homogeneous)
        for joint, number in enumerate(loose, len(moving)):
            self._joint[number], self._frame[number] = joint, flat(self._boxes[number])

    def move(self, body: int, joint: int, placement: Array) -> None:
        """Put a body somewhere: pose (4, 4) in the frame of a joint of the model."""
        carrier, offset = self._carriers[joint]
        self._joint[body] = carrier
        self._frame[body] = flat(offset @ placement @ self._boxes[body])

    def near(self, values: Array, pairs: NDArray[np.intc], padding: float) -> NDArray[np.bool_]:
        """Which pairs (m, p) of bodies may be near each other; all of them without a compiler.

        Args:
            values: (m, joints) of the moving joints (rad or m).
            pairs: (p, 2) numbers of bodies, contiguous.
            padding: the distance (m) at which they are near.
        """
        if self._library is None:
            return np.ones((len(values), len(pairs)), dtype=np.bool_)
        near = np.zeros((len(values), len(pairs)), dtype=np.bool_)
        apart = np.full(len(pairs), padding + _ROUNDING, dtype=np.float32)
        self._find(self._library.certify, near, values, pairs, address(apart))
        return near

    def apart(
        self,
        values: Array,
        pairs: NDArray[np.intc],
        padding: NDArray[np.float32],
        loose: Array,
        skipped: NDArray[np.bool_],
    ) -> NDArray[np.bool_]:
        """In which configurations (m,) all is finite and all pairs are surely apart.

        In none without a compiler. Searches longer than :meth:`near`, where it has to.

        Args:
            values: see :meth:`near`; contiguous.
            pairs: the same.
            padding: (p,) distances (m) that they have at least, in single precision; negative ones
                let them be so deep in each other.
            loose: (m, loose bodies, 7) where these are, contiguous.
            skipped: (m, p) pairs that are not looked at.
        """
        sure = np.zeros(len(values), dtype=np.bool_)
        if self._library is not None:
            arrays: list[NDArray[Any]] = [self._columns, values, loose, skipped, sure]
            given = ctypes.byref(self._scene), len(pairs), address(pairs), address(padding)
            self._library.settle(*given, len(values), *map(address, arrays))
        return sure

    def gaps(self, values: Array, pairs: NDArray[np.intc]) -> NDArray[np.float32]:
        """What the distances (m, p) of pairs are at least (m); nothing is known without a compiler.

        See :meth:`near`.
        """
        least = np.full((len(values), len(pairs)), -np.inf, dtype=np.float32)
        if self._library is not None:
            self._find(self._library.gaps, least, values, pairs)
        return least - np.float32(_ROUNDING)

    def _find(
        self,
        function: Any,
        found: NDArray[Any],
        values: Array,
        pairs: NDArray[np.intc],
        *options: ctypes.c_void_p,
    ) -> None:
        plain = np.ascontiguousarray(values[:, self._columns], dtype=np.float32)
        arrays = (plain, np.sin(plain), 1 - np.cos(plain), found)
        given = (ctypes.byref(self._scene), len(pairs), address(pairs), *options)
        function(*given, len(values), *map(address, arrays))


@cache
def _library(lanes: int) -> ctypes.CDLL | None:
    """Compiled for so many configurations at once."""
    source = Path(__file__).with_name("certificate.c").read_text(encoding="utf-8")
    return load_compiled("certificate", f"#define LANES {lanes}\n{source}")


@cache
def _boxed_links(urdf: Path) -> tuple[_Body, ...]:
    """The bodies of a robot, in the order of their shapes."""
    return tuple(_boxed(shape_vertices(link.shape)) for link in robot_shapes(urdf))


def _boxed(vertices: Array) -> _Body:
    """The smaller one of two boxes: along the frame's axes, and along the principal ones."""
    _, _, principal = np.linalg.svd(vertices - vertices.mean(axis=0), full_matrices=False)
    return min(
        (_in_box(vertices, axes) for axes in (np.eye(3), principal)),
        key=lambda body: float(np.prod(body.half)),
    )


def _in_box(vertices: Array, axes: Array) -> _Body:
    """Vertices (n, 3) in the box along axes (3, 3), one per row; a mirror image does no harm."""
    along = vertices @ axes.T
    low, high = along.min(axis=0), along.max(axis=0)
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = axes.T, axes.T @ (low + high) / 2
    return _Body(frame, (high - low) / 2, along - (low + high) / 2)
