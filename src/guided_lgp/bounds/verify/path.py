"""Verification of paths."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from guided_lgp.bounds.checks import Violation, body_names, box_sizes, overlap_name
from guided_lgp.bounds.results import Array, Attachment, Trajectory
from guided_lgp.bounds.verify.geometry import declared, grasp_faults, placement_faults
from guided_lgp.bounds.verify.keyframes import LIMIT_TOLERANCE
from guided_lgp.bounds.verify.phase import Phase
from guided_lgp.logic import Skeleton, State, applicable_actions, successor
from guided_lgp.robots import Arm, Robot
from guided_lgp.scene import Scene
from guided_lgp.scene.world import MARGIN, World, initial_poses

RATE_TOLERANCE = 1.02
"""Factor on velocity and acceleration limits, for finite differences."""
JUMP = 3.0
"""A joint that is faster than this multiple of its limit jumps."""
START = 1e-3
"""How far (rad) the first configuration may be off all arms at their side."""
SQUEEZE = 0.004
"""How far (m) the fingers' opening may be off the width of the box they carry."""
AT_REST = 1e-3
"""How far (rad) the joints of an arm move at most while its fingers open or close."""


@dataclass(frozen=True)
class PathReport:
    """Outcome of the verification of a path."""

    violation: Violation | None
    """The first one found, with its action and time; None if the path is good."""
    configurations: int = 0
    """How many were checked for collisions."""
    deepest_penetration: float = 0.0
    """m, outside the declared contacts."""


def verify_path(world: World, skeleton: Skeleton, trajectory: Trajectory) -> PathReport:
    """Check a whole motion.

    The motion starts with all arms at their side and the boxes where the scene has them. It
    stays within the limits of position, velocity and acceleration; grasps and places happen in
    the skeleton's order, each with the gripper really at the box and the box properly on its
    support; boxes move only with a gripper; nothing collides on the way, looked at in steps of
    at most 1 cm of the fastest point; and at the end every box is where the skeleton leaves it.

    Args:
        world: of the scene.
        skeleton: the actions that the motion carries out.
        trajectory: lists all arm and finger joints.
    """
    switches = switches_of(world.scene, skeleton, trajectory)
    if isinstance(switches, Violation):
        return PathReport(switches)
    robot = world.scene.robot.description
    columns = [trajectory.joint_names.index(name) for name in robot.moving_joints]
    q = trajectory.q[:, columns]
    fault = _rate_faults(robot, q, trajectory.times) or _finger_faults(
        world.scene, skeleton, switches, q, trajectory.times
    )
    away = float(np.abs(q[0, : len(robot.joint_names)] - robot.home).max())
    if fault is None and away > START:
        fault = Violation("start", away, 0, 0.0)
    if fault is not None:
        action = sum(trajectory.times[switch] < fault.time for switch in switches)
        return PathReport(Violation(fault.constraint, fault.amount, int(action), fault.time))
    return _walk(world, skeleton, switches, q, trajectory.times)


def switches_of(scene: Scene, skeleton: Skeleton, trajectory: Trajectory) -> list[int] | Violation:
    """Index into ``times`` of every action's switch, from the attachments.

    A violation instead, if the samples have an impossible shape or order, the joints are not
    those that move, an action is not applicable, or the attachments are not those of the skeleton.
    """
    rows = len(trajectory.times)
    if (
        trajectory.q.shape != (rows, len(trajectory.joint_names))
        or not np.isfinite(trajectory.q).all()
        or not np.isfinite(trajectory.times).all()
        or not np.all(np.diff(trajectory.times) > 0)
    ):
        return Violation("samples", 0.0)
    if sorted(trajectory.joint_names) != sorted(scene.robot.description.moving_joints):
        return Violation("joint names", 0.0)
    state = scene.state
    switches: list[int] = []
    for index, action in enumerate(skeleton):
        if action not in applicable_actions(state, scene.symbols):
            return Violation("skeleton", 0.0, index)
        before, state = state, successor(state, action)
        switch = _switch(before, state, trajectory, switches[-1] if switches else 0)
        if switch is None:
            return Violation("attachments", 0.0, index)
        switches.append(switch)
    if any(last > then for last, then in pairwise([0, *switches, rows - 1])) or Counter(
        trajectory.attachments
    ) != Counter(_spans(scene.state, skeleton, switches, rows, _carriers)):
        return Violation("attachments", 0.0, len(skeleton) - 1)
    return switches


def _switch(before: State, after: State, trajectory: Trajectory, last: int) -> int | None:
    """Where an action changes who holds what: as the first attachment starts or one ends there."""
    for box, gripper in sorted(set(after.held) - set(before.held)):
        starts = (a.start for a in trajectory.attachments if (a.box, a.gripper) == (box, gripper))
        return min((start for start in starts if start >= last), default=None)
    for box, gripper in sorted(set(before.held) - set(after.held)):
        ends = (
            attachment.end
            for attachment in trajectory.attachments
            if (attachment.box, attachment.gripper) == (box, gripper) and attachment.start <= last
        )
        return max(ends, default=None)
    return last


def _carriers(state: State) -> dict[str, str]:
    """The gripper that carries each box: held, or standing on what is."""
    return {box: gripper for held, gripper in state.held for box in (held, *state.carried_by(held))}


def _spans(
    state: State,
    skeleton: Skeleton,
    switches: Sequence[int],
    rows: int,
    carriers: Callable[[State], Mapping[str, str]],
) -> Iterator[Attachment]:
    """Which box is with which gripper from when to when, by the skeleton.

    Args:
        state: at the start.
        skeleton: the actions.
        switches: row of each action's switch.
        rows: how many there are.
        carriers: the gripper of each box in a state.
    """
    since: dict[str, tuple[str, int]] = {}
    for action, switch in zip(skeleton, switches, strict=True):
        state = successor(state, action)
        now = carriers(state)
        for box in [box for box, (gripper, _) in since.items() if now.get(box) != gripper]:
            yield Attachment(box, *since.pop(box), switch)
        since |= {box: (gripper, switch) for box, gripper in now.items() if box not in since}
    for box, (gripper, start) in since.items():
        yield Attachment(box, gripper, start, rows - 1)


def _rate_faults(robot: Robot, q: Array, times: Array) -> Violation | None:
    """Position, velocity and acceleration limits of the samples (T, m) of all moving joints."""
    fingers = [arm.fingers for arm in robot.arms.values()]
    ranges = [np.sort(np.outer(hand.ratios, (hand.lower, hand.upper)), axis=1) for hand in fingers]
    lower, upper = np.concatenate([robot.position_limits, *ranges]).T
    speeds = [np.abs(hand.ratios) * hand.velocity for hand in fingers]
    limits = np.concatenate([robot.velocity_limits, *speeds])
    steps = np.diff(times)
    velocity = np.diff(q, axis=0) / steps[:, None]
    speed = np.abs(velocity) / limits
    rate = np.abs(np.diff(velocity, axis=0)) / ((steps[1:] + steps[:-1]) / 2)[:, None]
    effort = rate[:, : len(robot.joint_names)] / robot.acceleration_limits
    for kind, excess in (
        ("joint limit", np.maximum(lower - q, q - upper) - LIMIT_TOLERANCE),
        ("jump", speed - JUMP),
        ("velocity", speed - RATE_TOLERANCE),
        ("acceleration", effort - RATE_TOLERANCE),
    ):
        if excess.size and excess.max() > 0:
            row = int(np.argmax(excess.max(axis=1) > 0))
            joint = int(np.argmax(excess[row]))
            constraint = f"{kind} {robot.moving_joints[joint]}"
            return Violation(constraint, float(excess[row, joint]), time=float(times[row]))
    return None


def _finger_faults(
    scene: Scene, skeleton: Skeleton, switches: Sequence[int], q: Array, times: Array
) -> Violation | None:
    """Fingers of one hand that are not parallel, or not closed on the box they carry."""
    sizes, arms = box_sizes(scene), scene.robot.description.arms
    spans = list(_spans(scene.state, skeleton, switches, len(q), lambda state: dict(state.held)))
    for gripper, arm in arms.items():
        if not arm.fingers.joints:
            continue
        fingers = q[:, arm.fingers.slice] / arm.fingers.ratios
        spread = np.ptp(fingers, axis=1)
        if spread.max() > START:
            time = float(times[np.argmax(spread)])
            return Violation(f"fingers {gripper}", float(spread.max()), time=time)
        held = (span for span in spans if span.gripper == gripper)
        for span in sorted(held, key=lambda span: span.start):
            rows = slice(span.start, span.end + 1)
            width = min(sizes[span.box][:2])
            play = _play(arm, width, q[rows, arm.slice], fingers[rows, 0])
            if play.max() > 0:
                time = float(times[span.start + np.argmax(play)])
                return Violation(f"fingers {gripper}", float(play.max()), time=time)
    return None


def _play(arm: Arm, width: float, q: Array, fingers: Array) -> Array:
    """How far (T,) the fingers are off a box of a width (m) that they carry.

    They may open and close where the box is grasped and let go of: while the arm (T, n) rests there
    at the start and the end.
    """
    closed, loose = arm.fingers.value(width), arm.fingers.value(width + SQUEEZE)
    play = np.abs(fingers - closed) - abs(loose - closed)
    for end in (q[0], q[-1]):
        play[np.abs(q - end).max(axis=1) <= AT_REST] = 0.0
    return play


def _walk(
    world: World, skeleton: Skeleton, switches: list[int], q: Array, times: Array
) -> PathReport:
    """Follow the motion from mode to mode."""
    scene = world.scene
    states = [scene.state]
    for action in skeleton:
        states.append(successor(states[-1], action))
    states.append(states[-1])  # no action ends the last mode
    boxes, before = initial_poses(scene), states[0]
    bounds = [0, *switches, len(times) - 1]
    checked, deepest = 0, 0.0
    for index, (first, last) in enumerate(pairwise(bounds)):
        state, after = states[index], states[index + 1]
        phase = Phase(scene, state, boxes, q[first : last + 1], times[first : last + 1])
        touches, support = phase.touches(before, after), dict(state.support)
        violation = phase.tilt_fault()
        for sample in range(len(phase.q)):
            if violation is not None:
                break
            overlaps = phase.overlaps(world, sample)
            undeclared = [
                overlap
                for overlap in overlaps
                if not declared(overlap, scene.robot.description, touches[sample], support)
            ]
            checked += 1
            if undeclared:
                deepest = max(deepest, undeclared[0].depth)
            if undeclared and undeclared[0].depth > MARGIN:
                worst = undeclared[0]
                constraint = overlap_name(worst.first, worst.second, body_names(scene))
                violation = Violation(constraint, worst.depth, time=float(phase.times[sample]))
        boxes, before = phase.boxes_at(-1), state
        if violation is None:
            faults = _contact_faults(scene, state, after, boxes, phase.tools_at(-1))
            if faults:
                violation = Violation(
                    faults[0].constraint, faults[0].amount, time=float(phase.times[-1])
                )
        if violation is not None:
            number = min(index, len(skeleton) - 1)
            violation = Violation(violation.constraint, violation.amount, number, violation.time)
            return PathReport(violation, checked, deepest)
    return PathReport(None, checked, deepest)


def _contact_faults(
    scene: Scene,
    before: State,
    after: State,
    boxes: Mapping[str, Array],
    tools: Mapping[str, Array],
) -> list[Violation]:
    """Grasps and placements at the end of a phase, of the modes before and after its switch."""
    poses = {name: placement.tolist() for name, placement in boxes.items()}
    sizes, arms = box_sizes(scene), scene.robot.description.arms
    faults = [
        fault
        for box, gripper in dict.fromkeys((*before.held, *after.held))
        for fault in grasp_faults(
            gripper, box, sizes[box], poses[box], tools[gripper].tolist(), arms[gripper].palm_front
        )
    ]
    support = dict(before.support) | dict(after.support)
    return faults + placement_faults(scene, poses, support)
