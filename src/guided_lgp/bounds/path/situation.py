"""What is where between two motions, and the steps that lead from one to the next."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from guided_lgp.bounds.checks import closing_axis
from guided_lgp.bounds.collision import PlanningScene
from guided_lgp.bounds.path.motions import Motion, Surroundings
from guided_lgp.bounds.results import Array, Keyframe
from guided_lgp.logic import State
from guided_lgp.poses import IDENTITY, compose, inverse
from guided_lgp.robots import PlacedArm
from guided_lgp.scene import Scene
from guided_lgp.scene.world import initial_poses


@dataclass(frozen=True)
class Fingers:
    """A gripper opens or closes its fingers to a value of the finger joints (rad, or m)."""

    gripper: str
    value: float


@dataclass(frozen=True)
class Attach:
    """Boxes become rigid in the tool frame of a gripper."""

    boxes: tuple[str, ...]
    gripper: str


@dataclass(frozen=True)
class Release:
    """Boxes stay where they are in the world."""

    boxes: tuple[str, ...]


Step = Motion | Fingers | Attach | Release


@dataclass(frozen=True)
class Situation:
    """Robot and boxes at rest."""

    state: State
    q: Array
    """Configuration (n,) in rad."""
    fingers: Mapping[str, float]
    """Value (rad) of the finger joints by gripper."""
    standing: Mapping[str, Array]
    """World pose (7,) of every box that no gripper carries."""
    carried: Mapping[str, tuple[str, Array]]
    """Gripper, and pose (7,) in its tool frame, of every box held or standing on a held one."""
    upright: frozenset[str] = frozenset()
    """Boxes that stay level on their way, whatever they carry."""

    def boxes(self, arms: Mapping[str, PlacedArm]) -> dict[str, Array]:
        """World pose (7,) of every box."""
        carriers = sorted({gripper for gripper, _ in self.carried.values()})
        tools = {gripper: tool_pose(arms[gripper], self.q) for gripper in carriers}
        poses = dict(self.standing)
        for box, (gripper, grasp) in self.carried.items():
            poses[box] = compose(tools[gripper], grasp)
        return poses

    def loaded(self, gripper: str) -> bool:
        """Whether a gripper holds a box that has to stay level: with others on it, as a rule."""
        held = self.state.held_by(gripper)
        return held is not None and (held in self.upright or bool(self.state.carried_by(held)))

    def around(self, gripper: str, touching: Iterable[tuple[str, str]] = ()) -> Surroundings:
        """What stands still while the gripper's arm moves."""
        contacts = frozenset(frozenset(pair) for pair in touching) | self._held_contacts()
        scene = PlanningScene(gripper, self.standing, self.carried, contacts)
        return Surroundings(scene, self.q, self.fingers)

    def after(self, step: Step, arms: Mapping[str, PlacedArm]) -> "Situation":
        """The situation after a step (the symbolic state does not change here)."""
        match step:
            case Motion(arm, path):
                q = self.q.copy()
                q[arm.slice] = path[-1]
                return replace(self, q=q)
            case Fingers(gripper, value):
                return replace(self, fingers={**self.fingers, gripper: value})
            case Attach(boxes, gripper):
                poses = self.boxes(arms)
                tool = inverse(tool_pose(arms[gripper], self.q))
                taken = {box: (gripper, compose(tool, poses[box])) for box in boxes}
                standing = {b: p for b, p in self.standing.items() if b not in boxes}
                return replace(self, standing=standing, carried={**self.carried, **taken})
            case Release(boxes):
                poses = self.boxes(arms)
                carried = {b: c for b, c in self.carried.items() if b not in boxes}
                standing = {**self.standing, **{box: poses[box] for box in boxes}}
                return replace(self, standing=standing, carried=carried)

    def keyframe(self, arms: Mapping[str, PlacedArm]) -> Keyframe:
        """The configuration x_k."""
        return Keyframe(self.q, self.boxes(arms))

    def _held_contacts(self) -> frozenset[frozenset[str]]:
        """A hand touches the box that it holds, and a box what stands on it."""
        return frozenset(frozenset((box, gripper)) for box, gripper in self.state.held)


def situation_at_start(scene: Scene, upright: frozenset[str] = frozenset()) -> Situation:
    """Where a plan begins: the arms where the scene has them, the hands closed."""
    robot = scene.robot.description
    standing, carried = initial_poses(scene), {}
    fingers = {gripper: arm.fingers.closed for gripper, arm in robot.arms.items()}
    for box in scene.movable:
        if box.grasp is not None:
            gripper, grasp = scene.held[box.name], np.array(box.grasp)
            width = box.size[closing_axis(grasp.tolist(), IDENTITY.tolist())]
            fingers[gripper] = robot.arms[gripper].fingers.value(width)
            carried[box.name] = gripper, grasp
            below = inverse(standing.pop(box.name))
            for rider in scene.state.carried_by(box.name):
                on_it = compose(below, standing.pop(rider))
                carried[rider] = gripper, compose(grasp, on_it)
    return Situation(scene.state, scene.robot.start, fingers, standing, carried, upright)


def tool_pose(arm: PlacedArm, q: Array) -> Array:
    """Pose (7,) of the tool frame for a configuration (n,)."""
    return matrix_pose(*arm.forward(q[arm.arm.slice]))


def matrix_pose(rotation: Array, position: Array) -> Array:
    """The pose (7,) of a rotation matrix (3, 3) and an origin (3,)."""
    return np.concatenate([position, pin.Quaternion(rotation).coeffs()])
