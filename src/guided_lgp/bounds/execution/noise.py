"""Arms that do not put boxes quite where they should."""

from collections.abc import Sequence

import numpy as np

from guided_lgp.bounds.results import Array, Trajectory
from guided_lgp.logic import Skeleton, successor
from guided_lgp.poses import rotation_matrix
from guided_lgp.scene import Scene

_REACH = 1.6
"""How long (s) before and after letting go an arm is off its way, at most; half of it wholly."""


def misplaced(
    scene: Scene,
    skeleton: Skeleton,
    switches: Sequence[int],
    trajectory: Trajectory,
    noise: float,
    seed: int,
) -> Trajectory:
    """The motion with every box let go of beside its place.

    Args:
        scene: the initial configuration.
        skeleton: the actions.
        switches: row of each action's switch.
        trajectory: the motion.
        noise: standard deviation (m) along the world's x and y.
        seed: of the random numbers; each action has a stream of its own.
    """
    q, state = trajectory.q.copy(), scene.state
    last = len(q) - 1
    for index, (action, row) in enumerate(zip(skeleton, switches, strict=True)):
        before, state = state, successor(state, action)
        for box, gripper in sorted(set(before.held) - set(state.held)):
            if state.holder(box) is not None:
                continue  # handed over, not put down
            columns = [trajectory.joint_names.index(j) for j in scene.robot.description.joint_names]
            shift = np.random.default_rng([seed, index]).normal(0.0, noise, 2)
            turns = _turns(scene, gripper, trajectory.q[row, columns], shift)
            near = [switches[index - 1] if index else 0, [*switches, last][index + 1]]
            q[:, columns] += _window(trajectory.times, row, near)[:, None] * turns
    return Trajectory(trajectory.joint_names, trajectory.times, q, trajectory.attachments)


def _window(times: Array, row: int, near: Sequence[int]) -> Array:
    """Shares (T,) of the shift: all of it as the box is let go of, none at other switches."""
    share = np.zeros(len(times))
    for sign, end in zip((-1, 1), near, strict=True):
        reach = min(_REACH, abs(times[end] - times[row]))
        away = sign * (times - times[row])
        ramp = np.clip(2 - 2 * away / reach, 0.0, 1.0) if reach else 1.0 * (away <= 0)
        share = np.where(away >= 0, ramp**2 * (3 - 2 * ramp), share)
    return share


def _turns(scene: Scene, gripper: str, q: Array, shift: Array) -> Array:
    """Joint values (n,) that shift a tool (m) along the world's x and y, to first order."""
    import pinocchio

    robot, kinematics = scene.robot.description, scene.robot.description.kinematics
    arm, model, data = robot.arms[gripper], kinematics.model, kinematics.data
    full = kinematics.rows(q[None], scene.robot.fixed_values)[0]
    frame = model.getFrameId(arm.tool_link)
    aligned = pinocchio.ReferenceFrame.LOCAL_WORLD_ALIGNED
    jacobian = pinocchio.computeFrameJacobian(model, data, full, frame, aligned)
    columns = [joint.velocity for joint in kinematics.joints[arm.slice]]
    wanted = np.zeros(6)
    wanted[:3] = rotation_matrix(scene.robot.base_pose[3:]).T @ [*shift, 0.0]
    turns = np.zeros(len(q))
    turns[arm.slice] = np.linalg.pinv(jacobian[:, columns], rcond=1e-3) @ wanted
    return turns
