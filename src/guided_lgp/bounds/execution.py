"""Execution of a plan under gravity in PyBullet.

Joints are driven by position control along the trajectory. A grasp becomes a fixed constraint
between palm and box only if the simulated gripper really is at the simulated box at that moment;
the constraint keeps the relative pose they happen to have. Boxes that ride on a held box ride by
friction. Nothing is ever set to a pose after the start.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from guided_lgp.bounds.checks import Violation, box_bodies, given_grasps
from guided_lgp.bounds.goals import GoalTerms
from guided_lgp.bounds.results import Array, Trajectory
from guided_lgp.bounds.verify.attachments import switches_of
from guided_lgp.bounds.verify.geometry import grasp_faults
from guided_lgp.logic import Goal, GroundAtom, Objective, Skeleton, State, successor
from guided_lgp.poses import compose, inverse
from guided_lgp.scene import Scene
from guided_lgp.scene.bullet import pybullet
from guided_lgp.scene.world import World, initial_poses

RATE = 120
"""Simulation steps per second."""
SETTLE_S = 1.0
"""How long (s) the world rests before the first motion and after the last."""
GRASP_SLACK = 0.006
"""How far (m, rad) beyond the limits of verification a simulated grasp may be off."""
UPRIGHT = 0.9
"""Least vertical part of the contact normals where a box stands on something."""
PLACE_SLACK = 0.005
"""How far (m, rad) a box may be off the place that a goal asks for: as it settles."""
HELD_SLACK = 0.02
"""How far (m) a held box may have slipped in the hand at the end."""
_ARM_FORCE, _FINGER_FORCE, _FIXED_FORCE = 1000.0, 100.0, 1e5
"""Largest force (N or Nm) of the joints of arms and hands, and of those that the scene fixes."""


@dataclass(frozen=True)
class PhysicsReport:
    """Outcome of an execution."""

    success: bool
    """All goals hold in the settled world."""
    goals: Mapping[str, bool] = field(default_factory=dict)
    """For each goal of the objective, written as ``(on red tab1)``, whether it holds."""
    drift: float = 0.0
    """Largest distance (m) of a box from where the plan leaves it."""
    fault: str = ""
    """What went wrong, if something did: ``grasp red`` where the gripper missed the box."""


def execute(
    scene: Scene, objective: Objective, skeleton: Skeleton, trajectory: Trajectory
) -> PhysicsReport:
    """Carry out a plan under gravity and read the goals from the settled world.

    Args:
        scene: the initial configuration.
        objective: the goals to look at.
        skeleton: the actions that the trajectory carries out.
        trajectory: the motion.
    """
    rows = switches_of(scene, skeleton, trajectory)
    if isinstance(rows, Violation):
        return PhysicsReport(False, fault=rows.constraint)
    planned = final_boxes(scene, trajectory)
    with World(scene) as world:
        run = _Execution(world, trajectory)
        for box, gripper in sorted(scene.held.items()):
            run.touch(gripper, box)
            if fault := run.grasp(gripper, box):
                return PhysicsReport(False, fault=fault)
        run.rest()
        state, left = scene.state, set[tuple[str, str]]()
        for action, row in zip(skeleton, rows, strict=True):
            before, state = state, successor(state, action)
            taken = sorted(set(state.held) - set(before.held))
            for box, gripper in taken:
                run.touch(gripper, box)
            run.follow(float(trajectory.times[row]))
            for box, gripper in sorted(left.difference(taken)):
                run.touch(gripper, box, allowed=False)
            for box, gripper in taken:
                if fault := run.grasp(gripper, box):
                    return PhysicsReport(False, fault=fault)
            left = set(before.held) - set(state.held)
            for box, gripper in sorted(left):
                run.release(gripper, box)
        run.follow(float(trajectory.times[-1]))
        run.rest()
        goals = {
            str(goal): all(run.holds(atom, state) for atom in state.domain.conditions(goal))
            and run.in_place(goal)
            for goal in objective
        }
        drift = run.drift(planned)
    return PhysicsReport(all(goals.values()), goals, drift)


def final_boxes(scene: Scene, trajectory: Trajectory) -> dict[str, Array]:
    """Where a plan leaves every box: poses (7,), from the scene, the attachments and kinematics."""
    boxes = initial_poses(scene)
    names = scene.robot.description.joint_names
    arms = trajectory.q[:, [trajectory.joint_names.index(name) for name in names]]
    for attachment in sorted(trajectory.attachments, key=lambda attachment: attachment.start):
        ends = arms[[attachment.start, attachment.end]]
        start, end = scene.robot.tool_poses(ends)[attachment.gripper]
        boxes[attachment.box] = compose(end, compose(inverse(start), boxes[attachment.box]))
    return boxes


class _Execution:
    """A world in which time passes."""

    def __init__(self, world: World, trajectory: Trajectory) -> None:
        self._world = world
        self._client = world.client
        self._robot = world.scene.robot.description
        self._grips: dict[tuple[str, str], tuple[int, Array]] = {}
        self._joints = [world.joints[name] for name in trajectory.joint_names]
        self._forces = [
            _ARM_FORCE if name in self._robot.joint_names else _FINGER_FORCE
            for name in trajectory.joint_names
        ]
        steps = int(np.ceil(trajectory.times[-1] * RATE)) + 1
        moments = np.arange(steps) / RATE
        self._targets = np.stack(
            [np.interp(moments, trajectory.times, joint) for joint in trajectory.q.T], axis=1
        )
        self._step = 0
        pybullet.setGravity(0, 0, -9.81, physicsClientId=self._client)
        pybullet.setTimeStep(1 / RATE, physicsClientId=self._client)
        fixed = world.scene.robot.fixed_values
        for name, joint in world.joints.items():
            kind = pybullet.getJointInfo(world.robot, joint, physicsClientId=self._client)[2]
            if kind != pybullet.JOINT_FIXED:
                pybullet.setJointMotorControl2(
                    world.robot,
                    joint,
                    pybullet.POSITION_CONTROL,
                    targetPosition=fixed.get(name, 0.0),
                    force=_FIXED_FORCE if name in fixed else _FINGER_FORCE,
                    physicsClientId=self._client,
                )

    def follow(self, time: float) -> None:
        """Drive the joints along the trajectory until a moment (s)."""
        while self._step < min(round(time * RATE), len(self._targets) - 1):
            self._step += 1
            velocity = (self._targets[self._step] - self._targets[self._step - 1]) * RATE
            self._drive(velocity)

    def rest(self) -> None:
        """Hold still until the world has settled."""
        for _ in range(int(SETTLE_S * RATE)):
            self._drive(np.zeros(len(self._joints)))

    def touch(self, gripper: str, box: str, allowed: bool = True) -> None:
        """Let the hand's hulls pass through a box it is about to hold, or no longer.

        The hulls bridge the hollow of the fingers: they would push the box away.
        """
        for link in self._robot.arms[gripper].hand_links:
            pybullet.setCollisionFilterPair(
                self._world.robot,
                self._world.boxes[box],
                self._world.links[link],
                -1,
                0 if allowed else 1,
                physicsClientId=self._client,
            )

    def grasp(self, gripper: str, box: str) -> str:
        """Fix the box to the palm as they are; returns a fault if the gripper is not there."""
        tool, placement = self._tool(gripper), self._box(box)
        scene, arm = self._world.scene, self._robot.arms[gripper]
        body, given = box_bodies(scene)[box], given_grasps(scene).get(box)
        faults = grasp_faults(arm, box, body, placement.tolist(), tool.tolist(), given)
        if faults and faults[0].amount > GRASP_SLACK:
            return faults[0].constraint
        palm = self._world.links[arm.hand_links[0]]
        state = pybullet.getLinkState(
            self._world.robot,
            palm,
            computeForwardKinematics=True,
            physicsClientId=self._client,
        )
        relative = compose(inverse(np.array([*state[0], *state[1]])), placement)
        constraint = pybullet.createConstraint(
            self._world.robot,
            palm,
            self._world.boxes[box],
            -1,
            pybullet.JOINT_FIXED,
            (0, 0, 0),
            relative[:3],
            (0, 0, 0),
            relative[3:],
            physicsClientId=self._client,
        )
        self._grips[gripper, box] = constraint, compose(inverse(tool), placement)
        return ""

    def release(self, gripper: str, box: str) -> None:
        """Remove the constraint by which the gripper holds the box."""
        constraint, _ = self._grips.pop((gripper, box))
        pybullet.removeConstraint(constraint, physicsClientId=self._client)

    def holds(self, atom: GroundAtom, state: State) -> bool:
        """Whether a condition of a goal holds; what no contact shows, the state tells."""
        match atom.predicate, atom.symbols:
            case "held", (box,):
                seen = any(self._in_hand(gripper, box) for gripper, _ in self._grips)
            case "holds", (gripper, box):
                seen = self._in_hand(gripper, box)
            case "on", (box, support):
                seen = self._rests(box, support)
            case _:
                return atom.holds_in(state)
        return seen != atom.negated

    def in_place(self, goal: Goal) -> bool:
        """Whether a box is where a goal wants it, but for what settling may shift."""
        terms = GoalTerms.of((goal,), self._world.scene.symbols.domain)
        boxes = {box: self._box(box) for box in self._world.boxes}
        faults = terms.faults(self._world.scene, boxes)
        return all(fault.amount <= PLACE_SLACK for fault in faults)

    def _in_hand(self, gripper: str, box: str) -> bool:
        """Whether a gripper holds a box that has not slipped."""
        if (gripper, box) not in self._grips:
            return False
        _, grip = self._grips[gripper, box]
        slip = compose(self._tool(gripper), grip)[:3] - self._box(box)[:3]
        return bool(np.linalg.norm(slip) < HELD_SLACK)

    def _rests(self, box: str, support: str) -> bool:
        """Whether a box that nothing holds is at rest upon a support."""
        if any(held == box for _, held in self._grips):
            return False
        upper, lower = self._world.boxes[box], self._body(support)
        contacts = pybullet.getContactPoints(upper, lower, physicsClientId=self._client)
        # The normal points from the support to the box.
        return bool(contacts) and all(contact[7][2] > UPRIGHT for contact in contacts)

    def drift(self, planned: Mapping[str, Array]) -> float:
        """Largest distance (m) of a box from its planned place."""
        return max(
            float(np.linalg.norm(self._box(box)[:3] - placement[:3]))
            for box, placement in planned.items()
        )

    def _drive(self, velocity: Array) -> None:
        pybullet.setJointMotorControlArray(
            self._world.robot,
            self._joints,
            pybullet.POSITION_CONTROL,
            targetPositions=self._targets[self._step].tolist(),
            targetVelocities=velocity.tolist(),
            forces=self._forces,
            positionGains=[0.3] * len(self._joints),
            velocityGains=[1.0] * len(self._joints),
            physicsClientId=self._client,
        )
        pybullet.stepSimulation(physicsClientId=self._client)

    def _tool(self, gripper: str) -> Array:
        return np.asarray(self._world.tool_poses([gripper])[0])

    def _box(self, box: str) -> Array:
        position, turn = pybullet.getBasePositionAndOrientation(
            self._world.boxes[box], physicsClientId=self._client
        )
        return np.array([*position, *turn])

    def _body(self, table: str) -> int:
        return (self._world.supports | self._world.boxes)[table]
