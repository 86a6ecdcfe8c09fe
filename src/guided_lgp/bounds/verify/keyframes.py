"""Verification of keyframes."""

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import lru_cache
from weakref import WeakKeyDictionary

import numpy as np

from guided_lgp.bounds.checks import (
    Violation,
    body_names,
    box_bodies,
    closing_axis,
    given_grasps,
    overlap_name,
)
from guided_lgp.bounds.results import Array, Keyframe
from guided_lgp.bounds.terms import carried
from guided_lgp.bounds.terms.balanced import whole_stack
from guided_lgp.bounds.terms.carried import relative
from guided_lgp.bounds.verify.efforts import Load, overloads
from guided_lgp.bounds.verify.geometry import (
    NOTHING,
    Stack,
    declared,
    grasp_faults,
    placement_faults,
    stacks,
)
from guided_lgp.logic import Action, Skeleton, State, progress, successor
from guided_lgp.robots import Fingers, Robot
from guided_lgp.scene import Scene
from guided_lgp.scene.world import World, at_side, poses_at_side

LIMIT_TOLERANCE = 1e-6


def verify_keyframe(
    world: World, keyframe: Keyframe, state: State, action: Action | None = None
) -> list[Violation]:
    """Check one configuration.

    Args:
        world: of the scene.
        keyframe: arms and boxes.
        state: who holds what and what stands where; with an action, before it.
        action: for a contact keyframe, the action whose switch it is: the box is where it
            changes over. Hands that close or open then are checked open around the box, as they
            are shortly before a grasp and after a place.

    Returns:
        What is violated; nothing if the keyframe is good.
    """
    (reached,) = _reached(world.scene, [keyframe])
    after = state if action is None else successor(state, action)
    return _faults(world, reached, state, after)


def _faults(
    world: World,
    reached: "_Reached",
    state: State,
    after: State,
    good: Mapping[str, Stack] = NOTHING,
) -> list[Violation]:
    """What is violated in a keyframe, at a switch from one state to another, or else in one state.

    Some stacks have been found good before.
    """
    if not reached.is_finite:
        return [Violation("finite pose", math.nan)]
    held = tuple(dict.fromkeys((*state.held, *after.held)))
    support = dict(state.support) | dict(after.support)
    convex, robot = box_bodies(world.scene), world.scene.robot.description
    given, fingers = given_grasps(world.scene), dict[str, float]()
    boxes, violations = reached.boxes, joint_limit_faults(robot, reached.keyframe.q)
    for box, gripper in held:
        arm, tool = robot.arms[gripper], reached.tools[gripper]
        width = convex[box].size[closing_axis(boxes[box], tool)]
        keeps = (box, gripper) in state.held and (box, gripper) in after.held
        fingers[gripper] = _finger_value(arm.fingers, width, keeps)
        violations += grasp_faults(arm, box, convex[box], boxes[box], tool, given.get(box))
    reached.stacks = stacks(boxes, support)
    changed = [box for box, stack in reached.stacks.items() if good.get(box) != stack]
    violations += placement_faults(world.scene, boxes, support, changed)
    violations += _effort_faults(world.scene, reached, held, support)
    world.set(reached.keyframe.q, reached.boxes, fingers)
    bodies = body_names(world.scene)
    violations += [
        Violation(overlap_name(overlap.first, overlap.second, bodies), overlap.depth)
        for overlap in world.penetrations(touching=support.items())
        if not declared(overlap, robot, held, support)
    ]
    return violations


def verify_keyframes(
    world: World,
    skeleton: Skeleton,
    at_switch: Sequence[Keyframe],
    after_action: Sequence[Keyframe],
    verified: int = 0,
) -> Violation | None:
    """Check the keyframes of a skeleton, in the order in which they are reached.

    Besides each keyframe alone: a held box is rigid in its gripper's tool frame and a standing
    box rigid on its support, from each keyframe to the next.

    Args:
        world: of the scene.
        skeleton: the actions.
        at_switch: one keyframe per action, at its switch.
        after_action: one keyframe per action, after it.
        verified: how many actions, the first ones, were checked before with these keyframes.

    Returns:
        The first violation with its action, or None.
    """
    state = progress(world.scene.state, skeleton[:verified])
    last = _last_before(world.scene, after_action[:verified])
    pairs = zip(at_switch[verified:], after_action[verified:], strict=True)
    frames = iter(_reached(world.scene, [frame for pair in pairs for frame in pair]))
    for index, action in enumerate(skeleton[verified:], verified):
        after = successor(state, action)
        for modes in (state, after):
            reached = next(frames)
            found = _faults(world, reached, modes, after, last.stacks)
            found = found or _slips(last, reached, modes)
            if found:
                return Violation(found[0].constraint, found[0].amount, index)
            last = reached
        state, _REACHED[last.keyframe] = after, last
    return None


def _last_before(scene: Scene, after_action: Sequence[Keyframe]) -> "_Reached":
    """The last keyframe that was checked before, or else the start."""
    if not after_action:
        start = Keyframe(at_side(scene), poses_at_side(scene))
        return _reached(scene, [start])[0]
    return _REACHED.get(after_action[-1]) or _reached(scene, after_action[-1:])[0]


@lru_cache(maxsize=1024)
def _finger_value(fingers: Fingers, width: float, closed: bool) -> float:
    """Where the fingers of a hand are (rad or m) on a box of a width (m), or open around it."""
    return fingers.value(width) if closed else fingers.value_around(width)


def joint_limit_faults(robot: Robot, q: Array) -> list[Violation]:
    """Joints of a configuration (n,) outside their limits."""
    bounds = zip(_limits(robot), q.tolist(), strict=True)
    excess = [max(low - value, value - high) for (low, high), value in bounds]
    return [
        Violation(f"joint limit {robot.joint_names[index]}", beyond)
        for index, beyond in enumerate(excess)
        if not beyond <= LIMIT_TOLERANCE  # also if not a number
    ]


@lru_cache(maxsize=8)
def _limits(robot: Robot) -> list[list[float]]:
    """In plain numbers, which is many times faster for one configuration."""
    limits: list[list[float]] = robot.position_limits.tolist()
    return limits


def _effort_faults(
    scene: Scene,
    reached: "_Reached",
    held: Iterable[tuple[str, str]],
    support: Mapping[str, str],
) -> list[Violation]:
    """Joints whose motor is too weak to rest in a keyframe."""
    loads = (
        Load(gripper, name, np.array(relative(reached.boxes[name], reached.tools[gripper])[0]))
        for box, gripper in held
        for name in whole_stack(box, support)
    )
    return overloads(scene, reached.keyframe.q[None], loads)


class _Reached:
    """A keyframe, and where boxes and tools are then, in plain numbers."""

    def __init__(self, keyframe: Keyframe, tools: dict[str, list[float]]) -> None:
        self.keyframe, self.tools = keyframe, tools
        self.boxes = {name: placement.tolist() for name, placement in keyframe.boxes.items()}
        self.is_finite = math.isfinite(sum(map(sum, self.boxes.values())))
        self.stacks = NOTHING
        """Those that have been looked at."""

    def carrier(self, name: str) -> list[float] | None:
        """The pose of a tool or box; of what never moves, none."""
        return self.tools.get(name) or self.boxes.get(name)


def _reached(scene: Scene, keyframes: Sequence[Keyframe]) -> list[_Reached]:
    """Of all keyframes at once, where the tools are."""
    poses = scene.robot.tool_poses(np.array([keyframe.q for keyframe in keyframes]))
    tools = {gripper: rows.tolist() for gripper, rows in poses.items()}
    return [
        _Reached(keyframe, {gripper: rows[number] for gripper, rows in tools.items()})
        for number, keyframe in enumerate(keyframes)
    ]


_REACHED: WeakKeyDictionary[Keyframe, _Reached] = WeakKeyDictionary()
"""What has been found good after an action and may be gone on from."""


def _slips(last: _Reached, reached: _Reached, state: State) -> list[Violation]:
    """Boxes that moved relative to what holds or supports them in this mode."""
    found = []
    for box, carrier in (*state.held, *state.support):
        before = last.boxes[box], last.carrier(carrier)
        now = reached.boxes[box], reached.carrier(carrier)
        amount = 0.0 if before == now else carried.check(relative(*before), relative(*now))
        if amount > 0:
            found.append(Violation(f"carried {box} {carrier}", amount))
    return found
