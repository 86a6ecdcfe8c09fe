"""``hold(gripper, box)``: the gripper is where its grasp of the box wants it.

A grasped box is rigid in the gripper from its grasp on, until it hangs on something else: one
pitch, offset and depth of the hand for the whole mode. The arm's joints are variables of each
configuration, and of the far end of each straight way to it or from it.
"""

from array import array
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cache, lru_cache

import casadi as ca
import numpy as np

from guided_lgp.bounds.checks import Pose, Vector, angle_of, axes_of, closing_axis, dot, offset_of
from guided_lgp.bounds.program.arrays import Variables
from guided_lgp.bounds.program.context import Context, Line
from guided_lgp.bounds.program.draft import Draft
from guided_lgp.bounds.program.geometry import GraspSide
from guided_lgp.bounds.program.grasp import (
    INSET,
    PALM_GAP,
    ROLL,
    Grip,
    Hand,
    grasp_sides,
    read_grip,
    sides_of,
    tool_target,
)
from guided_lgp.bounds.program.kernels import SCALE, Kernel, kernel
from guided_lgp.bounds.program.kinematics import ArmKinematics, Chain, RobotKinematics
from guided_lgp.bounds.program.slots import (
    ArmConfiguration,
    HeldBox,
    PlanarPose,
    StraightSegment,
)
from guided_lgp.bounds.results import Array
from guided_lgp.bounds.terms.term import Term, UngraspableError
from guided_lgp.errors import InputError
from guided_lgp.logic.declarations import Instruction, Variable
from guided_lgp.logic.symbols import GRIPPER
from guided_lgp.poses import compose
from guided_lgp.scene.tolerances import GRASP_ANGLE, GRASP_OFFSET, MARGIN

_FLAT = "_flat"
"""What the names of kernels end with where fingers close on top and bottom."""


def _kernel(chain: Chain, fixed: int, flat: bool) -> Kernel:
    """Tool frame of the arm, rolled where it is ``flat``, = target of the grasp.

    The orientation is written as the whole y axis and the whole direction of gravity, which vanish
    together at the target only.
    """
    n = len(chain.moving)
    x, p = ca.SX.sym("x", n + 7), ca.SX.sym("p", 7 + fixed)
    q, grip, pose, z = x[:n], x[n : n + 3], x[n + 3 : n + 6], x[n + 6]
    side, scene, (z_offset, up) = p[0], p[1 : 1 + fixed], (p[1 + fixed], p[2 + fixed])
    arm = chain.pose(q, side, scene)
    tool = ca.mtimes(arm.rotation, ca.sparsify(ca.SX(ROLL))) if flat else arm.rotation
    grasp = p[3 + fixed : 7 + fixed]
    position, rotation = tool_target(pose, z + z_offset + up, grip, grasp, chain.palm_front)
    c = ca.vertcat(
        SCALE * (arm.position - position),
        tool[:, 1] - rotation[:, 1],
        tool[2, 0] - rotation[2, 0],
        tool[2, 2] - rotation[2, 2],
    )
    twist = ca.mtimes(rotation.T, tool)
    # Rodrigues' vector of the rotation between the two: axis times tan(angle / 2)
    rodrigues = ca.vertcat(
        twist[2, 1] - twist[1, 2], twist[0, 2] - twist[2, 0], twist[1, 0] - twist[0, 1]
    ) / (1 + ca.trace(twist))
    return kernel(
        f"hold_{chain.name}{_FLAT * flat}",
        x,
        p,
        c,
        equality=True,
        lengths=3,
        independent=ca.vertcat(c[:3], rodrigues),
    )


def _kernels(robot: RobotKinematics) -> tuple[Kernel, ...]:
    return tuple(
        _kernel(chain, len(robot.fixed), flat) for flat in (False, True) for chain in robot.chains
    )


def _add(context: Context, gripper: str, box: str) -> None:
    """The arm's configuration at the switch; nothing if it stands there with the box already."""
    pose, standing = context.pose[box], context.standing.get(gripper)
    if standing is None or standing.pose is not pose:
        held, lines = grip(context, gripper, box), context.lines_of(gripper)
        context.acting[gripper] = configuration(context, held, pose, lines)


def grip(context: Context, gripper: str, box: str) -> HeldBox:
    """How the gripper holds the box: as it does already, or a new grasp with its variables.

    Raises:
        UngraspableError: no side of the box is narrow enough for the fingers.
    """
    held = context.hands.get(gripper)
    if held is None:
        held = context.hands[gripper] = _new_grip(context, gripper, box)
        context.grips.append(held)
    return held


def _new_grip(context: Context, gripper: str, box: str) -> HeldBox:
    arm = context.robot.arms[gripper].arm
    sides = grasp_sides(context.geometry, box, arm)
    if not sides:
        narrowest = min(context.geometry.movable[box].grasp_widths)
        raise UngraspableError(context.action, box, narrowest - arm.fingers.grasp_width)
    side = sides[context.side]
    if side.given is not None:
        return _given_grip(context, gripper, box, side, side.given)
    height = context.half(box)[2]
    slide = max(side.half_length, height) - INSET
    deepest = max(PALM_GAP, INSET - arm.palm_front - 2 * min(side.half_length, height))
    return HeldBox(
        gripper,
        box,
        pitch=context.program.variable(0.0, np.pi, 1e-3, np.pi / 2),
        offset=context.program.variable(-slide, slide, 0.05, 0.0),
        depth=context.program.variable(PALM_GAP, max(deepest, -arm.palm_front), 0.05, deepest),
        side=side,
        half_height=height,
        closed=(arm.fingers.widest - arm.fingers.opening_for(side.width)) / 2,
    )


def take_over(context: Context, gripper: str, box: str) -> None:
    """Begin with a box in a hand, which holds it as the scene says.

    Raises:
        InputError: that is none of the ways in which hands hold boxes.
    """
    arm = context.robot.arms[gripper].arm
    body = context.geometry.movable[box]
    half_height, grasp = context.half(box)[2], np.array(body.grasp)
    sides = sides_of(context.geometry, box, arm, grasp)
    found = read_grip(grasp, sides, half_height, arm.palm_front, loosely=bool(body.grasps))
    if found is None:
        accepted = "fingers across upright sides, the body level when the hand points down or ahead"
        raise InputError(f"{box}.grasp", f"{gripper} does not hold the body so", accepted)
    side, given = found
    held = _given_grip(context, gripper, box, replace(side, slack=0.0), given)
    context.hands[gripper] = context.held[box] = held
    context.grips.append(held)
    context.configurations[held] = ()  # until an action adds one
    if context.state.standing_on(box):
        context.standing[gripper] = _at_start(context, held)


def _at_start(context: Context, held: HeldBox) -> ArmConfiguration:
    """The arm that holds out its box at the start, with others on it."""
    arm = context.robot.arms[held.gripper].arm
    values = arm.signs * context.geometry.scene.robot.start[arm.slice]
    joints = tuple(context.program.constant(value) for value in values.tolist())
    return ArmConfiguration(held, context.action, joints, context.pose[held.box])


def _given_grip(context: Context, gripper: str, box: str, side: GraspSide, given: Grip) -> HeldBox:
    """A grasp that leaves nothing to choose, or on top and bottom its depth alone."""
    fingers = context.robot.arms[gripper].arm.fingers
    pitch, offset = (context.program.variable(v, v, 1e-3, v) for v in given[:2])
    deepest, weight = given[2], 0.05 if side.slack else 1e-3
    depth = context.program.variable(deepest, deepest + side.slack, weight, deepest)
    closed = (fingers.widest - fingers.opening_for(side.width)) / 2
    return HeldBox(gripper, box, pitch, offset, depth, side, context.half(box)[2], closed, given)


def configuration(
    context: Context, held: HeldBox, pose: PlanarPose, lines: Iterable[Line] = ()
) -> ArmConfiguration:
    """The arm holds its box at a level pose, and can move along straight lines."""
    joints = _joint_variables(context, held)
    _rows(context, held, joints, pose, 0.0, 0.0)
    segments = []
    for line in lines:
        end = _joint_variables(context, held, contact=joints)
        _rows(context, held, end, pose, line.back, line.up)
        segments.append(StraightSegment(end, line.back, line.up))
    added = ArmConfiguration(held, context.action, joints, pose, tuple(segments))
    context.configurations[held] = (*context.configurations.get(held, ()), added)
    context.added.append(added)
    return added


def _joint_variables(
    context: Context, held: HeldBox, contact: tuple[int, ...] | None = None
) -> tuple[int, ...]:
    """Slots of an arm's joints; at the end of a segment, the redundant one is the contact's."""
    arm = context.robot.arms[held.gripper]
    shared = None if contact is None else arm.arm.redundant
    own = tuple(context.program.variables(_joints(arm, shared)))
    if contact is None or shared is None:
        return own
    return (*own[:shared], contact[shared], *own[shared:])


@cache
def _joints(arm: ArmKinematics, without: int | None) -> Variables:
    """The variables of a configuration, but for one joint."""
    kept = [i for i in range(len(arm.home)) if i != without]
    lower, upper = (array("d", [arm.limits[i][end] for i in kept]) for end in (0, 1))
    weight, target = array("d", [1e-3] * len(kept)), array("d", [arm.home[i] for i in kept])
    return Variables(lower, upper, weight, target)


def _rows(
    context: Context,
    held: HeldBox,
    joints: tuple[int, ...],
    pose: PlanarPose,
    back: float,
    up: float,
) -> None:
    arm = context.robot.arms[held.gripper]
    grasp = (held.side.half_length, held.half_height, held.side.turn, back)
    context.rows(
        f"hold_{arm.chain.name}{_FLAT * held.side.flat}",
        (*joints, *held.grip, *pose.plane, pose.z),
        (*context.arm_parameters(arm), pose.offset, up, *grasp),
        ("hold", held.gripper, held.box),
    )


# starts


def start(draft: Draft, held: HeldBox) -> None:
    """Choose one pitch for a mode and the joints of its configurations."""
    configurations = draft.configurations[held]
    if all(configuration.joints[0] < draft.kept for configuration in configurations):
        return
    tried = _pitches(draft, held)
    if held.given is None and held.pitch >= draft.kept:
        if draft.noise:
            tried = tried + draft.noise * draft.generator.uniform(-_PITCH_SPREAD, _PITCH_SPREAD)
        costs = sum(
            _least_costs(draft, held, _place(draft, configuration), configuration.segments, tried)
            for configuration in configurations
        )
        tried = tried[[draft.choose(np.asarray(costs)[0])]]
        draft.values[held.pitch] = tried[0]
    for configuration in configurations:
        if configuration.joints[0] >= draft.kept:
            place, ends = _place(draft, configuration), _ends(configuration.segments)
            hold = draft.ik[held.gripper].hold
            joints = hold(held, _hand(draft, held), place, tried, ends, draft.extra)
            slots = (configuration.joints, *(s.joints for s in configuration.segments))
            draft.values[np.array(slots)] = joints


def costs_of_both(
    draft: Draft, held: HeldBox, poses: Array, segments: tuple[StraightSegment, ...]
) -> Array:
    """Least costs (len(poses),) of holding a box at the start of its mode and at one of the poses.

    Where there is one pitch alone, the start costs the same for all, and is left out.
    """
    tried = _pitches(draft, held)
    costs = _least_costs(draft, held, poses, segments, tried)
    if len(tried) > 1:
        first = draft.configurations[held][0]
        costs = _least_costs(draft, held, _place(draft, first), first.segments, tried) + costs
    return np.asarray(costs.min(axis=1))


def _pitches(draft: Draft, held: HeldBox) -> Array:
    """Pitches (rad) that are tried: the one of before where there is one."""
    if held.given is not None or held.pitch < draft.kept:
        return draft.values[[held.pitch]]
    return _PITCHES


def _place(draft: Draft, configuration: ArmConfiguration) -> Array:
    """Pose (1, 4) of the box in a configuration."""
    return np.array([draft.place(configuration.pose)])


def _least_costs(
    draft: Draft,
    held: HeldBox,
    poses: Array,
    segments: tuple[StraightSegment, ...],
    tried: Array,
) -> Array:
    """Least cost (len(poses), len(pitches)) of holding a box there, over the redundant joint."""
    hand, ends = _hand(draft, held), _ends(segments)
    return draft.ik[held.gripper].least_costs(held, hand, poses, tried, ends)


def _hand(draft: Draft, held: HeldBox) -> Hand:
    return float(draft.values[held.offset]), float(draft.values[held.depth])


def _ends(segments: tuple[StraightSegment, ...]) -> Array:
    """How far (1 + segments, 2) back and up the hand is, the contact first."""
    return _ends_of(tuple((segment.back, segment.up) for segment in segments))


@lru_cache(maxsize=64)
def _ends_of(lines: tuple[tuple[float, float], ...]) -> Array:
    return np.array([(0.0, 0.0), *lines])


_PITCHES = np.pi * np.array([0.2, 0.35, 0.5, 0.65, 0.8])
"""Pitches (rad) of the approach that are tried, from one end of the box over the top."""
_PITCH_SPREAD = 0.4
"""How far (rad) they are moved in a start with noise: to the middle between two."""


# check


def check(size: Vector, placement: Pose, tool: Pose, palm_front: float, widest: float) -> float:
    """By how much (m or rad) a hand is not where it holds a box: negative where it is.

    The fingers close on two sides of the box that are not too far apart, the box is in the middle
    between them, and the palm is outside of it.

    Args:
        size: extents (m) of the box.
        placement: its pose.
        tool: pose of the gripper's tool frame.
        palm_front: x of the palm's front in the tool frame (m).
        widest: side (m) that the hand can take.
    """
    approach, closing, _ = axes_of(tool)
    sides, offset = axes_of(placement), offset_of(tool, placement)
    reach = dot(offset, approach)
    for axis in range(3):
        reach -= size[axis] / 2 * abs(dot(approach, sides[axis]))
    across = closing_axis(placement, tool)
    return max(
        angle_of(abs(dot(closing, sides[across]))) - GRASP_ANGLE,
        abs(dot(offset, closing)) - GRASP_OFFSET,
        palm_front - MARGIN - reach,
        size[across] - widest,
    )


def check_given(placement: Pose, tool: Pose, given: Array) -> float:
    """By how much (m or rad) a hand is at none of the given grasps: negative where it is at one.

    Args:
        placement: pose of the box.
        tool: pose of the gripper's tool frame.
        given: (n, 7) poses of the tool frame in the box's.
    """
    there, now = compose(np.asarray(placement), given), np.asarray(tool)
    way = np.linalg.norm(there[:, :3] - now[:3], axis=1)
    turn = 2 * np.arccos(np.minimum(np.abs(there[:, 3:] @ now[3:]), 1.0))
    return float(np.maximum(way - GRASP_OFFSET, turn - GRASP_ANGLE).min())


def _needed(one: Instruction) -> Iterator[tuple[Variable, ...]]:
    """Of every hand that the body leaves or comes into: at the switch it is in both."""
    if one.holder is not None:
        yield one.holder, one.attached.body
    if one.into_hand:
        yield one.attached.parent, one.attached.body


TERM = Term(_add, _kernels, attaches=GRIPPER, needed=_needed)
