"""A plan's motion with velocities and accelerations, in segments that a robot's controllers accept.

A trajectory controller moves along a cubic through the positions and velocities of two points, or
along a quintic through their accelerations, too. Here both stay on the planned path and within the
robot's limits: the motion is cut where it rests; each such *leg* gets a cubic spline from rest to
rest, and more time where one of the two curves would exceed a limit. Where arms move at once, the
rows of a plan are equally far apart in time, and one arm may move while another one rests.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from scipy.interpolate import BPoly, CubicSpline

from guided_lgp.bounds.plan_file import Plan
from guided_lgp.bounds.results import Array, Trajectory
from guided_lgp.bounds.verify.attachments import switches_of
from guided_lgp.errors import InputError
from guided_lgp.robots.robot import Robot

_SAME_STEP = 3e-6
"""s. Steps of one leg are equal, and written with six decimals."""
_HOME = 1e-5
"""rad. Within it, the arms are where they began."""
_SAMPLES = 33
"""Places per interval at which the limits are looked at."""


@dataclass(frozen=True)
class Segment:
    """The rows of one action, from where the one before ended.

    The robot rests at both; where arms move at once, an action ends as it takes effect.
    """

    action: str
    start: int
    end: int

    @property
    def rows(self) -> range:
        """Its points: the row it starts from belongs to the segment before, if there is one."""
        return range(self.start + bool(self.start), self.end + 1)


@dataclass(frozen=True)
class GripperCommand:
    """What a gripper is told when its fingers begin to move."""

    gripper: str
    row: int
    opening: float
    """m between the fingertips."""


@dataclass(frozen=True)
class Motion:
    """A plan's motion, row by row as in the plan."""

    robot: Robot
    joint_names: tuple[str, ...]
    times: Array
    """(T,) s, strictly increasing."""
    positions: Array
    """(T, joints) rad, m where a joint slides."""
    velocities: Array
    """(T, joints) per s; zero at both ends of a leg."""
    accelerations: Array
    """(T, joints) per s²; zero at both ends of a leg."""
    segments: tuple[Segment, ...]
    commands: tuple[GripperCommand, ...]

    @cached_property
    def nanoseconds(self) -> list[int]:
        """The times as whole nanoseconds."""
        return [round(1e9 * time) for time in self.times.tolist()]

    def groups(self) -> dict[str, tuple[str, ...]]:
        """Joints by controller: of each arm, and of its fingers."""
        parts = {}
        for gripper, arm in self.robot.arms.items():
            parts[f"{gripper}/arm"] = arm.joints
            if arm.fingers.joints:
                parts[f"{gripper}/fingers"] = arm.fingers.joints
        return parts

    def columns(self, joints: tuple[str, ...]) -> list[int]:
        """Where joints stand in a row."""
        return [self.joint_names.index(joint) for joint in joints]


def motion_of(plan: Plan, speed: float = 1.0) -> Motion:
    """Make a plan's motion ready for a robot.

    Args:
        plan: as read from its file.
        speed: share of the robot's speed, in (0, 1]; accelerations fall with its square.

    Raises:
        InputError: the speed is out of range, the plan has no actions, or its attachments are
            not those of its actions.
    """
    if not 0.0 < speed <= 1.0:
        raise InputError("speed", f"{speed} is out of range", "a share in (0, 1]")
    if not plan.actions:
        raise InputError("plan", "has no actions: its goals hold at the start")
    robot, trajectory = plan.scene.robot.description, plan.trajectory
    switches = switches_of(plan.scene, plan.skeleton, trajectory)
    if not isinstance(switches, list):
        raise InputError("plan", f"does not fit its actions: {switches.constraint}")
    limits = _limits(robot, trajectory.joint_names)
    legs = list(_legs(trajectory, switches))
    times, velocities = np.zeros(len(trajectory.times)), np.zeros_like(trajectory.q)
    accelerations = np.zeros_like(trajectory.q)
    for start, end in legs:
        rows, inner = slice(start, end + 1), slice(start + 1, end)
        clock, spline = _timed(trajectory, rows, limits)
        clock = clock / speed
        times[rows] = times[start] + clock
        velocities[inner] = spline(clock[1:-1] * speed, 1) * speed
        accelerations[inner] = spline(clock[1:-1] * speed, 2) * speed**2
    return Motion(
        robot,
        trajectory.joint_names,
        times,
        trajectory.q,
        velocities,
        accelerations,
        tuple(_segments(plan, trajectory, legs, switches)),
        tuple(_commands(robot, trajectory, legs)),
    )


def _limits(robot: Robot, joint_names: tuple[str, ...]) -> tuple[Array, Array]:
    """Largest velocity and acceleration of each joint; fingers have none for the second."""
    velocity = dict(zip(robot.joint_names, robot.velocity_limits.tolist(), strict=True))
    acceleration = dict(zip(robot.joint_names, robot.acceleration_limits.tolist(), strict=True))
    for arm in robot.arms.values():
        velocity |= dict.fromkeys(arm.fingers.joints, arm.fingers.velocity)
    return (
        np.array([velocity[name] for name in joint_names]),
        np.array([acceleration.get(name, np.inf) for name in joint_names]),
    )


def _legs(trajectory: Trajectory, switches: list[int]) -> Iterator[tuple[int, int]]:
    """First and last row of every leg: a new one has other joints, another step, or a switch.

    Where all steps are equal, arms may move on while another one's action takes effect.
    """
    steps = np.diff(trajectory.times)
    together = np.ptp(steps) <= _SAME_STEP
    moving = np.diff(trajectory.q, axis=0) != 0.0
    other_joints = ~(moving[1:] & moving[:-1]).any(axis=1)
    other_step = np.abs(np.diff(steps)) > _SAME_STEP
    rests = {int(row) + 1 for row in np.flatnonzero(other_joints | other_step)}
    switched = [] if together else switches
    yield from pairwise(sorted({0, *rests, *switched, len(trajectory.times) - 1}))


def _timed(
    trajectory: Trajectory, rows: slice, limits: tuple[Array, Array]
) -> tuple[Array, CubicSpline]:
    """Times of a leg from 0 (s) at which both interpolations keep the limits, and its spline."""
    q = trajectory.q[rows]
    clock = trajectory.times[rows] - trajectory.times[rows][0]
    moved = q[-1] - q[0]
    shares = np.linspace(0.0, 1.0, len(clock))
    if np.allclose(q, q[0] + shares[:, None] * moved, atol=1e-5):
        # Evenly along a line, as fingers move: the same rows at the times of a smooth motion.
        clock = clock[-1] * (0.5 - np.sin(np.arcsin(1.0 - 2.0 * shares) / 3.0))
    clock = clock * _excess(clock, q, CubicSpline(clock, q, bc_type="clamped"), limits)
    return clock, CubicSpline(clock, q, bc_type="clamped")


def _excess(clock: Array, q: Array, spline: CubicSpline, limits: tuple[Array, Array]) -> float:
    """The factor on time at which the cubics and the quintics between the rows keep the limits."""
    still = np.ones((len(clock), 1))
    still[[0, -1]] = 0.0
    derivatives = [q, spline(clock, 1) * still, spline(clock, 2) * still]
    shares = np.linspace(0.0, 1.0, _SAMPLES)
    places = (clock[:-1, None] + np.diff(clock)[:, None] * shares).ravel()
    factor = 1.0
    for count in (2, 3):
        curve = BPoly.from_derivatives(clock, np.stack(derivatives[:count], axis=1))
        velocity = np.max(np.abs(curve(places, 1)) / limits[0])
        acceleration = np.max(np.abs(curve(places, 2)) / limits[1])
        factor = max(factor, float(velocity), float(np.sqrt(acceleration)))
    return factor


def _segments(
    plan: Plan, trajectory: Trajectory, legs: list[tuple[int, int]], switches: list[int]
) -> Iterator[Segment]:
    """An action ends where the arms are home again after its switch.

    Where they go on to the next action without that, it ends when its fingers have moved, or, if
    another arm moves then, with its switch.
    """
    robot, names = plan.scene.robot.description, trajectory.joint_names
    arms = [names.index(joint) for joint in robot.joint_names]
    away = np.abs(trajectory.q[:, arms] - trajectory.q[0, arms]).max(axis=1)
    start = 0
    for action, switch, following in zip(
        plan.actions, switches, [*switches[1:], len(trajectory.times)], strict=True
    ):
        rests = [row for _, row in legs if switch <= row < following]
        home = [row for row in rests if away[row] < _HOME]
        moved = [row for row in rests if np.array_equal(*trajectory.q[[switch, row]][:, arms])]
        last = following == len(trajectory.times)
        end = rests[-1] if last else [*home, *reversed(moved), switch][0]
        yield Segment(action, start, end)
        start = end


def _commands(
    robot: Robot, trajectory: Trajectory, legs: list[tuple[int, int]]
) -> Iterator[GripperCommand]:
    for gripper, arm in robot.arms.items():
        if not arm.fingers.joints:
            continue
        values = trajectory.joints(arm.fingers.joints[:1])[:, 0] / arm.fingers.ratios[0]
        for leg in legs:
            for start, end in _runs(values, *leg):
                yield GripperCommand(gripper, start, arm.fingers.opening(float(values[end])))


def _runs(values: Array, first: int, last: int) -> Iterator[tuple[int, int]]:
    """First and last row of every stretch of a leg in which fingers move."""
    moving = np.diff(values[first : last + 1]) != 0.0
    turns = np.flatnonzero(np.diff(np.pad(moving.astype(int), 1))) + first
    yield from zip(turns[::2].tolist(), turns[1::2].tolist(), strict=True)
