"""The path bound P(a_1:K): the dense motion for a whole skeleton (paper, eq. 4)."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import chain, islice

from guided_lgp.bounds.coarse import CoarseBound
from guided_lgp.bounds.collision import PADDING
from guided_lgp.bounds.deadline import NEVER, Deadline, OutOfTimeError
from guided_lgp.bounds.goals import NO_TERMS, GoalTerms
from guided_lgp.bounds.path.assembly import FASTEST, Clock, assemble, stay
from guided_lgp.bounds.path.firm import firm_ones, firmest
from guided_lgp.bounds.path.grips import grips_of
from guided_lgp.bounds.path.motions import Mover
from guided_lgp.bounds.path.optimise import optimise
from guided_lgp.bounds.path.sampler import OutcomeSampler
from guided_lgp.bounds.path.situation import Situation, Step
from guided_lgp.bounds.path.task import FurthestFailure, Outcome, Stage, Task
from guided_lgp.bounds.results import CoarseResult, Failure, PathResult
from guided_lgp.bounds.verify import Verify, Violation, verify_path
from guided_lgp.logic import Skeleton
from guided_lgp.scene import Scene
from guided_lgp.scene.world import world_of

ITERATIONS = 150
"""Samples of the sampling planner per motion."""
_QUERIES = 250
"""Collision queries per action (and for four more) and coarse solution: of 108 found motions, 98 %
took less than 210, and with less effort a search that fails goes on to the next solution sooner."""
_VISITS = 4
"""Situations in which an action is begun, counted in the same way: of 101 searches that found a
motion, 98 % begun at most 1.4, one 3.7."""
_PACES = (1.0, 2.0)
"""How many times slower motions are tried than within velocities and accelerations: at half the
speed, motors have a quarter of the dynamic effort beside the weight that they carry."""

Shorten = Callable[[PathResult], PathResult]
"""Makes one motion of the steps of a result; returns that as it is where it finds none."""


@dataclass(frozen=True)
class Style:
    """How motions are made."""

    firm: bool = False
    """Whether grips have to hold what the hands carry; counterweights are avoided then."""
    shorten: Shorten | None = None
    """Makes one motion of the steps, where it can; else one arm moves at a time ..."""
    clock: Clock = FASTEST
    """... by this time law."""
    clearance: float = PADDING
    """See :class:`Mover`."""
    verify: Verify = verify_path
    """Judges motions."""


PAPER = Style()
"""Any motion, of one arm at a time."""


class PathBound:
    """Finds the motion for a skeleton, starting from its coarse solution.

    The search goes through the actions in order. Box poses come from the coarse solution; grips,
    postures and, where needed, placements are chosen anew. An action that cannot be carried out
    sends the search back to the one that it depends on, and in the end to another coarse solution.
    """

    def __init__(
        self,
        scene: Scene,
        coarse: CoarseBound,
        solutions: int,
        deadline: Deadline = NEVER,
        goals: GoalTerms = NO_TERMS,
        style: Style = PAPER,
    ) -> None:
        """Prepare for one scene.

        Args:
            scene: the initial configuration.
            coarse: gives further coarse solutions.
            solutions: largest number of coarse solutions to try.
            deadline: after which it gives up.
            goals: terms that the motion keeps.
            style: how motions are made.
        """
        self._scene = scene
        self._coarse = coarse
        self._solutions = solutions
        self._goals = goals
        self._style = style
        self._mover = Mover(scene, ITERATIONS, deadline, style.clearance)
        self._grips = {
            (gripper, box.name): grips_of(box, arm)
            for gripper, arm in self._mover.robot.arms.items()
            for box in scene.movable
        }
        self._world = world_of(scene)

    def solve(self, coarse_result: CoarseResult) -> PathResult:
        """Find a verified motion.

        Args:
            coarse_result: a feasible result for the skeleton.

        Returns:
            The motion, or a failure that names the action and the obstacle met farthest on.

        Raises:
            OutOfTimeError: the deadline has passed.
        """
        began = time.perf_counter()
        furthest = FurthestFailure()
        skeleton = coarse_result.skeleton
        others = self._coarse.solutions(skeleton, self._solutions)
        solutions = islice(chain(self._coarse.near(coarse_result), others), self._solutions)
        motions = self._motions(skeleton, solutions, furthest, coarse_result)
        found = firmest(self._scene, motions) if self._style.firm else next(motions, None)
        if found is None:
            found = _failed(skeleton, furthest)
        return replace(found, time_s=time.perf_counter() - began)

    def others(self, skeleton: Skeleton, count: int) -> Iterator[PathResult]:
        """Further motions, from up to so many further coarse solutions, whose grips hold firmly
        and in which nothing stands only by what it carries.
        """
        found = self._coarse.solutions(skeleton, count)
        solutions = (solution for solution in found if not self._coarse.leans(solution))
        motions = self._motions(skeleton, solutions, FurthestFailure())
        return firm_ones(self._scene, motions) if self._style.firm else motions

    def _motions(
        self,
        skeleton: Skeleton,
        solutions: Iterable[CoarseResult],
        furthest: FurthestFailure,
        plain: CoarseResult | None = None,
    ) -> Iterator[PathResult]:
        """Verified motions, one from each coarse solution that has one.

        Firm grips are looked for where those of the plain solution, which are the fastest as a
        rule, do not hold.
        """
        for number, solution in enumerate(solutions):
            furthest.tried = number + 1
            task = Task(
                self._scene,
                self._mover,
                self._grips,
                skeleton,
                solution.at_switch,
                furthest,
                number,
                self._goals,
                self._coarse.overhung,
                self._style.firm and (number > 0 or solution is not plain),
            )
            limit = self._mover.queries + _QUERIES * (len(skeleton) + 4)
            gathered = task.gathered()
            if gathered is None:
                continue
            first, situation = gathered
            outcomes = self._search(task, OutcomeSampler(task), limit, 0, situation)
            if not isinstance(outcomes, list):
                continue
            arrived = task.arrived(outcomes[-1].situation)
            if arrived is None:
                continue
            done = (step for outcome in outcomes for step in outcome.steps)
            found = PathResult(
                skeleton,
                feasible=True,
                at_switch=tuple(outcome.contact for outcome in outcomes),
                steps=(*first, *done, *arrived[0]),
            )
            motion = self._motion(task, found)
            if isinstance(motion, Violation):
                furthest.record(motion.action, Stage.VERIFICATION, motion.constraint)
            else:
                yield motion

    def rest(self) -> PathResult:
        """The plan of no actions: arms go where goals want them."""
        furthest = FurthestFailure()
        task = Task(self._scene, self._mover, self._grips, (), (), furthest, 0, self._goals)
        arrived = task.arrived(task.start)
        if arrived is None:
            failure = Failure(0, furthest.constraint, float("nan"), "this motion alone")
            return PathResult((), feasible=False, failure=failure)
        if not arrived[0]:
            return stay(self._scene)
        found = PathResult((), feasible=True, steps=tuple(arrived[0]))
        motion = self._motion(task, found)
        if isinstance(motion, Violation):
            failure = Failure(0, motion.constraint, motion.amount, "verification")
            return PathResult((), feasible=False, failure=failure)
        return motion

    def _motion(self, task: Task, found: PathResult) -> PathResult | Violation:
        """The verified motion of all steps: of all arms at once, or else optimised, or as it is."""
        if self._style.shorten is not None:
            shorter = self._style.shorten(found)
            if shorter.trajectory is not None:
                return shorter
        with suppress(OutOfTimeError):
            motion = self._in_turn(task, found, optimise(self._mover, found.steps))
            if isinstance(motion, PathResult):
                return motion
        return self._in_turn(task, found, found.steps)

    def _in_turn(
        self, task: Task, found: PathResult, steps: Sequence[Step]
    ) -> PathResult | Violation:
        """The verified motion of some steps one after the other, slower where motors are weak."""
        for pace in _PACES:
            trajectory = assemble(self._mover.robot, task.start, steps, pace, self._style.clock)
            report = self._style.verify(self._world, found.skeleton, trajectory, self._goals)
            if report.violation is None or not report.violation.constraint.startswith("effort "):
                break
        if report.violation is not None:
            return report.violation
        verification = {
            "configurations": report.configurations,
            "deepest_penetration_m": report.deepest_penetration,
        }
        return replace(found, trajectory=trajectory, verification=verification)

    def _search(
        self, task: Task, sampler: OutcomeSampler, limit: int, index: int, situation: Situation
    ) -> list[Outcome] | int:
        """Carry out the actions from ``index`` on, or say which earlier one to change."""
        if index == len(task):
            return []
        begun = False
        for outcome in sampler.outcomes(index, situation):
            begun = True
            rest = self._search(task, sampler, limit, index + 1, outcome.situation)
            if isinstance(rest, list):
                return [outcome, *rest]
            if rest < index:
                return rest
            if self._mover.queries > limit or sampler.visits > _VISITS * (len(task) + 4):
                return -1
        return sampler.backjump_target(index, situation, begun)


def _failed(skeleton: Skeleton, furthest: FurthestFailure) -> PathResult:
    failure = Failure(
        max(furthest.action, 0),
        furthest.constraint,
        float("nan"),
        f"{furthest.tried} coarse solutions with grips, postures and placements chosen anew",
    )
    return PathResult(skeleton, feasible=False, failure=failure)
