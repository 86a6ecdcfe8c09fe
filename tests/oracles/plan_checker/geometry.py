"""Poses and points as arrays."""

import itertools
from collections.abc import Sequence
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

FLAT = 0.001  # vertices so near to the highest or lowest one are of one face


def face_of(vertices: np.ndarray, side: Literal[-1, 1]) -> np.ndarray:
    """The vertices of a flat top (1) or base (-1)."""
    heights = side * vertices[:, 2]
    return vertices[heights > heights.max() - FLAT]


def planar_pose(x: float, y: float, z: float, yaw: float) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("z", yaw).as_matrix()
    pose[:3, 3] = x, y, z
    return pose


def box_corners(size: Sequence[float]) -> np.ndarray:
    return np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * size


def inverse_pose(pose: np.ndarray) -> np.ndarray:
    result = np.eye(4)
    result[:3, :3] = pose[:3, :3].T
    result[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return result


def homogeneous(points: np.ndarray) -> np.ndarray:
    return np.column_stack([points, np.ones(len(points))])


def placed_points(poses: np.ndarray, vertices: np.ndarray) -> np.ndarray:
    """The vertices (k, 3) at every pose (n, 4, 4): (n, 3, k)."""
    return poses[:, :3] @ homogeneous(vertices).T
