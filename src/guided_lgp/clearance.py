"""How near a plan comes to what it does not touch."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from guided_lgp.bounds.checks import Violation, body_names, overlap_name
from guided_lgp.bounds.collision import LEAST, PADDING
from guided_lgp.bounds.goals import NO_TERMS, GoalTerms
from guided_lgp.bounds.results import Array, PathResult, Trajectory
from guided_lgp.bounds.verify import PathReport, verify_path
from guided_lgp.bounds.verify.attachments import switches_of
from guided_lgp.bounds.verify.phase import Phase
from guided_lgp.bounds.verify.touching import touches
from guided_lgp.errors import InputError
from guided_lgp.logic import Skeleton, State, successor
from guided_lgp.scene import Scene
from guided_lgp.scene.world import World, initial_poses, world_of

CLEARANCE = 0.01
"""m that a user's plan keeps from what it does not touch, unless another distance is wished."""
WIDEST = 0.05
"""Largest clearance (m) that may be wished: boxes are seldom farther apart."""
FARTHEST = 0.1
"""m: nobody asks for more."""
_SLACK = 0.004
"""m by which PyBullet may find bodies nearer to each other than coal: its hulls are wider."""
_Pair = tuple[str, str]
"""Two bodies."""
_RESTING = 0.03
"""m of the hand's way up to which a box keeps no distance from what it stood on, or will stand on:
as long as a straight way up."""


@dataclass(frozen=True)
class Clearance:
    """The smallest distance of a moving part from a body that it does not touch."""

    distance: float
    """m, by the hulls of the meshes; ``FARTHEST`` where nothing comes nearer."""
    part: str = ""
    """A link, or a box in a hand."""
    body: str = ""
    """What it passes."""
    time: float = 0.0
    """s, when."""

    def __str__(self) -> str:
        if not self.part:
            return f"more than {1000 * self.distance:.0f} mm"
        place = f"{self.part} to {self.body} at {self.time:.1f} s"
        return f"{1000 * self.distance:.1f} mm, {place}"


def check_clearance(clearance: float) -> None:
    """Require a clearance that may be wished."""
    if not PADDING <= clearance <= WIDEST:
        accepted = f"{PADDING:g} to {WIDEST:g}"
        raise InputError("clearance", f"{clearance:g} m is out of range", accepted)


def clearance_of_path(scene: Scene, path: PathResult | None) -> Clearance | None:
    """Where a plan's motion comes nearest to what it does not touch; None without a motion."""
    if path is None or path.trajectory is None:
        return None
    return clearance_of(scene, path.skeleton, path.trajectory)


def verify_apart(
    world: World, skeleton: Skeleton, trajectory: Trajectory, goals: GoalTerms = NO_TERMS
) -> PathReport:
    """As ``verify_path``; and nothing comes nearer than ``LEAST`` to what it does not touch, unless
    they are that near at the start.
    """
    report = verify_path(world, skeleton, trajectory, goals)
    if report.violation is not None:
        return report
    near, ignored = _nearest(world, skeleton, trajectory, LEAST), set[_Pair]()
    while near.part and _beside(world, near.part, near.body):
        ignored |= {(near.part, near.body), (near.body, near.part)}
        near = _nearest(world, skeleton, trajectory, LEAST, ignored)
    if not near.part:
        return report
    switches = switches_of(world.scene, skeleton, trajectory)
    assert isinstance(switches, list)
    name = overlap_name(near.part, near.body, body_names(world.scene))
    action = sum(trajectory.times[switch] < near.time for switch in switches)
    action = min(int(action), len(skeleton) - 1)
    return replace(report, violation=Violation(name, LEAST - near.distance, action, near.time))


def _beside(world: World, part: str, body: str) -> bool:
    """Whether two bodies are nearer than ``LEAST`` before anything moves, not one on the other."""
    if {(part, body), (body, part)} & set(world.scene.state.support):
        return False
    world.set(world.scene.robot.start, initial_poses(world.scene))
    return world.distance(part, body) < LEAST


def clearance_of(scene: Scene, skeleton: Skeleton, trajectory: Trajectory) -> Clearance:
    """The smallest clearance of a plan.

    Hand and box keep no distance while one takes or leaves the other, nor do a box and what it
    stands on as it is lifted and put down. Arms are not looked at against each other. Between two
    samples no point moves more than 1 cm.

    Args:
        scene: the initial configuration.
        skeleton: the actions.
        trajectory: the motion, which has been verified.
    """
    return _nearest(world_of(scene), skeleton, trajectory, FARTHEST)


def _nearest(
    world: World,
    skeleton: Skeleton,
    trajectory: Trajectory,
    within: float,
    ignored: Collection[_Pair] = (),
) -> Clearance:
    """The smallest clearance of a plan, if it is less than a distance (m); without some pairs."""
    scene, nearest = world.scene, Clearance(within)
    rows = switches_of(scene, skeleton, trajectory)
    if not isinstance(rows, list):
        raise ValueError(f"the motion is not that of the actions: {rows.constraint}")
    robot = scene.robot.description
    q = trajectory.joints(robot.moving_joints)
    states = [scene.state]
    for action in skeleton:
        states.append(successor(states[-1], action))
    tools = scene.robot.tool_poses(q[:, : len(robot.joint_names)])
    allowed = touches(scene, skeleton, rows, tools)
    rests = list(_rests(states, rows, tools, trajectory.times))
    ends, boxes = [0, *rows, len(q) - 1], initial_poses(scene)
    for index, (first, last) in enumerate(pairwise(ends)):
        part = slice(first, last + 1)
        phase = Phase(scene, states[index], boxes, q[part], trajectory.times[part])
        touched = phase.touches(allowed, trajectory.times)
        nearest = _nearest_of(world, phase, touched, rests, nearest, ignored)
        boxes = phase.boxes_at(-1)
    return nearest


@dataclass(frozen=True)
class _Rest:
    """A box is lifted from a body, or put down on it, between two moments (s)."""

    box: str
    body: str
    start: float
    end: float


def _rests(
    states: Sequence[State], rows: Sequence[int], tools: Mapping[str, Array], times: Array
) -> Iterator[_Rest]:
    """While hands are where they have taken boxes or will let go of them, or near it."""
    for (before, after), row in zip(pairwise(states), rows, strict=True):
        for box, body in sorted(set(before.support) ^ set(after.support)):
            lifted = before.support_of(box) == body
            gripper = (after if lifted else before).holder(box)
            if gripper is None:
                continue
            path = tools[gripper][row:, :3] if lifted else tools[gripper][row::-1, :3]
            gone = np.linalg.norm(path - path[0], axis=1) > _RESTING
            way = int(np.argmax(gone)) if gone.any() else len(path) - 1
            first, last = (row, row + way) if lifted else (row - way, row)
            yield _Rest(box, body, times[first], times[last])


def _nearest_of(
    world: World,
    phase: Phase,
    touched: list[set[tuple[str, str]]],
    rests: Sequence[_Rest],
    nearest: Clearance,
    ignored: Collection[_Pair],
) -> Clearance:
    """The smallest clearance of a phase, if it is smaller than that of those before it.

    By what coal knows of the distances, PyBullet measures what may be as near, the nearest first;
    below ``LEAST``, only where it is crowded.
    """
    samples = np.arange(len(phase.q))
    if nearest.distance <= LEAST:
        samples = samples[phase.crowded()]
    named, least = phase.gaps(samples)
    close = np.flatnonzero((least < nearest.distance + _SLACK).any(axis=0))
    pairs, least = [_moving_first(phase, named[column]) for column in close], least[:, close]
    asked = _asked(phase, samples, pairs, touched, rests)
    asked[:, [pair in ignored for pair in pairs]] = False
    rows, columns = np.nonzero(asked & (least < nearest.distance + _SLACK))
    least, shown = least[rows, columns], -1
    for number in np.argsort(least, kind="stable").tolist():
        if least[number] >= nearest.distance + _SLACK:
            break
        sample, (part, body) = int(samples[rows[number]]), pairs[columns[number]]
        if sample != shown:
            phase.show(world, sample, everything=shown < 0)
            shown = sample
        distance = world.distance(part, body, FARTHEST)
        if distance < nearest.distance:
            nearest = Clearance(distance, part, body, float(phase.times[sample]))
    return nearest


def _moving_first(phase: Phase, pair: _Pair) -> _Pair:
    """A link or a box in a hand, and what it may meet."""
    first, second = pair
    moves = second in phase.grips and first not in phase.scene.robot.description.moving_links
    return (second, first) if moves else pair


def _asked(
    phase: Phase,
    samples: NDArray[np.intp],
    pairs: Sequence[_Pair],
    touched: Sequence[set[_Pair]],
    rests: Iterable[_Rest],
) -> NDArray[np.bool_]:
    """In which samples (m, p) which pairs should not touch: of a moving part and a body."""
    robot, bodies, times = phase.scene.robot.description, body_names(phase.scene), phase.times
    hand_of = {link: g for g, arm in robot.arms.items() for link in arm.hand_links}
    asked = np.zeros((len(samples), len(pairs)), np.bool_)
    for column, (part, body) in enumerate(pairs):
        carried = part in phase.grips and body not in phase.grips
        if body not in bodies or not (carried or part in robot.moving_links):
            continue
        hand, (holder, _) = hand_of.get(part), phase.grips.get(body, (None, None))
        if hand is None or hand != holder:
            asked[:, column] = [(body, hand) not in touched[sample] for sample in samples]
        for rest in rests:
            if (rest.box, rest.body) == (part, body):
                during = (times >= rest.start) & (times <= rest.end)
                asked[during[samples], column] = False
    return asked
