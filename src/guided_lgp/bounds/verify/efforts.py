"""Torques that the arms' motors exert at rest and along a motion, by inverse dynamics."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from guided_lgp.bounds.checks import GRAVITY, Violation, volumes
from guided_lgp.bounds.results import Array, Attachment
from guided_lgp.bounds.verify.attachments import carriers, spans
from guided_lgp.logic import Skeleton
from guided_lgp.poses import apply, compose, inverse, rotation_matrix
from guided_lgp.robots import Robot
from guided_lgp.robots.kinematics import JointIndex, fill, joint_index
from guided_lgp.scene import Scene
from guided_lgp.scene.world import BOX_DENSITY, initial_poses


@dataclass(frozen=True)
class Carried:
    """A box that is rigid in a gripper's tool frame for some rows."""

    span: Attachment
    grip: Array
    """Its pose (7,) in the tool frame."""


def carried_boxes(
    scene: Scene, skeleton: Skeleton, switches: Sequence[int], q: Array
) -> list[Carried]:
    """Every box that moves with a gripper, and how: from the scene, the switches and kinematics.

    Args:
        scene: the initial configuration.
        skeleton: the actions.
        switches: row of each action's switch.
        q: (T, m) the arms' joints, and others after them.
    """
    boxes, found = initial_poses(scene), []
    arms = q[:, : len(scene.robot.description.joint_names)]
    held = spans(scene.state, skeleton, switches, len(q), carriers)
    for span in sorted(held, key=lambda span: span.start):
        start, end = scene.robot.tool_poses(arms[[span.start, span.end]])[span.gripper]
        grip = compose(inverse(start), boxes[span.box])
        found.append(Carried(span, grip))
        boxes[span.box] = compose(end, grip)
    return found


def joint_efforts(scene: Scene, q: Array, times: Array, carried: Iterable[Carried]) -> Array:
    """Torques (T - 2, n) in Nm at all rows but the first and the last.

    What springs carry is left out (``Robot.balanced``). Loads are points at the boxes' centres:
    their weight and what accelerates them.

    Args:
        scene: gives the robot, where it stands, and the boxes' masses.
        q: (T, n) the arms' joints (rad).
        times: (T,) s.
        carried: the loads.
    """
    if len(q) < 3:
        return np.zeros((0, q.shape[1]))
    rates, changes = derivatives(q, times)
    efforts = _torques(scene, q[1:-1], rates, changes)
    for load in carried:
        rows = slice(max(load.span.start, 1), min(load.span.end, len(q) - 2) + 1)
        if rows.stop - rows.start > 0:
            efforts[rows.start - 1 : rows.stop - 1] += _load_torques(scene, q, times, load, rows)
    return efforts


@dataclass(frozen=True)
class Load:
    """A box in a hand, or on one that is."""

    gripper: str
    box: str
    centre: Array
    """(3,) in the tool frame (m)."""


def overloads(scene: Scene, q: Array, loads: Iterable[Load]) -> list[Violation]:
    """Joints whose motor is too weak for the arms to rest at the first of configurations (m, n)
    where one is, in units of its limit.

    Springs that carry the arms leave their motors more than enough for what hands hold at rest.
    """
    robot = scene.robot.description
    if robot.balanced:
        return []
    efforts = own_weights(scene, q)
    for load in loads:
        weight = BOX_DENSITY * volumes(scene)[load.box] * GRAVITY
        forces = _in_base(scene, np.tile([0.0, 0.0, weight], (len(q), 1)))
        efforts += _lifting(scene, load.gripper, q, load.centre, forces)
    excess = np.abs(efforts) / robot.effort_limits - 1.0
    worst = excess[int(np.argmax((excess > 0).any(axis=1)))]
    return [
        Violation(f"effort {robot.joint_names[joint]}", float(worst[joint]))
        for joint in np.flatnonzero(worst > 0)
    ]


def own_weights(scene: Scene, q: Array) -> Array:
    """Torques (T, n) in Nm of the arms' own weight at configurations q (T, n)."""
    import pinocchio

    arms = _arms(scene, weightless=False)
    rows = arms.rows(q)
    weights = [pinocchio.computeGeneralizedGravity(arms.model, arms.data, row) for row in rows]
    return np.array(weights)[:, arms.columns]


def derivatives(values: Array, times: Array) -> tuple[Array, Array]:
    """First and second derivatives (T - 2, n) at the inner rows of samples (T, n)."""
    steps = np.diff(times)[:, None]
    rates = np.diff(values, axis=0) / steps
    return (rates[1:] + rates[:-1]) / 2, np.diff(rates, axis=0) / ((steps[1:] + steps[:-1]) / 2)


def _torques(scene: Scene, q: Array, rates: Array, changes: Array) -> Array:
    """Of the arms alone (R, n) at configurations (R, n), with their derivatives."""
    import pinocchio

    arms = _arms(scene, weightless=scene.robot.description.balanced)
    velocities, accelerations = np.zeros((2, len(q), arms.model.nv))
    velocities[:, arms.columns], accelerations[:, arms.columns] = rates, changes
    rows = zip(arms.rows(q), velocities, accelerations, strict=True)
    torques = [pinocchio.rnea(arms.model, arms.data, *row) for row in rows]
    return np.array(torques)[:, arms.columns]


def _load_torques(scene: Scene, q: Array, times: Array, load: Carried, rows: slice) -> Array:
    """Of one box, at some rows: (R, n)."""
    gripper, around = load.span.gripper, slice(rows.start - 1, rows.stop + 1)
    centres = compose(scene.robot.tool_poses(q[around], (gripper,))[gripper], load.grip)[:, :3]
    _, changes = derivatives(centres, times[around])
    mass = BOX_DENSITY * volumes(scene)[load.span.box]
    pull = np.array([0.0, 0.0, GRAVITY])
    forces = _in_base(scene, mass * (changes + pull))
    return _lifting(scene, gripper, q[rows], load.grip[:3], forces)


def _in_base(scene: Scene, vectors: Array) -> Array:
    """Vectors (..., 3) of the world in the frame of the robot's base."""
    return np.asarray(vectors @ rotation_matrix(scene.robot.base_pose[3:]))


def _lifting(scene: Scene, gripper: str, q: Array, centre: Array, forces: Array) -> Array:
    """Torques (R, n) of forces (R, 3) on the centre (3,) of a load in a tool frame."""
    import pinocchio

    robot = scene.robot.description
    arm, arms = robot.arms[gripper], _arms(scene, weightless=robot.balanced)
    frame = arms.model.getFrameId(arm.tool_link)
    point = apply(arm.tool_in_link, centre)
    jacobians, turned = [], []
    for row in arms.rows(q):
        jacobian = pinocchio.computeFrameJacobian(
            arms.model, arms.data, row, frame, pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
        )
        jacobians.append(jacobian)
        turned.append(arms.data.oMf[frame].rotation @ point)
    wrenches = np.hstack([forces, np.cross(turned, forces)])
    torques = np.einsum("rij,ri->rj", np.array(jacobians), wrenches)
    return np.asarray(torques[:, arms.columns])


@dataclass(frozen=True)
class _Arms:
    """Pinocchio's model of a mounted robot whose arms' joints alone can move."""

    model: Any
    data: Any
    joints: tuple[JointIndex, ...]

    @cached_property
    def columns(self) -> list[int]:
        """Where the arms' joints are in a velocity of the model."""
        return [joint.velocity for joint in self.joints]

    def rows(self, q: Array) -> Array:
        """Configurations (T, nq) of the model for (T, n)."""
        full = np.empty((len(q), self.model.nq))
        fill(full, self.joints, q)
        return full


def _arms(scene: Scene, weightless: bool) -> _Arms:
    """The arms of a scene's robot, under gravity or without it."""
    fixed = tuple(sorted(scene.robot.fixed_values.items()))
    turn = tuple(scene.robot.base_pose[3:].tolist())
    return _mounted(scene.robot.description, turn, fixed, weightless)


@lru_cache(maxsize=8)
def _mounted(
    robot: Robot, turn: tuple[float, ...], fixed: tuple[tuple[str, float], ...], weightless: bool
) -> _Arms:
    """The arms of a robot whose root is turned so, as a quaternion."""
    import pinocchio

    kinematics = robot.kinematics
    (home,) = kinematics.rows(robot.home[None], dict(fixed))
    names = list(kinematics.model.names)
    still = [number for number in range(1, len(names)) if names[number] not in kinematics.names]
    model = pinocchio.buildReducedModel(kinematics.model, still, home)
    down = np.array([0.0, 0.0, 0.0 if weightless else -GRAVITY])
    model.gravity = pinocchio.Motion(down @ rotation_matrix(np.array(turn)), np.zeros(3))
    joints = tuple(joint_index(model, name) for name in kinematics.names)
    return _Arms(model, model.createData(), joints)
