"""Collision checks for planning: convex hulls of the robot's meshes, boxes and tables, in coal.

The hulls are those that PyBullet makes of the same files, so that its verdict at the end agrees.
A check takes about 10 us: forward kinematics, bounding boxes of all bodies, then exact tests.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import coal
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from guided_lgp.bounds.results import Array
from guided_lgp.poses import IDENTITY, pose
from guided_lgp.scene import GRIPPERS, Scene
from guided_lgp.scene.pr2 import (
    ARM_JOINTS,
    ARM_LINKS,
    CONTINUOUS,
    FINGER_JOINTS,
    HAND_LINKS,
    TOOL_LINK,
    base_pose,
    disabled_pairs,
    urdf_path,
)
from guided_lgp.scene.world import TABLE_THICKNESS

PADDING = 0.003
"""Distance (m) that everything keeps from everything, declared contacts apart."""


@dataclass(frozen=True)
class PlanningScene:
    """What is where, and what may touch, while one arm moves."""

    gripper: str
    """Whose arm moves; the other one stands still."""
    standing: Mapping[str, Array]
    """World pose (7,) of every box that no gripper carries."""
    carried: Mapping[str, tuple[str, Array]] = field(default_factory=dict)
    """Gripper, and pose (7,) in its tool frame, of every box held or standing on a held one."""
    touching: frozenset[frozenset[str]] = frozenset()
    """Declared contacts: pairs of boxes, tables and grippers (meaning the hand)."""


class CollisionChecker:
    """Checks configurations of the robot in one scene; a planning scene says which move."""

    def __init__(self, scene: Scene) -> None:
        self._model = pin.buildModelFromUrdf(str(urdf_path()))
        base = pin.XYZQUATToSE3(base_pose(scene))
        self._geometry = pin.GeometryModel()
        self._names: list[str] = []
        for body, shape in _robot_bodies():
            placement = base * body.placement if body.parentJoint == 0 else body.placement
            self._add(body.name[: body.name.rindex("_")], body.parentJoint, placement, shape)
        for joint in range(1, self._model.njoints):
            if self._model.parents[joint] == 0:
                self._model.jointPlacements[joint] = base * self._model.jointPlacements[joint]
        for table in scene.tables:
            x, y, top = table.position
            centre = pose((x, y, top - TABLE_THICKNESS / 2), table.yaw)
            sides = (
                2 * table.half_extents[0],
                2 * table.half_extents[1],
                TABLE_THICKNESS,
            )
            self._add(table.name, 0, pin.XYZQUATToSE3(centre), coal.Box(*sides))
        for box in scene.boxes:
            self._add(box.name, 0, pin.XYZQUATToSE3(IDENTITY), coal.Box(*box.size))
        self._index = {name: i for i, name in enumerate(self._names)}
        self._bodies: dict[str, Any] = {
            **self._index,
            **{gripper: [self._index[n] for n in HAND_LINKS[gripper]] for gripper in GRIPPERS},
        }
        self._arm = {
            gripper: [self._index[n] for n in ARM_LINKS[gripper] + HAND_LINKS[gripper]]
            for gripper in GRIPPERS
        }
        tool = {g: self._model.frames[self._model.getFrameId(TOOL_LINK[g])] for g in GRIPPERS}
        self._tool = {g: (frame.parentJoint, frame.placement) for g, frame in tool.items()}
        self._candidates = self._candidate_pairs(len(scene.tables) + len(scene.boxes))
        self._pairs = np.nonzero(np.triu(self._candidates, 1))
        for first, second in zip(*self._pairs, strict=True):
            self._geometry.addCollisionPair(pin.CollisionPair(int(first), int(second)))
        self._data = self._model.createData()
        self._geometry_data = self._geometry.createData()
        for request in self._geometry_data.collisionRequests:
            request.security_margin = PADDING
        self._broad = pin.BroadPhaseManager_NaiveCollisionManager(
            self._model, self._geometry, self._geometry_data
        )
        self._callback = pin.CollisionCallBackDefault(self._geometry, self._geometry_data, True)
        self.queries = 0
        """Calls of :meth:`first_collision` so far."""
        self._template = pin.neutral(self._model)
        self._template[self._coordinate("torso_lift_joint")] = scene.robot.torso
        self._plain = [i for i in range(14) if i not in CONTINUOUS]
        self._plain_at = [self._coordinate(ARM_JOINTS[i]) for i in self._plain]
        self._cosine_at = [self._coordinate(ARM_JOINTS[i]) for i in CONTINUOUS]
        self._sine_at = [index + 1 for index in self._cosine_at]
        self._velocity_at = [
            int(self._model.joints[self._model.getJointId(joint)].idx_v) for joint in ARM_JOINTS
        ]
        self._finger_at = {
            gripper: [self._coordinate(joint) for joint in FINGER_JOINTS[gripper]]
            for gripper in GRIPPERS
        }

    def enter(self, scene: PlanningScene) -> None:
        """Put the boxes where the scene says, and check what can collide while its arm moves."""
        moving = list(self._arm[scene.gripper])
        for box, placement in scene.standing.items():
            self._move(box, 0, pin.XYZQUATToSE3(placement))
        for box, (gripper, grasp) in scene.carried.items():
            joint, tool = self._tool[gripper]
            self._move(box, joint, tool * pin.XYZQUATToSE3(grasp))
            if gripper == scene.gripper:
                moving.append(self._index[box])
        moves = np.zeros(len(self._names), dtype=bool)
        moves[moving] = True
        active = self._candidates & (moves[:, None] | moves[None, :])
        carried = moving[len(self._arm[scene.gripper]) :]
        for body in carried:
            active[body, carried] = False
        for one, other in scene.touching:
            first, second = self._bodies[one], self._bodies[other]
            active[first, second] = active[second, first] = False
        self._geometry_data.setActiveCollisionPairs(self._geometry, active, True)
        self._active = np.flatnonzero(active[self._pairs]).tolist()

    def coordinates(self, q: Array, fingers: Mapping[str, float]) -> Array:
        """Coordinates of the pinocchio model (n, nq) for configurations (n, 14)."""
        full = np.tile(self._template, (len(q), 1))
        full[:, self._plain_at] = q[:, self._plain]
        full[:, self._cosine_at] = np.cos(q[:, CONTINUOUS])
        full[:, self._sine_at] = np.sin(q[:, CONTINUOUS])
        for gripper, value in fingers.items():
            full[:, self._finger_at[gripper]] = value
        return full

    def first_collision(self, q: Array, fingers: Mapping[str, float]) -> tuple[str, str] | None:
        """The first pair of bodies found in collision along configurations (n, 14), if any.

        The configurations are visited from coarse to fine: ends, middle, quarters, …
        """
        self.queries += 1
        coordinates = self.coordinates(q, fingers)
        for row in _coarse_to_fine(len(q)):
            if pin.computeCollisions(
                self._model, self._data, self._broad, self._callback, coordinates[row]
            ):
                pair = self._geometry.collisionPairs[self._callback.collisionPairIndex]
                return self._names[pair.first], self._names[pair.second]
        return None

    def distances(self, q: Array, fingers: Mapping[str, float], count: int) -> tuple[Array, Array]:
        """The smallest distances of pairs of bodies, to first order.

        Args:
            q: (n, 14) rad.
            fingers: value (rad) of the finger joints by gripper.
            count: how many pairs per configuration.

        Returns:
            distances (n, count) in m, negative where bodies penetrate, and their gradients
            (n, count, 14) in m/rad.
        """
        values, gradients = np.empty((len(q), count)), np.empty((len(q), count, 14))
        for row, coordinates in enumerate(self.coordinates(q, fingers)):
            pin.computeJointJacobians(self._model, self._data, coordinates)
            pin.computeDistances(
                self._model,
                self._data,
                self._geometry,
                self._geometry_data,
                coordinates,
            )
            results = self._geometry_data.distanceResults
            found = np.array([results[pair].min_distance for pair in self._active])
            for column, number in enumerate(np.argsort(found, kind="stable")[:count]):
                values[row, column] = found[number]
                gradients[row, column] = self._gradient(self._active[number])
        return values, gradients

    def _gradient(self, pair: int) -> Array:
        """Derivative (14,) of the distance of a pair of bodies, at their nearest points."""
        result = self._geometry_data.distanceResults[pair]
        bodies = self._geometry.collisionPairs[pair]
        rates = []
        for body, point in (
            (bodies.first, result.getNearestPoint1()),
            (bodies.second, result.getNearestPoint2()),
        ):
            joint = self._geometry.geometryObjects[body].parentJoint
            jacobian = pin.getJointJacobian(
                self._model, self._data, joint, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            )[:, self._velocity_at]
            arm = np.cross(point - self._data.oMi[joint].translation, result.normal)
            rates.append(result.normal @ jacobian[:3] + arm @ jacobian[3:])
        return np.asarray(rates[1] - rates[0])

    def _add(self, name: str, joint: int, placement: Any, shape: Any) -> None:
        self._geometry.addGeometryObject(pin.GeometryObject(name, joint, placement, shape))
        self._names.append(name)

    def _move(self, name: str, joint: int, placement: Any) -> None:
        body = self._geometry.geometryObjects[self._index[name]]
        body.parentJoint = joint
        body.placement = placement

    def _coordinate(self, joint: str) -> int:
        return int(self._model.joints[self._model.getJointId(joint)].idx_q)

    def _candidate_pairs(self, objects: int) -> NDArray[np.bool_]:
        """Pairs that can ever be checked: not the SRDF's, nor bodies of one link."""
        joints = np.array([body.parentJoint for body in self._geometry.geometryObjects])
        pairs = joints[:, None] != joints[None, :]
        pairs[-objects:] = pairs[:, -objects:] = True
        for one, other in map(tuple, disabled_pairs()):
            if one in self._index and other in self._index:
                first, second = self._index[one], self._index[other]
                pairs[first, second] = pairs[second, first] = False
        return np.asarray(pairs)


@cache
def _robot_bodies() -> tuple[tuple[Any, Any], ...]:
    """Geometry object and convex shape of every link with a collision geometry."""
    model = pin.buildModelFromUrdf(str(urdf_path()))
    geometry = pin.buildGeomFromUrdf(model, str(urdf_path()), pin.GeometryType.COLLISION)
    bodies = []
    for body in geometry.geometryObjects:
        shape = body.geometry
        if isinstance(shape, coal.BVHModelBase):
            shape.buildConvexHull(True, "Qt")
            shape = shape.convex
        bodies.append((body, shape))
    return tuple(bodies)


@cache
def _coarse_to_fine(count: int) -> tuple[int, ...]:
    """The numbers below ``count``: last, first, then halving the gaps (bit reversal)."""
    bits = max(count - 1, 1).bit_length()
    reversed_ = (int(f"{i:0{bits}b}"[::-1], 2) for i in range(1 << bits))
    return tuple(dict.fromkeys([count - 1, *(i for i in reversed_ if i < count)]))
