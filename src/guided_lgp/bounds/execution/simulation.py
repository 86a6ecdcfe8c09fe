"""A world in which time passes, and a robot with motors in it."""

from collections.abc import Sequence

import numpy as np

from guided_lgp.bounds.checks import GRAVITY
from guided_lgp.bounds.execution.clock import Stop, moments
from guided_lgp.bounds.execution.conditions import Conditions
from guided_lgp.bounds.results import Array, Trajectory
from guided_lgp.bounds.verify.efforts import own_weights
from guided_lgp.robots.hand_parts import parts_of
from guided_lgp.scene.bullet import pybullet
from guided_lgp.scene.world import World

RATES = {"fixed": 480, "friction": 960}
"""Simulation steps per second, by the grip. At 120, a tower of eight boxes creeps 14 mm in 5 s, at
480 it does 0.2 mm; what fingertips press on creeps out of the hand at 480, by 3 mm per s of motion.
"""
ITERATIONS = 150
"""Of the contact solver, in each step."""
SETTLE_S = 1.0
"""How long (s) the world rests before the first motion and after the last."""
_FINGER_FORCE, _FIXED_FORCE = 100.0, 1e5
"""Largest force (N or Nm) of the joints of hands, and of those that the scene fixes."""
_STRONGEST = 1000.0
"""Nm of joints whose effort nobody limits."""
_CENTRED = 2e-4
"""How far (m) beyond their middle fingers that press want to be: one motor moves them all, so that
whatever they hold stays in the middle."""
_TIP_TORQUE = 5.0
"""Nm by which fingertips that hang on fingers stay parallel; softer ones tilt and let go."""


class Simulation:
    """Time, motors and contacts of a world."""

    def __init__(self, world: World, conditions: Conditions) -> None:
        self.world = world
        self._client = world.client
        self._robot = world.scene.robot.description
        self._rate = RATES[conditions.grip]
        self._squeezing: dict[str, float] = {}
        pybullet.setGravity(0, 0, -GRAVITY, physicsClientId=self._client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=1 / self._rate,
            numSolverIterations=ITERATIONS,
            physicsClientId=self._client,
        )
        self._rub(float(np.sqrt(conditions.friction)))
        self._hold_other_joints()

    def load(self, trajectory: Trajectory, stops: Sequence[Stop] = ()) -> None:
        """Get ready to follow a motion from its start, with some stops on the way."""
        self._moments = moments(float(trajectory.times[-1]), stops, self._rate)
        values = trajectory.joints(self._robot.moving_joints)
        self._targets = np.stack(
            [np.interp(self._moments, trajectory.times, joint) for joint in values.T], axis=1
        )
        self._motors = self._efforts()
        self._step = 0
        self._share_motors()

    def follow(self, time: float) -> None:
        """Drive the joints along the motion until a moment (s) of it."""
        last = int(np.searchsorted(self._moments, time - 1e-9))
        while self._step < min(last, len(self._targets) - 1):
            self._step += 1
            self._drive((self._targets[self._step] - self._targets[self._step - 1]) * self._rate)

    def rest(self, seconds: float) -> None:
        """Hold still for some time."""
        for _ in range(int(seconds * self._rate)):
            self._drive(np.zeros(self._targets.shape[1]))

    def touch(self, links: Sequence[str], box: str, allowed: bool) -> None:
        """Let links touch a box, or pass through it."""
        for link in links:
            pybullet.setCollisionFilterPair(
                self.world.robot,
                self.world.boxes[box],
                self.world.links[link],
                -1,
                int(allowed),
                physicsClientId=self._client,
            )

    def fix(self, gripper: str, box: str, grip: Array) -> int:
        """Fix a box to the palm at a pose (7,) in it; returns the constraint's number."""
        number: int = pybullet.createConstraint(
            self.world.robot,
            self.world.links[self._robot.arms[gripper].hand_links[0]],
            self.world.boxes[box],
            -1,
            pybullet.JOINT_FIXED,
            (0, 0, 0),
            grip[:3],
            (0, 0, 0),
            grip[3:],
            physicsClientId=self._client,
        )
        return number

    def free(self, constraint: int) -> None:
        """Remove a constraint."""
        pybullet.removeConstraint(constraint, physicsClientId=self._client)

    def squeeze(self, gripper: str, force: float) -> None:
        """Let the fingers press with a force (N) from now on, whatever the motion says."""
        self._squeezing[gripper] = force
        self._share_motors()

    def relax(self, gripper: str, box: str) -> None:
        """Let the fingers follow the motion again, and go from the box that they pressed on.

        Of a pad at an edge, Bullet may keep a contact point whose normal points into the finger:
        with enough friction it would pull the box along as the finger leaves. So contacts are found
        anew.
        """
        del self._squeezing[gripper]
        self._share_motors()
        for allowed in (False, True):
            self.touch(parts_of(self._robot, gripper).pads, box, allowed)

    def put(self, box: str, placement: Array) -> None:
        """Move a box to a pose (7,), at rest."""
        number = self.world.boxes[box]
        pybullet.resetBasePositionAndOrientation(
            number, placement[:3], placement[3:], physicsClientId=self._client
        )
        pybullet.resetBaseVelocity(number, (0, 0, 0), (0, 0, 0), physicsClientId=self._client)

    def palm(self, gripper: str) -> Array:
        """Pose (7,) of the palm's centre of mass, to which constraints refer."""
        state = pybullet.getLinkState(
            self.world.robot,
            self.world.links[self._robot.arms[gripper].hand_links[0]],
            computeForwardKinematics=True,
            physicsClientId=self._client,
        )
        return np.array([*state[0], *state[1]])

    def tool(self, gripper: str) -> Array:
        """Pose (7,) of a tool frame."""
        return np.asarray(self.world.tool_poses([gripper])[0])

    def box(self, box: str) -> Array:
        """Pose (7,) of a box."""
        position, turn = pybullet.getBasePositionAndOrientation(
            self.world.boxes[box], physicsClientId=self._client
        )
        return np.array([*position, *turn])

    def joints(self) -> Array:
        """Values (n,) of the arms' joints."""
        numbers = [self.world.joints[name] for name in self._robot.joint_names]
        states = pybullet.getJointStates(self.world.robot, numbers, physicsClientId=self._client)
        return np.array([state[0] for state in states])

    def normals(self, upper: str, lower: str) -> list[float]:
        """Vertical parts of the contact normals from one body to a box."""
        body = (self.world.supports | self.world.boxes)[lower]
        contacts = pybullet.getContactPoints(
            self.world.boxes[upper], body, physicsClientId=self._client
        )
        return [contact[7][2] for contact in contacts]

    def _rub(self, friction: float) -> None:
        """Give all bodies the friction whose square counts between two of them."""
        bodies = [(body, -1) for body in (self.world.supports | self.world.boxes).values()]
        hands = [link for arm in self._robot.arms.values() for link in arm.hand_links]
        for body, link in (*bodies, *((self.world.robot, self.world.links[h]) for h in hands)):
            pybullet.changeDynamics(
                body, link, lateralFriction=friction, physicsClientId=self._client
            )

    def _hold_other_joints(self) -> None:
        """Keep what the motion does not move where the scene has it."""
        fixed = self.world.scene.robot.fixed_values
        for name, joint in self.world.joints.items():
            kind = pybullet.getJointInfo(self.world.robot, joint, physicsClientId=self._client)[2]
            if kind != pybullet.JOINT_FIXED:
                pybullet.setJointMotorControl2(
                    self.world.robot,
                    joint,
                    pybullet.POSITION_CONTROL,
                    targetPosition=fixed.get(name, 0.0),
                    force=_FIXED_FORCE if name in fixed else _FINGER_FORCE,
                    physicsClientId=self._client,
                )

    def _efforts(self) -> Array:
        """Largest force of each moving joint: of motors, and what springs carry besides."""
        arms = len(self._robot.joint_names)
        efforts = np.minimum(self._robot.effort_limits, _STRONGEST)
        if self._robot.balanced:
            sparse = self._targets[:: self._rate // 10, :arms]
            efforts = efforts + np.abs(own_weights(self.world.scene, sparse)).max(axis=0)
        return np.concatenate([efforts, np.full(self._targets.shape[1] - arms, _FINGER_FORCE)])

    def _share_motors(self) -> None:
        """Find the joints that follow the motion; those that press do not."""
        hands = [parts_of(self._robot, gripper) for gripper in sorted(self._squeezing)]
        pressing = {joint for hand in hands for joint in hand.pressing}
        hanging = {joint for hand in hands for joint in hand.hanging}
        names = self._robot.moving_joints
        self._driven = [i for i, name in enumerate(names) if name not in pressing]
        self._numbers = [self.world.joints[names[i]] for i in self._driven]
        self._forces = [
            _TIP_TORQUE if names[i] in hanging else float(self._motors[i]) for i in self._driven
        ]

    def _press(self, gripper: str, force: float) -> None:
        """Close all fingers of a hand on what stops them."""
        fingers, parts = self._robot.arms[gripper].fingers, parts_of(self._robot, gripper)
        ratios = dict(zip(fingers.joints, fingers.ratios.tolist(), strict=True))
        numbers = [self.world.joints[joint] for joint in parts.pressing]
        states = pybullet.getJointStates(self.world.robot, numbers, physicsClientId=self._client)
        values = [s[0] / ratios[joint] for s, joint in zip(states, parts.pressing, strict=True)]
        inwards = np.sign(fingers.closed - fingers.opened) * _CENTRED / fingers.lever
        wanted = float(np.mean(values) + inwards)
        pybullet.setJointMotorControlArray(
            self.world.robot,
            numbers,
            pybullet.POSITION_CONTROL,
            targetPositions=[ratios[joint] * wanted for joint in parts.pressing],
            forces=[force * fingers.lever] * len(numbers),
            positionGains=[0.3] * len(numbers),
            physicsClientId=self._client,
        )

    def _drive(self, velocity: Array) -> None:
        for gripper, force in self._squeezing.items():
            self._press(gripper, force)
        pybullet.setJointMotorControlArray(
            self.world.robot,
            self._numbers,
            pybullet.POSITION_CONTROL,
            targetPositions=self._targets[self._step, self._driven].tolist(),
            targetVelocities=velocity[self._driven].tolist(),
            forces=self._forces,
            positionGains=[0.3] * len(self._driven),
            velocityGains=[1.0] * len(self._driven),
            physicsClientId=self._client,
        )
        pybullet.stepSimulation(physicsClientId=self._client)
