"""Going on from what is observed: the rest of a plan is kept, repaired, or planned anew.

A laboratory's own perception and control go around it like this::

    course = Course.of(read_plan("plan.json"))
    while course.skeleton:
        part = first_actions(course)
        carry_out(part.trajectory)  # by the robot
        course = replan(course, len(part.skeleton), look()).course
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import accumulate, islice
from typing import Literal

import numpy as np

from guided_lgp.bounds.checks import Violation
from guided_lgp.bounds.deadline import Deadline
from guided_lgp.bounds.execution import Conditions, Execution, PhysicsReport
from guided_lgp.bounds.execution.conditions import AS_PLANNED
from guided_lgp.bounds.execution.noise import misplaced
from guided_lgp.bounds.path.assembly import stay
from guided_lgp.bounds.plan_file import Plan
from guided_lgp.bounds.results import PathResult, Trajectory
from guided_lgp.bounds.verify.attachments import switches_of
from guided_lgp.clearance import CLEARANCE, Clearance, check_clearance, clearance_of_path
from guided_lgp.errors import InputError
from guided_lgp.explanation import users_bounds
from guided_lgp.logic import (
    Goal,
    Objective,
    Skeleton,
    State,
    Symbols,
    applicable_actions,
    are_applicable,
    format_skeleton,
    progress,
    satisfied,
    successor,
)
from guided_lgp.observed import Observed, ObservedBox, observed_scene
from guided_lgp.params import PlanningParams, load_planning
from guided_lgp.planning import plan as search
from guided_lgp.scene import Scene
from guided_lgp.scene.validate import validate_scene

How = Literal["kept", "repaired", "planned anew"]
REPAIR = 2
"""Most actions that a repair puts before what is left of a plan."""
TRIED = 4
"""Sequences whose geometry is tried before a plan is searched for anew."""
MIDDLE = 0.01
"""m from the middle of a box at which another one is put on it, where that can be."""
ANY_TURN = 4.0
"""rad: more than half a turn."""
AWAY = 0.08
"""m that hands are from where they act when somebody looks."""
_HOME = 2e-3
"""rad: joints nearer to home than this are there; motors hold no better."""
_FLOOR = 0.0
"""m: what falls below it is out of sight."""


@dataclass(frozen=True)
class Course:
    """A plan on its way: actions and motion from a scene to goals."""

    scene: Scene
    objective: Objective
    skeleton: Skeleton
    trajectory: Trajectory

    @classmethod
    def of(cls, plan: Plan) -> "Course":
        """That of a plan file."""
        return cls(plan.scene, plan.goals, plan.skeleton, plan.trajectory)


@dataclass(frozen=True)
class Replanned:
    """How a plan goes on."""

    how: How
    """What became of the rest of the plan."""
    path: PathResult | None
    """The motion from here on; None if nothing was found."""
    scene: Scene
    """As observed."""
    objective: Objective
    explanation: str = ""
    """Why there is no motion."""

    @cached_property
    def clearance(self) -> Clearance | None:
        """Where its motion comes nearest to what it does not touch; None without a motion."""
        return clearance_of_path(self.scene, self.path)

    @property
    def course(self) -> Course:
        """The plan from here on.

        Raises:
            InputError: there is none.
        """
        if self.path is None or self.path.trajectory is None:
            raise InputError("plan", f"cannot go on: {self.explanation}")
        return Course(self.scene, self.objective, self.path.skeleton, self.path.trajectory)


def replan(
    course: Course,
    after: int,
    observed: Observed,
    *,
    params: PlanningParams | None = None,
    clearance: float = CLEARANCE,
    timeout: float | None = None,
    where: str = "observed",
) -> Replanned:
    """Go on with a plan from what is seen after some of its actions.

    Args:
        course: the plan.
        after: how many of its actions have been carried out.
        observed: what is seen now.
        params: limits of planning; the shipped ones by default.
        clearance: m that motions keep from what they do not touch, where there is room.
        timeout: seconds of wall clock for each planning.
        where: the file of what is observed, for messages.

    Raises:
        InputError: what is seen has a fault, or a goal names a box that is gone.
    """
    if not 0 <= after <= len(course.skeleton):
        accepted = f"0 to {len(course.skeleton)}"
        raise InputError("after", f"{after} is out of range", accepted)
    check_clearance(clearance)
    scene = observed_scene(course.scene, observed, where)
    _require_boxes(course, scene, where)
    validate_scene(scene, where)
    goals, rest = course.objective, course.skeleton[after:]
    params = params or load_planning()
    deadline = Deadline.after(timeout)
    bounds = partial(users_bounds, scene, params.bounds, deadline, clearance=clearance)
    for way in islice(_ways(scene.state, rest, goals, scene.symbols), TRIED):
        for more in dict.fromkeys((in_the_middle(scene, way), ())):
            path = bounds((*goals, *more)).path(way) if way else stay(scene)
            if path.feasible:
                return Replanned("kept" if way == rest else "repaired", path, scene, goals)
    found = search(
        scene,
        list(map(str, goals)),
        params=params,
        timeout=timeout,
        where=where,
        coordinate=False,
        clearance=clearance,
    )
    return Replanned("planned anew", found.path, found.scene, goals, found.explanation)


def in_the_middle(scene: Scene, way: Skeleton) -> Objective:
    """A goal by which the box that is put down next is in the middle of the one below it.

    There it is farthest from a fall, whatever an arm is amiss. No goal where it is put on a table,
    or where it or what is below it does not stay: goals hold at the end.
    """
    states = list(accumulate(way, successor, initial=scene.state))
    for state in states[1:]:
        for box, below in sorted(set(state.support) - set(scene.state.support)):
            stacks = {_stack(later, box) for later in states[states.index(state) :]}
            stays = len({_stack(state, below) for state in states}) == len(stacks) == 1
            return _at_middle(scene, box, below) if stays else ()
    return ()


def _stack(state: State, body: str) -> tuple[str, ...]:
    """A body and all that is below it, down to a table or a gripper."""
    parents, stack = dict(state.support + state.held), [body]
    while stack[-1] in parents:
        stack.append(parents[stack[-1]])
    return tuple(stack)


def _at_middle(scene: Scene, box: str, below: str) -> Objective:
    boxes, known = {body.name: body for body in scene.movable}, scene.symbols
    on_a_box = below in boxes and _stack(scene.state, below)[-1] not in known.grippers
    if not on_a_box or "at" not in {kind.name for kind in known.domain.further_goals}:
        return ()
    x, y, top = boxes[below].top
    middle = (x, y, top + boxes[box].size[2] / 2, boxes[below].yaw, MIDDLE, ANY_TURN)
    return (Goal("at", (box, below, *map(str, middle))),)


def _require_boxes(course: Course, scene: Scene, where: str) -> None:
    names = {body.name for body in scene.bodies}
    for goal in course.objective:
        for symbol in goal.symbols:
            if symbol in course.scene.symbols.boxes and symbol not in names:
                raise InputError(f"{where}: boxes", f"{symbol} is gone, and {goal} asks for it")


def _ways(
    start: State, rest: Skeleton, objective: Objective, symbols: Symbols
) -> Iterator[Skeleton]:
    """Sequences that reach the goals by what is left of a plan, the least changed first."""
    before: dict[State, Skeleton] = {start: ()}
    for _ in range(REPAIR + 1):
        for skipped in range(len(rest) + 1):
            for prefix in before.values():
                way = (*prefix, *rest[skipped:])
                if _reaches(start, way, objective, symbols):
                    yield way
        before = {
            successor(state, action): (*prefix, action)
            for state, prefix in reversed(before.items())
            for action in applicable_actions(state, symbols)
        }


def _reaches(start: State, way: Skeleton, objective: Objective, symbols: Symbols) -> bool:
    return are_applicable(way, start, symbols) and satisfied(progress(start, way), objective)


class Laboratory(Execution):
    """A simulation with a perfect eye, in which others may lay hands on things."""

    def seen(self) -> Observed:
        """What is where."""
        robot, joints = self._robot, self.joints()
        at_home = np.abs(joints - robot.home) < _HOME
        values = np.clip(joints, *robot.position_limits.T)
        moved = zip(robot.joint_names, values.tolist(), at_home, strict=True)
        boxes = {
            name: ObservedBox(position=tuple(pose[:3]), quaternion=tuple(pose[3:]))
            for name, pose in self.boxes().items()
            if pose[2] > _FLOOR
        }
        held = {box: gripper for box, gripper in self.held().items() if box in boxes}
        return Observed(
            joints={joint: value for joint, value, home in moved if not home},
            boxes=boxes,
            held=held,
        )

    def drop(self, gripper: str, seconds: float = 1.0) -> None:
        """Let a hand lose what it holds."""
        for holder, box in [held for held in self._held if held[0] == gripper]:
            self._release(holder, box)
        self._simulation.rest(seconds)


@dataclass(frozen=True)
class Followed:
    """What became of a plan in closed loop."""

    report: PhysicsReport
    """Of the world at the end."""
    decisions: tuple[str, ...]
    """After each look: what went wrong, how the plan goes on, and with which actions."""


def follow(
    course: Course,
    conditions: Conditions = AS_PLANNED,
    disturb: Callable[[Laboratory, int], None] | None = None,
    *,
    params: PlanningParams | None = None,
    timeout: float | None = None,
) -> Followed:
    """Carry out a plan in the simulation, looking after each action where everything is.

    Args:
        course: the plan.
        conditions: of the execution.
        disturb: called before each look with the world and the number of actions so far.
        params: limits of planning; the shipped ones by default.
        timeout: seconds of wall clock for each planning.
    """
    decisions: list[str] = []
    most, made = 3 * len(course.skeleton) + 6, 0
    world = Laboratory(course.scene, replace(conditions, noise=0.0))
    with world:
        while course.skeleton and made < most:
            part = first_actions(course)
            count = len(part.skeleton)
            motion = _as_it_will_be(part, conditions, made)
            fault = world.carry_out(part.scene, part.skeleton, motion)
            made += count
            if disturb is not None:
                disturb(world, made)
            try:
                replanned = replan(course, count, world.seen(), params=params, timeout=timeout)
                course = replanned.course
            except InputError as error:
                return Followed(PhysicsReport(False, fault=str(error)), tuple(decisions))
            rest = format_skeleton(course.skeleton) or "done"
            decisions.append(": ".join(filter(None, (fault, replanned.how, rest))))
            world.state = course.scene.state
        report = world.report(course.objective, world.boxes())
    return Followed(report, tuple(decisions))


def _as_it_will_be(course: Course, conditions: Conditions, made: int) -> Trajectory:
    """The motion with the noise of an arm, which is another one for every action."""
    rows = switches_of(course.scene, course.skeleton, course.trajectory)
    if not conditions.noise or isinstance(rows, Violation):
        return course.trajectory
    seed = 1000 * conditions.seed + made
    return misplaced(course.scene, course.skeleton, rows, course.trajectory, conditions.noise, seed)


def first_actions(course: Course) -> Course:
    """The first action, and more where nobody can look after it; the hands are free then.

    Scenes do not know hands that carry boxes on the one that they hold, and a plan in which all
    arms move has moments at which one of them is always busy.
    """
    rows = switches_of(course.scene, course.skeleton, course.trajectory)
    if isinstance(rows, Violation):
        return course
    for count in range(1, len(course.skeleton)):
        state = progress(course.scene.state, course.skeleton[:count])
        row = _away(course, rows, count)
        if row is not None and not any(state.standing_on(box) for box, _ in state.held):
            return _cut(course, count, row)
    return course


def _away(course: Course, rows: Sequence[int], count: int) -> int | None:
    """The first row after an action at which no hand is where it acted, or will act next."""
    robot, trajectory = course.scene.robot.description, course.trajectory
    tools = course.scene.robot.tool_poses(trajectory.joints(robot.joint_names))
    first, last = rows[count - 1], rows[count]
    away = np.ones(last - first, bool)
    for gripper, poses in tools.items():
        acts = [row for row, a in zip(rows, course.skeleton, strict=True) if gripper in a.symbols]
        for row in (
            *[row for row in acts if row <= first][-1:],
            *[r for r in acts if r > first][:1],
        ):
            ways = poses[first:last, :3] - poses[row, :3]
            away &= np.linalg.norm(ways, axis=1) >= AWAY
    return first + int(np.argmax(away)) if away.any() else None


def _cut(course: Course, count: int, row: int) -> Course:
    """The first actions, until a row."""
    trajectory = course.trajectory
    kept = [
        replace(attachment, end=min(attachment.end, row))
        for attachment in trajectory.attachments
        if attachment.start < row
    ]
    motion = Trajectory(
        trajectory.joint_names,
        trajectory.times[: row + 1],
        trajectory.q[: row + 1],
        tuple(kept),
    )
    return replace(course, skeleton=course.skeleton[:count], trajectory=motion)
