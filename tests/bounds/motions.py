"""Hand-made scenes, keyframes and motions for the tests of verification and physics."""

from dataclasses import dataclass, field, replace

import numpy as np
import pinocchio

from grasp_poses import grasp_poses
from guided_lgp.bounds.results import Array, Attachment, Keyframe, Trajectory
from guided_lgp.poses import compose, inverse, pose
from guided_lgp.robots import load_robot
from guided_lgp.robots.kinematics import fill
from guided_lgp.scene import Box, Scene, Table
from guided_lgp.scene.world import World, initial_poses

SIZE = (0.15, 0.07, 0.10)
TAB1 = Table(name="tab1", position=(0.54, 0.33, 0.60), half_extents=(0.17, 0.20))
TAB2 = Table(name="tab2", position=(0.54, -0.33, 0.60), half_extents=(0.17, 0.20))
PR2 = load_robot("pr2")
PALM_FRONT = PR2.arms["pr2L"].palm_front
FINGERS = PR2.moving_joints[len(PR2.joint_names) :]
HAND = PR2.arms["pr2L"].fingers
OPEN, CLOSED = HAND.opened, HAND.value(SIZE[1])


def scene(**boxes: tuple[float, float, float, float, str]) -> Scene:
    """Two tables and boxes given as x, y, z (of the centre), yaw and support."""
    return Scene(
        tables=(TAB1, TAB2),
        boxes=tuple(
            Box(name=name, size=SIZE, position=(x, y, z), yaw=yaw, on=on)
            for name, (x, y, z, yaw, on) in boxes.items()
        ),
    )


def from_above(box: Box, gripper: str) -> Array:
    """Tool pose (7,) that grasps the box from above, the hand turned the natural way."""
    poses = list(grasp_poses(box, PALM_FRONT))[:2]
    heading = 0.3 if gripper == "pr2L" else -0.3
    return min(poses, key=lambda p: abs(np.angle(np.exp(1j * (_closing(p) - np.pi / 2 - heading)))))


def _closing(tool: Array) -> float:
    tip = compose(tool, pose((0.0, 1.0, 0.0)))[:2] - tool[:2]
    return float(np.arctan2(tip[1], tip[0]))


_STARTS = np.array([[0.3, 0.3, 0.5, -1.5, 0.0, -1.0, 0.0], [0.3, 0.3, 1.5, -1.5, 1.0, -1.0, 1.5]])


def reach(scene: Scene, gripper: str, tool: Array, near: Array | None = None) -> Array:
    """Arm joints (7,) that put the tool there, near a posture where one is given."""
    starts = [PR2.arms[gripper].signs * start for start in _STARTS]
    if near is not None:
        starts.insert(0, near)
    for start in starts:
        found = solve_arm(scene, gripper, tool, start)
        if found is not None:
            return found
    raise AssertionError(f"{gripper} does not reach {tool}")


def solve_arm(scene: Scene, gripper: str, target: Array, start: Array) -> Array | None:
    """Joint values (7,) that put the tool frame to a pose (7,), or None.

    Damped Gauss-Newton on the pose error, joints clipped to their limits; at most 60 steps.
    """
    arm, kinematics = PR2.arms[gripper], PR2.kinematics
    model, data, joints = kinematics.model, kinematics.data, kinematics.joints[arm.slice]
    columns = [joint.velocity for joint in joints]
    frame = model.getFrameId(arm.tool_link)
    goal = pinocchio.XYZQUATToSE3(compose(inverse(scene.robot.base_pose), target))
    full = kinematics.rows(PR2.home[None], scene.robot.fixed_values)[0]
    angles = np.array(start, float)
    for _ in range(60):
        fill(full, joints, angles)
        pinocchio.computeJointJacobians(model, data, full)
        placement = pinocchio.updateFramePlacement(model, data, frame)
        error = np.asarray(pinocchio.log6(placement.actInv(goal)).vector)
        if np.linalg.norm(error) < 1e-5:
            return angles
        local = pinocchio.getFrameJacobian(model, data, frame, pinocchio.ReferenceFrame.LOCAL)
        jacobian = local[:, columns]
        damped = jacobian @ jacobian.T + 1e-3 * (0.01 + error @ error) * np.eye(6)
        angles = np.clip(angles + jacobian.T @ np.linalg.solve(damped, error), *arm.limits.T)
    return None


def with_arm(q: Array, gripper: str, arm: Array) -> Array:
    """The configuration (14,) with one arm replaced."""
    result = q.copy()
    result[PR2.arms[gripper].slice] = arm
    return result


def shifted(tool: Array, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> Array:
    """The pose, moved in the world."""
    return np.concatenate([tool[:3] + np.array([x, y, z]), tool[3:]])


@dataclass
class Motion:
    """A motion written down step by step, at rest after each."""

    scene: Scene
    q: Array = field(default_factory=PR2.home.copy)
    fingers: dict[str, float] = field(default_factory=lambda: {"pr2L": OPEN, "pr2R": OPEN})
    rows: list[Array] = field(default_factory=list)
    attachments: list[Attachment] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.rows.append(self._row())

    def _row(self) -> Array:
        return np.r_[self.q, np.full(4, self.fingers["pr2L"]), np.full(4, self.fingers["pr2R"])]

    def _go(self, target: Array, steps: int = 40) -> None:
        s = np.linspace(0, 1, steps + 1)[1:, None]
        s = s**3 * (10 - 15 * s + 6 * s**2)
        self.rows += list(self.rows[-1] + s * (target - self.rows[-1]))

    def move(self, gripper: str, arm: Array) -> "Motion":
        """Straight in joint space."""
        self.q = with_arm(self.q, gripper, arm)
        self._go(self._row())
        return self

    def hand(self, gripper: str, joint: float) -> "Motion":
        """Open or close the fingers."""
        self.fingers = self.fingers | {gripper: joint}
        self._go(self._row(), 20)
        return self

    def attach(self, box: str, gripper: str) -> "Motion":
        """From here on the box is rigid in the gripper."""
        self.attachments.append(Attachment(box, gripper, len(self.rows) - 1, -1))
        return self

    def release(self, box: str) -> "Motion":
        """Until here the box was rigid in its gripper."""
        self.attachments = [
            replace(a, end=len(self.rows) - 1) if a.box == box and a.end < 0 else a
            for a in self.attachments
        ]
        return self

    def trajectory(self, period: float = 0.08) -> Trajectory:
        """Samples at equal times."""
        last = len(self.rows) - 1
        return Trajectory(
            (*PR2.joint_names, *FINGERS),
            period * np.arange(len(self.rows)),
            np.array(self.rows),
            tuple(replace(a, end=last) if a.end < 0 else a for a in self.attachments),
        )


def grasp(motion: Motion, gripper: str, box: str) -> Array:
    """Approach from above, close, lift; returns the grip: the box (7,) in the tool frame."""
    body = next(b for b in motion.scene.boxes if b.name == box)
    tool = from_above(body, gripper)
    at = reach(motion.scene, gripper, tool)
    near = reach(motion.scene, gripper, shifted(tool, z=0.04), at)  # nearly straight from there on
    above = reach(motion.scene, gripper, shifted(tool, z=0.10), near)
    motion.move(gripper, above).move(gripper, near).move(gripper, at)
    motion.hand(gripper, CLOSED).attach(box, gripper).move(gripper, near).move(gripper, above)
    return compose(inverse(tool), pose(body.position, body.yaw))


def place(motion: Motion, gripper: str, box: str, grip: Array, target: Array) -> None:
    """Put a held box to a pose (7,) from above, open, retreat and go home."""
    tool = compose(target, inverse(grip))
    at = reach(motion.scene, gripper, tool)
    above = reach(motion.scene, gripper, shifted(tool, z=0.10), at)
    motion.move(gripper, above).move(gripper, at).release(box).hand(gripper, OPEN)
    motion.move(gripper, above).move(gripper, PR2.arms[gripper].home)


def keyframe(world: World, q: Array, **boxes: Array) -> Keyframe:
    """A keyframe with the boxes where the scene has them, except those given."""
    return Keyframe(q, initial_poses(world.scene) | boxes)
