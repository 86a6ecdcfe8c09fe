"""Verification of paths."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import chain, pairwise

import numpy as np

from guided_lgp.bounds.checks import Violation, body_names, box_bodies, given_grasps, overlap_name
from guided_lgp.bounds.goals import NO_TERMS, GoalTerms
from guided_lgp.bounds.results import Array, Trajectory
from guided_lgp.bounds.verify.attachments import switches_of
from guided_lgp.bounds.verify.geometry import declared, grasp_faults, placement_faults
from guided_lgp.bounds.verify.joints import finger_faults, limit_faults
from guided_lgp.bounds.verify.phase import Phase
from guided_lgp.bounds.verify.touching import Touch, touches
from guided_lgp.logic import Skeleton, State, successor
from guided_lgp.scene.tolerances import MARGIN
from guided_lgp.scene.world import World, initial_poses

JUDGED = 10
"""PyBullet judges at least every so-many-th configuration: steps of at most 10 cm."""
START = 1e-3
"""How far (rad) the first configuration may be off the scene's, and the last off a goal's."""


@dataclass(frozen=True)
class PathReport:
    """Outcome of the verification of a path."""

    violation: Violation | None
    """The first one found, with its action and time; None if the path is good."""
    configurations: int = 0
    """How many were checked for collisions."""
    deepest_penetration: float = 0.0
    """m, outside the declared contacts."""


Verify = Callable[[World, Skeleton, Trajectory, GoalTerms], PathReport]
"""Checks a whole motion: :func:`verify_path`, or more than it."""


def verify_path(
    world: World, skeleton: Skeleton, trajectory: Trajectory, goals: GoalTerms = NO_TERMS
) -> PathReport:
    """Check a whole motion.

    The motion starts with arms and boxes where the scene has them. It stays within the limits of
    position, velocity, acceleration and effort; grasps and places happen in the skeleton's order,
    each with the gripper really at the box and the box properly on its support; boxes move only
    with a gripper; nothing collides on the way, looked at in steps of at most 1 cm of the fastest
    point (see :class:`_Collisions`); and at the end every box is where the skeleton leaves it.

    Args:
        world: of the scene.
        skeleton: the actions that the motion carries out.
        trajectory: lists all arm and finger joints.
        goals: terms that hold on the way and at the end.
    """
    switches = switches_of(world.scene, skeleton, trajectory)
    if isinstance(switches, Violation):
        return PathReport(switches)
    robot = world.scene.robot.description
    q = trajectory.joints(robot.moving_joints)
    motion = (world.scene, skeleton, switches, q, trajectory.times)
    fault = limit_faults(*motion) or finger_faults(*motion)
    away = float(np.abs(q[0, : len(robot.joint_names)] - world.scene.robot.start).max())
    if fault is None and away > START:
        fault = Violation("start", away, 0, 0.0)
    if fault is not None:
        action = sum(trajectory.times[switch] < fault.time for switch in switches)
        return PathReport(Violation(fault.constraint, fault.amount, int(action), fault.time))
    return _walk(world, skeleton, switches, q, trajectory.times, goals)


def _walk(
    world: World,
    skeleton: Skeleton,
    switches: list[int],
    q: Array,
    times: Array,
    goals: GoalTerms,
) -> PathReport:
    """Follow the motion from mode to mode."""
    states = [world.scene.state]
    for action in skeleton:
        states.append(successor(states[-1], action))
    states.append(states[-1])  # no action ends the last mode
    boxes = initial_poses(world.scene)
    tools = world.scene.robot.tool_poses(q[:, : len(world.scene.robot.description.joint_names)])
    collisions = _Collisions(world, touches(world.scene, skeleton, switches, tools), times)
    for index, (first, last) in enumerate(pairwise([0, *switches, len(times) - 1])):
        state, after = states[index], states[index + 1]
        rows = slice(first, last + 1)
        phase = Phase(world.scene, state, boxes, q[rows], times[rows])
        violation = phase.tilt_fault(goals.upright) or collisions.first_fault(phase)
        violation = violation or _contact_fault(phase, after)
        if violation is not None:
            violation = replace(violation, action=min(index, len(skeleton) - 1))
            return PathReport(violation, collisions.checked, collisions.deepest)
        boxes = phase.boxes_at(-1)
    faults = goals.faults(world.scene, boxes)
    missed = next(chain(faults, _postures_missed(world, goals, q[-1])), None)
    if missed is not None:
        missed = replace(missed, action=len(skeleton) - 1, time=float(times[-1]))
    return PathReport(missed, collisions.checked, collisions.deepest)


def _postures_missed(world: World, goals: GoalTerms, q: Array) -> Iterator[Violation]:
    """Arms that do not end where goals want them, at samples (m,) of all moving joints."""
    for gripper, end in goals.ends.items():
        away = float(np.abs(q[world.scene.robot.description.arms[gripper].slice] - end).max())
        if away > START:
            yield Violation(f"posture {gripper}", away)


class _Collisions:
    """Looks for collisions and counts.

    PyBullet judges every ``JUDGED``-th configuration, those in which fingers move, and those in
    which coal finds the same convex hulls nearer to each other than its padding.
    """

    def __init__(self, world: World, allowed: list[Touch], times: Array) -> None:
        self._world = world
        self._allowed, self._times = allowed, times
        self._robot = world.scene.robot.description
        self.checked = 0
        """Configurations so far."""
        self.deepest = 0.0
        """Deepest penetration (m) outside the declared contacts so far."""

    def first_fault(self, phase: Phase) -> Violation | None:
        """The first collision of a phase."""
        may_touch = phase.touches(self._allowed, self._times)
        support = dict(phase.state.support)
        self.checked += len(phase.q)
        for sample in self._judged(phase):
            for overlap in phase.overlaps(self._world, sample):
                if declared(overlap, self._robot, may_touch[sample], support):
                    continue
                self.deepest = max(self.deepest, overlap.depth)
                if overlap.depth > MARGIN:
                    name = overlap_name(
                        overlap.first, overlap.second, body_names(self._world.scene)
                    )
                    return Violation(name, overlap.depth, time=float(phase.times[sample]))
                break  # they come deepest first
        return None

    def _judged(self, phase: Phase) -> list[int]:
        """The samples that PyBullet judges."""
        judged = phase.crowded()
        judged[::JUDGED] = judged[-1] = True
        fingers = phase.q[:, len(self._robot.joint_names) :]
        judged[1:] |= np.any(np.diff(fingers, axis=0), axis=1)
        return np.flatnonzero(judged).tolist()


def _contact_fault(phase: Phase, after: State) -> Violation | None:
    """A grasp or placement at the end of a phase, of the modes before and after its switch."""
    scene, state = phase.scene, phase.state
    poses = {name: placement.tolist() for name, placement in phase.boxes_at(-1).items()}
    given = given_grasps(scene)
    held, arms, tools = box_bodies(scene), scene.robot.description.arms, phase.tools_at(-1)
    faults = [
        fault
        for box, gripper in dict.fromkeys((*state.held, *after.held))
        for fault in grasp_faults(
            arms[gripper], box, held[box], poses[box], tools[gripper].tolist(), given.get(box)
        )
    ]
    faults += placement_faults(scene, poses, dict(state.support) | dict(after.support))
    return replace(faults[0], time=float(phase.times[-1])) if faults else None
