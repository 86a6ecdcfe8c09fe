"""Verification of paths."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, product, zip_longest

import numpy as np

from guided_lgp.bounds.results import JOINT_NAMES, Array, Attachment, Trajectory
from guided_lgp.bounds.verify.geometry import (
    CARRY_ANGLE,
    Violation,
    box_sizes,
    declared,
    grasp_faults,
    placement_faults,
)
from guided_lgp.bounds.verify.keyframes import LIMIT_TOLERANCE
from guided_lgp.logic import Action, Skeleton, State, applicable_actions, successor
from guided_lgp.poses import apply, compose, inverse, tilt
from guided_lgp.scene import GRIPPERS, Scene, pr2
from guided_lgp.scene.world import MARGIN, Penetration, World, initial_poses

STEP = 0.01
"""Longest way (m) that any point of robot or load goes between two checked configurations."""
APPROACH = 0.12
"""The hand may touch a box that it does not hold while its tool frame is this near (m) to where
it grasps or places it."""
RATE_TOLERANCE = 1.02
"""Factor on velocity and acceleration limits, for finite differences."""
JUMP = 3.0
"""A joint that is faster than this multiple of its limit jumps."""
START = 1e-3
"""How far (rad) the first configuration may be off both arms at their side."""
SQUEEZE = 0.004
"""How far (m) the fingers' opening may be off the width of the box they carry."""
AT_REST = 1e-3
"""How far (rad) the joints of an arm move at most while its fingers open or close."""
_HAND_RADIUS = 0.12
"""Reach (m) of the open hand beyond its tool frame, sideways."""
_LINK_RADIUS = 0.12
"""Reach (m) of the upper arm and the forearm beyond their axes."""
_COARSE_STEP = 0.02
"""Longest way (m), by the levers' bound, between samples at which ways are measured."""
_FINGER_LEVER = 0.10
_CORNERS = np.array(list(product((-1.0, 1.0), repeat=3)))


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

    The motion starts with both arms at their side and the boxes where the scene has them. It
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
    columns = [trajectory.joint_names.index(name) for name in JOINT_NAMES]
    q = trajectory.q[:, columns]
    fault = _rate_faults(q, trajectory.times) or _finger_faults(
        world.scene, skeleton, switches, q, trajectory.times
    )
    if fault is None and np.abs(q[0, :14] - pr2.HOME_CONFIGURATION).max() > START:
        fault = Violation("start", float(np.abs(q[0, :14] - pr2.HOME_CONFIGURATION).max()), 0, 0.0)
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
    if sorted(trajectory.joint_names) != sorted(JOINT_NAMES):
        return Violation("joint names", 0.0)
    state = scene.state
    held: dict[str, Attachment] = {}
    switches: list[int] = []
    for index, action in enumerate(skeleton):
        if action not in applicable_actions(state, scene.symbols):
            return Violation("skeleton", 0.0, index)
        state = successor(state, action)
        if action.instruction == "grasp":
            later = [
                attachment
                for attachment in trajectory.attachments
                if (attachment.box, attachment.gripper) == (action.box, action.gripper)
                and attachment.start >= (switches[-1] if switches else 0)
            ]
            if not later:
                return Violation("attachments", 0.0, index)
            held[action.box] = min(later, key=lambda attachment: attachment.start)
            switches.append(held[action.box].start)
        else:
            switches.append(held.pop(action.box).end)
    if any(last > then for last, then in pairwise([0, *switches, rows - 1])) or Counter(
        trajectory.attachments
    ) != Counter(_attachments(scene.state, skeleton, switches, rows)):
        return Violation("attachments", 0.0, len(skeleton) - 1)
    return switches


def _attachments(
    state: State, skeleton: Skeleton, switches: Sequence[int], rows: int
) -> Iterator[Attachment]:
    """Those of the skeleton: the held boxes, and all that stands on them."""
    since: dict[str, tuple[str, int]] = {}
    for action, switch in zip(skeleton, switches, strict=True):
        state = successor(state, action)
        carriers = {
            box: gripper for held, gripper in state.held for box in (held, *state.carried_by(held))
        }
        for box in [box for box, (gripper, _) in since.items() if carriers.get(box) != gripper]:
            yield Attachment(box, *since.pop(box), switch)
        since |= {box: (gripper, switch) for box, gripper in carriers.items() if box not in since}
    for box, (gripper, start) in since.items():
        yield Attachment(box, gripper, start, rows - 1)


def _rate_faults(q: Array, times: Array) -> Violation | None:
    """Position, velocity and acceleration limits of the samples (T, 22)."""
    lower = np.r_[pr2.JOINT_LIMITS[:, 0], np.full(8, pr2.FINGER_LIMITS[0])]
    upper = np.r_[pr2.JOINT_LIMITS[:, 1], np.full(8, pr2.FINGER_LIMITS[1])]
    limits = np.r_[pr2.VELOCITY_LIMITS, np.full(8, pr2.FINGER_VELOCITY)]
    steps = np.diff(times)
    velocity = np.diff(q, axis=0) / steps[:, None]
    speed = np.abs(velocity) / limits
    rate = np.abs(np.diff(velocity, axis=0)) / ((steps[1:] + steps[:-1]) / 2)[:, None]
    effort = rate[:, :14] / pr2.ACCELERATION_LIMITS
    for kind, excess in (
        ("joint limit", np.maximum(lower - q, q - upper) - LIMIT_TOLERANCE),
        ("jump", speed - JUMP),
        ("velocity", speed - RATE_TOLERANCE),
        ("acceleration", effort - RATE_TOLERANCE),
    ):
        if excess.size and excess.max() > 0:
            row = int(np.argmax(excess.max(axis=1) > 0))
            joint = int(np.argmax(excess[row]))
            constraint = f"{kind} {JOINT_NAMES[joint]}"
            return Violation(constraint, float(excess[row, joint]), time=float(times[row]))
    return None


def _finger_faults(
    scene: Scene, skeleton: Skeleton, switches: Sequence[int], q: Array, times: Array
) -> Violation | None:
    """Fingers of one hand that are not parallel, or not closed on the box they carry."""
    sizes = box_sizes(scene)
    for number, gripper in enumerate(GRIPPERS):
        fingers = q[:, 14 + 4 * number : 18 + 4 * number]
        spread = np.ptp(fingers, axis=1)
        if spread.max() > START:
            time = float(times[np.argmax(spread)])
            return Violation(f"fingers {gripper}", float(spread.max()), time=time)
        arm = q[:, pr2.arm_slice(gripper)]
        turns = [index for index, action in enumerate(skeleton) if action.gripper == gripper]
        for grasp, place in zip_longest(turns[::2], turns[1::2]):
            start = switches[grasp]
            end = len(q) - 1 if place is None else switches[place]
            rows = slice(start, end + 1)
            at_grasp = np.abs(arm[rows] - arm[start]).max(axis=1) <= AT_REST
            at_place = np.abs(arm[rows] - arm[end]).max(axis=1) <= AT_REST
            width = min(sizes[skeleton[grasp].box][:2])
            target = pr2.finger_joint(width), pr2.finger_joint(width + SQUEEZE)
            play = np.abs(fingers[rows, 0] - target[0]) - (target[1] - target[0])
            play[at_grasp | at_place] = 0.0
            if play.max() > 0:
                time = float(times[start + np.argmax(play)])
                return Violation(f"fingers {gripper}", float(play.max()), time=time)
    return None


def _walk(
    world: World, skeleton: Skeleton, switches: list[int], q: Array, times: Array
) -> PathReport:
    """Follow the motion from mode to mode."""
    scene = world.scene
    sizes = box_sizes(scene)
    state, boxes = scene.state, initial_poses(scene)
    bounds = [0, *switches, len(times) - 1]
    checked, deepest = 0, 0.0
    for index, (first, last) in enumerate(pairwise(bounds)):
        action = skeleton[index] if index < len(skeleton) else None
        previous = skeleton[index - 1] if index else None
        phase = _Phase(scene, state, boxes, q[first : last + 1], times[first : last + 1])
        touches, support = phase.touches(previous, action), dict(state.support)
        violation = phase.tilt_fault()
        for sample in range(len(phase.q)):
            if violation is not None:
                break
            overlaps = phase.overlaps(world, sample)
            undeclared = [o for o in overlaps if not declared(o, touches[sample], support)]
            checked += 1
            if undeclared:
                deepest = max(deepest, undeclared[0].depth)
            if undeclared and undeclared[0].depth > MARGIN:
                worst = undeclared[0]
                constraint = f"collision {worst.first} {worst.second}"
                violation = Violation(constraint, worst.depth, time=float(phase.times[sample]))
        boxes = phase.boxes_at(-1)
        if violation is None:
            after = state if action is None else successor(state, action)
            faults = _contact_faults(scene, state, after, boxes, phase.tools_at(-1), sizes)
            state = after
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
    sizes: Mapping[str, tuple[float, float, float]],
) -> list[Violation]:
    """Grasps and placements at the end of a phase, of the modes before and after its switch."""
    poses = {name: placement.tolist() for name, placement in boxes.items()}
    held = dict(before.held) | dict(after.held)
    faults = [
        fault
        for box, gripper in held.items()
        for fault in grasp_faults(box, sizes[box], poses[box], tools[gripper].tolist())
    ]
    support = dict(before.support) | dict(after.support)
    return faults + placement_faults(scene, poses, support)


class _Phase:
    """The motion in one mode, in steps of at most ``STEP``, and the boxes along it."""

    def __init__(
        self, scene: Scene, state: State, boxes: Mapping[str, Array], q: Array, times: Array
    ) -> None:
        self._state = state
        self._start = dict(boxes)
        tools = pr2.tool_poses(scene, q[:1, :14])
        self._grips: dict[str, tuple[str, Array]] = {}
        for held, gripper in state.held:
            for box in (held, *state.carried_by(held)):
                self._grips[box] = gripper, compose(inverse(tools[gripper][0]), boxes[box])
        reach = dict.fromkeys(GRIPPERS, _HAND_RADIUS)
        sizes = box_sizes(scene)
        for box, (gripper, grip) in self._grips.items():
            corners = apply(grip, np.array(sizes[box]) / 2 * _CORNERS)
            reach[gripper] = max(reach[gripper], float(np.linalg.norm(corners, axis=1).max()))
        self.q, self.times = resample(scene, q, times, [reach[gripper] for gripper in GRIPPERS])
        self._tools = pr2.tool_poses(scene, self.q[:, :14])
        self._moving = {
            box: compose(self._tools[gripper], grip) for box, (gripper, grip) in self._grips.items()
        }

    def boxes_at(self, sample: int) -> dict[str, Array]:
        """Pose (7,) of every box."""
        return self._start | {box: poses[sample] for box, poses in self._moving.items()}

    def overlaps(self, world: World, sample: int) -> list[Penetration]:
        """What the world finds at a sample, whatever its depth, deepest first."""
        fingers = dict(zip(GRIPPERS, self.q[sample, 14::4].tolist(), strict=True))
        boxes = {box: poses[sample] for box, poses in self._moving.items()}
        world.set(self.q[sample, :14], boxes if sample else self.boxes_at(0), fingers)
        return world.penetrations(0.0)

    def tools_at(self, sample: int) -> dict[str, Array]:
        """Pose (7,) of both tool frames."""
        return {gripper: poses[sample] for gripper, poses in self._tools.items()}

    def touches(self, previous: Action | None, action: Action | None) -> list[dict[str, str]]:
        """For each sample, which gripper may touch which box."""
        touches = [dict(self._state.held) for _ in self.q]
        for switch, end in ((previous, 0), (action, -1)):
            if switch is not None:
                path = self._tools[switch.gripper][:, :3]
                near = np.linalg.norm(path - path[end], axis=1) <= APPROACH
                for sample in np.flatnonzero(near):
                    touches[sample][switch.box] = switch.gripper
        return touches

    def tilt_fault(self) -> Violation | None:
        """A box that carries others, or is carried, must stay level."""
        for held, _ in self._state.held:
            if self._state.standing_on(held):
                tilted = tilt(self._moving[held])
                if tilted.max() > CARRY_ANGLE:
                    time = float(self.times[np.argmax(tilted > CARRY_ANGLE)])
                    return Violation(f"level {held}", float(tilted.max()), time=time)
        return None


def resample(scene: Scene, q: Array, times: Array, reach: Sequence[float]) -> tuple[Array, Array]:
    """Walk along samples so that no point of robot or load moves more than ``STEP`` between two.

    Args:
        scene: gives the base and the torso.
        q: (T, 22) both arms and all fingers (rad).
        times: (T,) s.
        reach: how far (m) each hand and its load extend beyond the tool frame.

    Returns:
        the new samples (n, 22) and their times (n,).
    """
    turns = np.abs(np.diff(q, axis=0))
    arms = list(map(pr2.arm_slice, GRIPPERS))
    bounds = [
        turns[:, arm] @ (pr2.LEVER[arm] + beyond) for arm, beyond in zip(arms, reach, strict=True)
    ]
    samples = np.column_stack([q, times])
    samples = _at_steps(samples, np.max(bounds, axis=0), _COARSE_STEP)
    fingers = _FINGER_LEVER * np.abs(np.diff(samples[:, 14:22], axis=0)).max(axis=1)
    ways = [
        _longest_ways(scene, samples[:, :14], gripper, beyond)
        for gripper, beyond in zip(GRIPPERS, reach, strict=True)
    ]
    samples = _at_steps(samples, np.max(ways, axis=0) + fingers, STEP)
    return samples[:, :-1], samples[:, -1]


def _longest_ways(scene: Scene, q: Array, gripper: str, reach: float) -> Array:
    """How far (T - 1,) any point of one arm or its load goes at most between samples (T, 14)."""
    if not np.ptp(q[:, pr2.arm_slice(gripper)], axis=0).any():
        return np.zeros(len(q) - 1)
    poses = pr2.link_poses(scene, q, _frames(gripper))
    shifts = np.linalg.norm(np.diff(poses[..., :3], axis=0), axis=-1)
    cosines = np.abs(np.sum(poses[1:, :, 3:] * poses[:-1, :, 3:], axis=-1))
    angles = 2 * np.arccos(np.minimum(cosines, 1.0))
    return np.asarray((shifts + angles * (_LINK_RADIUS, _LINK_RADIUS, reach)).max(axis=1))


def _frames(gripper: str) -> tuple[str, str, str]:
    """Elbow, wrist and tool: the ends of upper arm, forearm and hand."""
    side = pr2.SIDE[gripper]
    return f"{side}_elbow_flex_link", f"{side}_wrist_flex_link", pr2.TOOL_LINK[gripper]


def _at_steps(samples: Array, ways: Array, step: float) -> Array:
    """The polyline (T, d) anew, at equal steps of at most ``step`` along ways (T - 1,)."""
    way = np.r_[0.0, np.cumsum(ways)]
    marks = np.linspace(0.0, way[-1], int(np.ceil(way[-1] / step)) + 1)
    fine = np.stack([np.interp(marks, way, column) for column in samples.T], axis=1)
    fine[0], fine[-1] = samples[0], samples[-1]
    return fine
