"""A schedule as rows of all joints, and the actions in the order in which they take effect."""

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np

from guided_lgp.bounds.coordination.itinerary import Itinerary
from guided_lgp.bounds.coordination.law import TICK
from guided_lgp.bounds.coordination.moments import Moment
from guided_lgp.bounds.coordination.roads import Edge, Node, Road
from guided_lgp.bounds.path.situation import tool_pose
from guided_lgp.bounds.results import Array, Keyframe, Trajectory
from guided_lgp.bounds.verify.attachments import carriers, spans
from guided_lgp.logic import Skeleton
from guided_lgp.poses import compose
from guided_lgp.robots import PlacedArm
from guided_lgp.scene import Scene


class Timetable:
    """The motion of all arms, tick by tick."""

    def __init__(
        self, scene: Scene, roads: Mapping[str, Road], plan: Itinerary, moments: Sequence[Moment]
    ) -> None:
        self._scene = scene
        self._robot = scene.robot.description
        self._roads = roads
        self._plan = plan
        self._moments = moments

    @cached_property
    def switches(self) -> list[tuple[int, int]]:
        """Number and row of every action, in the order of the rows."""
        found = []
        for row, moment in enumerate(self._moments):
            for road, (where, at) in zip(self._roads.values(), moment, strict=True):
                if isinstance(where, Edge) and at == where.ticks:
                    action = road.action(where.end)
                    found += [] if action is None else [(action, row)]
        return sorted(found, key=lambda switch: (switch[1], switch[0]))

    def trajectory(self, skeleton: Skeleton) -> Trajectory:
        """The motion, by the actions in the order in which they take effect."""
        rows = [row for _, row in self.switches]
        attachments = spans(self._scene.state, skeleton, rows, len(self.rows), carriers)
        times = TICK * np.arange(len(self.rows), dtype=float)
        return Trajectory(self._robot.moving_joints, times, self.rows, tuple(attachments))

    def keyframes(self, arms: Mapping[str, PlacedArm]) -> tuple[Keyframe, ...]:
        """The configuration at every switch."""
        joints = len(self._robot.joint_names)
        done, found = set[int](), []
        for action, row in self.switches:
            done.add(action)
            q, bodies = self.rows[row, :joints], self._plan.bodies(done)
            tools = {gripper: tool_pose(arm, q) for gripper, arm in arms.items()}
            carried = {b: compose(tools[g], grasp) for b, (g, grasp) in bodies.carried.items()}
            found.append(Keyframe(q, {**bodies.standing, **carried}))
        return tuple(found)

    def row_at(self, time: float) -> int:
        """The row at a time (s), or the next one."""
        return min(int(np.ceil(time / TICK - 1e-9)), len(self._moments) - 1)

    @cached_property
    def rows(self) -> Array:
        """(T, joints) all moving joints."""
        rows = np.empty((len(self._moments), len(self._robot.moving_joints)))
        for row, moment in zip(rows, self._moments, strict=True):
            for arm, road, (where, at) in zip(
                self._robot.arms.values(), self._roads.values(), moment, strict=True
            ):
                here = (
                    road.rest(where)
                    if isinstance(where, Node)
                    else (where.q[at], where.fingers[at])
                )
                row[arm.slice], row[arm.fingers.slice] = here[0], here[1] * arm.fingers.ratios
        return rows
