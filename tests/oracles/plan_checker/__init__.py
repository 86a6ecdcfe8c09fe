"""A checker of plan files, written from the description of their format alone.

It shares no code with the planner, only the robot files: kinematics by pinocchio on the URDF that
such a file names, collisions by PyBullet between the convex hulls of its meshes, each placed where
pinocchio puts it, and the boxes carried along as the attachments say. ``check(document)`` returns
the faults.

Conventions: lengths in m, angles in rad, times in s; poses are homogeneous matrices (..., 4, 4) in
the world, where the base link is at the scene's ``robot.base`` (x, y, yaw) and ``robot.height``,
turned by ``robot.tilt``. A *row* is an index into ``path.times``; *interval* i lies between rows i
and i + 1, where joints move linearly.
"""

from collections.abc import Mapping
from typing import Any

from plan_checker.actions import (
    UnmatchedError,
    illegal_actions,
    missed_goals,
    switch_events,
    wrong_carriers,
)
from plan_checker.bodies import badly_standing, carried, wrong_keyframes
from plan_checker.contacts import collisions, wrong_fingers, wrong_grasps
from plan_checker.document import Fault, Motion, read_plan
from plan_checker.robot import Robot, broken_limits, broken_mimics, broken_velocities, wrong_start

__all__ = ["Fault", "check"]


def check(document: Mapping[str, Any]) -> list[Fault]:
    """The faults of a plan; none: anyone can carry it out and the goals hold at its end."""
    try:
        plan = read_plan(document)
    except (KeyError, TypeError, ValueError, IndexError) as error:
        return [Fault("format", None, f"{type(error).__name__}: {error}")]
    robot = Robot(plan)
    faults = [*robot.unknown(), *illegal_actions(plan)]
    if faults:
        return faults
    faults += [
        *wrong_start(plan),
        *broken_limits(plan, robot),
        *broken_velocities(plan, robot),
        *broken_mimics(plan),
    ]
    links, tools = robot.forward(plan.q)
    motion = Motion(links, tools, carried(plan, tools))
    try:
        events = switch_events(plan)
    except UnmatchedError as unmatched:
        return [*faults, unmatched.fault]
    return [
        *faults,
        *wrong_carriers(plan, events),
        *badly_standing(plan, events, motion),
        *wrong_grasps(plan, robot, events, motion),
        *wrong_fingers(plan, events, motion),
        *wrong_keyframes(plan, events, motion),
        *collisions(plan, robot, events, motion),
        *missed_goals(plan, events, motion),
    ]
