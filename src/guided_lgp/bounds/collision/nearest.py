"""The nearest pairs of bodies and how their distances change, by coal."""

from bisect import insort
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from guided_lgp.bounds.results import Array


class Nearest:
    """Measures the distances of bodies that hang on the joints of a model."""

    def __init__(self, model: Any, geometry: Any, columns: Sequence[int]) -> None:
        """Prepare.

        Args:
            model: of the robot, by pinocchio.
            geometry: all bodies and the pairs of them; what is moved in it is seen here.
            columns: (n,) where the joints of a configuration are in a velocity of the model.
        """
        self._model, self._data = model, model.createData()
        self._geometry, self._geometry_data = geometry, geometry.createData()
        self._columns = list(columns)
        self._moves = np.zeros((model.njoints, len(columns)))
        """1 where a joint of the model is moved by one of a configuration."""
        for joint in range(1, model.njoints):
            above = {model.joints[number].idx_v for number in model.supports[joint] if number}
            self._moves[joint] = [column in above for column in columns]

    def distances(
        self, coordinates: Array, pairs: Sequence[int], least: NDArray[np.float32], count: int
    ) -> tuple[Array, Array]:
        """The smallest distances of some pairs, to first order.

        Args:
            coordinates: (m, nq) of the model.
            pairs: (p,) their numbers.
            least: (m, p) what their distances are at least (m).
            count: how many pairs per configuration.

        Returns:
            distances (m, count) in m, negative where bodies penetrate, and their gradients
            (m, count, n) in m/rad.
        """
        shape = len(coordinates), count
        values, normals, points = (
            np.empty(shape),
            np.empty((*shape, 1, 3)),
            np.empty((*shape, 2, 3)),
        )
        joints = np.empty((*shape, 2), dtype=int)
        jacobians = np.empty((len(coordinates), 1, 6, len(self._columns)))
        results, pair_of = self._geometry_data.distanceResults, self._geometry.collisionPairs
        for row, configuration in enumerate(coordinates):
            pin.computeJointJacobians(self._model, self._data, configuration)
            pin.updateGeometryPlacements(
                self._model, self._data, self._geometry, self._geometry_data
            )
            jacobians[row] = self._data.J[:, self._columns]
            for column, (distance, pair) in enumerate(self._nearest(pairs, least[row], count)):
                result = results[pair]
                values[row, column], normals[row, column] = distance, result.normal
                points[row, column, 0] = result.getNearestPoint1()
                points[row, column, 1] = result.getNearestPoint2()
                joints[row, column] = self._joints_of(pair_of[pair])
        # A pull at a point along the normal is a force and a torque about the world's origin.
        forces = np.broadcast_to(normals, points.shape)
        wrenches = np.concatenate([forces, np.cross(points, forces)], axis=-1)
        rates = (wrenches @ jacobians) * self._moves[joints]
        return values, rates[:, :, 1] - rates[:, :, 0]

    def _nearest(
        self, pairs: Sequence[int], least: NDArray[np.float32], count: int
    ) -> list[tuple[float, int]]:
        """Distance and number of the nearest pairs; those that may be near are measured first."""
        found: list[tuple[float, int]] = []
        for place in np.argsort(least, kind="stable").tolist():
            if len(found) >= count and least[place] > found[count - 1][0]:
                break
            result = pin.computeDistance(self._geometry, self._geometry_data, pairs[place])
            insort(found, (result.min_distance, pairs[place]))
        return found[:count]

    def _joints_of(self, pair: Any) -> tuple[int, int]:
        """The joints that the bodies of a pair hang on."""
        bodies = self._geometry.geometryObjects
        return bodies[pair.first].parentJoint, bodies[pair.second].parentJoint
