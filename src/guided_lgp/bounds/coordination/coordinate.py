"""From a verified plan to a shorter one that is verified as well."""

import time
from contextlib import suppress
from dataclasses import replace
from functools import cached_property
from math import isnan

from guided_lgp.bounds.collision import LEAST, PADDING
from guided_lgp.bounds.coordination.itinerary import Itinerary, itinerary
from guided_lgp.bounds.coordination.moments import Moments
from guided_lgp.bounds.coordination.roads import MANNERS, Manner, Road
from guided_lgp.bounds.coordination.schedule import schedule
from guided_lgp.bounds.coordination.timetable import Timetable
from guided_lgp.bounds.deadline import NEVER, Deadline, OutOfTimeError
from guided_lgp.bounds.goals import NO_TERMS, GoalTerms
from guided_lgp.bounds.path.bound import ITERATIONS
from guided_lgp.bounds.path.motions import Mover
from guided_lgp.bounds.path.situation import situation_at_start
from guided_lgp.bounds.results import PathResult
from guided_lgp.bounds.verify import Verify, Violation, verify_path
from guided_lgp.logic import Skeleton
from guided_lgp.scene import Scene
from guided_lgp.scene.world import world_of

_ATTEMPTS = 5
"""Schedules that are looked at, each without the faults of those before."""
_OF_CONTACTS = ("hold", "pads", "stand", "balanced")
"""Faults of where bodies are in hands or on others: no manner of moving there mends them."""


class Coordinator:
    """Shortens the plans of one scene."""

    def __init__(
        self,
        scene: Scene,
        deadline: Deadline = NEVER,
        goals: GoalTerms = NO_TERMS,
        in_order: bool = False,
        clearance: float = PADDING,
        verify: Verify = verify_path,
    ) -> None:
        """Prepare for one scene.

        Args:
            scene: the initial configuration.
            deadline: after which it gives up.
            goals: terms that the motion keeps.
            in_order: whether all actions take effect one after the other as they are given.
            clearance: see :class:`Mover`.
            verify: judges motions.
        """
        self._scene = scene
        self._deadline, self._in_order, self._clearance = deadline, in_order, clearance
        self._goals, self._verify = goals, verify
        self._start = situation_at_start(scene, goals.upright)

    @cached_property
    def _mover(self) -> Mover:
        """Made when first needed: most searches end without a path."""
        return Mover(self._scene, ITERATIONS, self._deadline, self._clearance)

    def shorten(self, result: PathResult) -> PathResult:
        """The same actions in less time; actions of two arms may change places.

        Args:
            result: steps that the path bound has found, and their motion, if it is made.

        Returns:
            The new motion, or ``result`` where none is found in time.
        """
        if not result.skeleton:
            return result
        began = time.perf_counter()
        plan = itinerary(
            self._start, result.skeleton, result.steps, self._mover.arms, self._in_order
        )
        for manner in MANNERS:
            with suppress(OutOfTimeError):
                motion = self._scheduled(result.skeleton, plan, manner)
                if isinstance(motion, Violation):
                    break
                if motion is not None:
                    elapsed = result.time_s + time.perf_counter() - began
                    return replace(motion, steps=result.steps, time_s=elapsed)
        return result

    def _scheduled(
        self, skeleton: Skeleton, plan: Itinerary, manner: Manner
    ) -> PathResult | Violation | None:
        """A verified motion by the ways of all arms, which are apart also between rows, and well
        so if a few attempts find such a one; or what keeps every manner from having one.
        """
        busy = sum(len(stops) > 1 for stops in plan.stops.values())
        roads = {
            gripper: Road(self._mover, gripper, stops, busy > 1, manner)
            for gripper, stops in plan.stops.items()
        }
        moments = Moments(self._scene, roads, plan)
        near: PathResult | None = None
        for _ in range(_ATTEMPTS):
            self._deadline.check()
            found = schedule(roads, moments)
            if found is None:
                break
            timetable = Timetable(self._scene, roads, plan, found)
            motion = self._verified(skeleton, timetable)
            if isinstance(motion, Violation):
                if motion.constraint.startswith(_OF_CONTACTS):
                    return near or motion
                if isnan(motion.time):
                    break  # what is wrong is nothing that another moment would mend
                moments.block(found[timetable.row_at(motion.time)])
                continue
            distance, met = moments.met(found, timetable.rows)
            if met is None:
                return motion
            if distance >= LEAST:
                near = near or motion
            moments.block(met)
        return near

    def _verified(self, skeleton: Skeleton, timetable: Timetable) -> PathResult | Violation:
        """The motion of a schedule, or what is wrong with it."""
        actions = tuple(skeleton[number] for number, _ in timetable.switches)
        trajectory = timetable.trajectory(actions)
        report = self._verify(world_of(self._scene), actions, trajectory, self._goals)
        if report.violation is not None:
            return report.violation
        return PathResult(
            actions,
            feasible=True,
            trajectory=trajectory,
            at_switch=timetable.keyframes(self._mover.arms),
            verification={
                "configurations": report.configurations,
                "deepest_penetration_m": report.deepest_penetration,
            },
        )
