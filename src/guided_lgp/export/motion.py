"""A plan's motion with velocities and accelerations, in segments that a robot's controllers accept.

A trajectory controller moves along a cubic through the positions and velocities of two points, or
along a quintic through their accelerations, too. Here both stay on the planned path and within the
robot's limits. The motion is cut into *legs* where the whole robot rests. In a leg the joints of
each controller get a cubic spline from one of their rests to the next, and all of them more time
where one of the two curves would exceed a limit. Where arms move at once, the rows of a plan are
equally far apart in time, and one arm may move while another one rests.
"""

from collections.abc import Iterator, Mapping
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

    Where arms move at once, an action ends as it takes effect. What another controller has begun
    then goes on, so each controller's part of an action ends at its own last rest until then.
    """

    action: str
    start: int
    end: int
    parts: Mapping[str, tuple[int, int]]
    """First and last row by controller, which rests at both; without those that have none."""

    @property
    def rows(self) -> range:
        """Its points, of all controllers."""
        return _points(self.start, self.end)

    def points(self, group: str) -> range:
        """The rows of a controller's part."""
        return _points(*self.parts[group])

    def fingers(self) -> dict[str, tuple[int, int]]:
        """The parts of the fingers, by gripper."""
        names = ((group.rpartition("/"), part) for group, part in self.parts.items())
        return {gripper: part for (gripper, _, which), part in names if which == "fingers"}


def _points(start: int, end: int) -> range:
    """The row that a segment starts from belongs to the one before, if there is one."""
    return range(start + bool(start), end + 1)


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
    """(T, joints) per s; zero where a controller rests."""
    accelerations: Array
    """(T, joints) per s²; zero where a controller rests."""
    segments: tuple[Segment, ...]
    commands: tuple[GripperCommand, ...]

    @cached_property
    def nanoseconds(self) -> list[int]:
        """The times as whole nanoseconds."""
        return [round(1e9 * time) for time in self.times.tolist()]

    def groups(self) -> dict[str, tuple[str, ...]]:
        """Joints by controller: of each arm, and of its fingers."""
        return _controllers(self.robot)

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
    columns = {
        group: [trajectory.joint_names.index(joint) for joint in joints]
        for group, joints in _controllers(robot).items()
    }
    limits = _limits(robot, trajectory.joint_names)
    legs = list(_legs(trajectory, switches))
    timed = [_timed(trajectory, slice(a, b + 1), [*columns.values()], limits) for a, b in legs]
    starts = np.cumsum([0.0, *(clock[-1] for clock, _, _ in timed)])
    times = [start + clock[1:] for start, (clock, _, _) in zip(starts[:-1], timed, strict=True)]
    velocities, accelerations = (
        np.concatenate([timed[0][which][:1], *(leg[which][1:] for leg in timed)])
        for which in (1, 2)
    )
    return Motion(
        robot,
        trajectory.joint_names,
        np.concatenate([[0.0], *times]) / speed,
        trajectory.q,
        velocities * speed,
        accelerations * speed**2,
        tuple(_segments(plan, legs, switches, _rests(velocities, columns))),
        tuple(_commands(robot, trajectory, legs)),
    )


def _controllers(robot: Robot) -> dict[str, tuple[str, ...]]:
    parts = {}
    for gripper, arm in robot.arms.items():
        parts[f"{gripper}/arm"] = arm.joints
        if arm.fingers.joints:
            parts[f"{gripper}/fingers"] = arm.fingers.joints
    return parts


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
    trajectory: Trajectory, rows: slice, groups: list[list[int]], limits: tuple[Array, Array]
) -> tuple[Array, Array, Array]:
    """Of a leg: times from 0 (s) at which both interpolations keep the limits, and derivatives."""
    q = trajectory.q[rows]
    clock = trajectory.times[rows] - trajectory.times[rows][0]
    moved = q[-1] - q[0]
    shares = np.linspace(0.0, 1.0, len(clock))
    if np.allclose(q, q[0] + shares[:, None] * moved, atol=1e-5):
        # Evenly along a line, as fingers move: the same rows at the times of a smooth motion.
        clock = clock[-1] * (0.5 - np.sin(np.arcsin(1.0 - 2.0 * shares) / 3.0))
    velocities, accelerations = _derivatives(clock, q, groups)
    factor = _excess(clock, [q, velocities, accelerations], limits)
    return clock * factor, velocities / factor, accelerations / factor**2


def _derivatives(clock: Array, q: Array, groups: list[list[int]]) -> tuple[Array, Array]:
    """Velocities and accelerations of a cubic spline through each motion of a controller."""
    velocities, accelerations = np.zeros_like(q), np.zeros_like(q)
    for columns in groups:
        for start, end in _runs(q[:, columns]):
            part = slice(start, end + 1)
            spline = CubicSpline(clock[part], q[part, columns], bc_type="clamped")
            inner = slice(start + 1, end)
            velocities[inner, columns] = spline(clock[inner], 1)
            accelerations[inner, columns] = spline(clock[inner], 2)
    return velocities, accelerations


def _excess(clock: Array, derivatives: list[Array], limits: tuple[Array, Array]) -> float:
    """The factor on time at which the cubics and the quintics between the rows keep the limits."""
    shares = np.linspace(0.0, 1.0, _SAMPLES)
    places = (clock[:-1, None] + np.diff(clock)[:, None] * shares).ravel()
    factor = 1.0
    for count in (2, 3):
        curve = BPoly.from_derivatives(clock, np.stack(derivatives[:count], axis=1))
        velocity = np.max(np.abs(curve(places, 1)) / limits[0])
        acceleration = np.max(np.abs(curve(places, 2)) / limits[1])
        factor = max(factor, float(velocity), float(np.sqrt(acceleration)))
    return factor


def _rests(velocities: Array, columns: Mapping[str, list[int]]) -> dict[str, list[int]]:
    """The rows at which each controller rests, among them the first and the last."""
    return {
        group: np.flatnonzero(~velocities[:, own].any(axis=1)).tolist()
        for group, own in columns.items()
    }


def _segments(
    plan: Plan,
    legs: list[tuple[int, int]],
    switches: list[int],
    rests: Mapping[str, list[int]],
) -> Iterator[Segment]:
    start, begun = 0, dict.fromkeys(rests, 0)
    for action, end in zip(plan.actions, _ends(plan, legs, switches), strict=True):
        until = {group: max(row for row in rows if row <= end) for group, rows in rests.items()}
        parts = {g: (begun[g], row) for g, row in until.items() if row > begun[g]}
        yield Segment(action, start, end, parts)
        start, begun = end, until


def _ends(plan: Plan, legs: list[tuple[int, int]], switches: list[int]) -> Iterator[int]:
    """An action ends where the arms are home again after its switch.

    Where they go on to the next action without that, it ends when its fingers have moved, or, if
    another arm moves then, with its switch.
    """
    robot, trajectory = plan.scene.robot.description, plan.trajectory
    names = trajectory.joint_names
    arms = [names.index(joint) for joint in robot.joint_names]
    away = np.abs(trajectory.q[:, arms] - trajectory.q[0, arms]).max(axis=1)
    for switch, following in pairwise([*switches, len(trajectory.times)]):
        rests = [row for _, row in legs if switch <= row < following]
        home = [row for row in rests if away[row] < _HOME]
        moved = [row for row in rests if np.array_equal(*trajectory.q[[switch, row]][:, arms])]
        last = following == len(trajectory.times)
        yield rests[-1] if last else [*home, *reversed(moved), switch][0]


def _commands(
    robot: Robot, trajectory: Trajectory, legs: list[tuple[int, int]]
) -> Iterator[GripperCommand]:
    for gripper, arm in robot.arms.items():
        if not arm.fingers.joints:
            continue
        values = trajectory.joints(arm.fingers.joints[:1])[:, 0] / arm.fingers.ratios[0]
        for first, last in legs:
            for start, end in _strokes(values[first : last + 1]):
                opening = arm.fingers.opening(float(values[first + end]))
                yield GripperCommand(gripper, first + start, opening)


def _strokes(values: Array) -> Iterator[tuple[int, int]]:
    """First and last row of every stretch in which fingers move one way."""
    way = np.sign(np.diff(values))
    turns = [0, *(np.flatnonzero(np.diff(way)) + 1).tolist(), len(way)]
    yield from ((start, end) for start, end in pairwise(turns) if way[start])


def _runs(values: Array) -> Iterator[tuple[int, int]]:
    """First and last row of every stretch in which something of (rows, joints) moves."""
    moving = np.diff(values, axis=0).any(axis=1)
    turns = np.flatnonzero(np.diff(np.pad(moving.astype(int), 1)))
    yield from zip(turns[::2].tolist(), turns[1::2].tolist(), strict=True)
