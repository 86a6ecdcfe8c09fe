"""Verification of keyframes."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from itertools import accumulate, pairwise
from operator import le
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
from guided_lgp.bounds.verify.certified import KeyframeCertificate
from guided_lgp.bounds.verify.efforts import Load, overloads
from guided_lgp.bounds.verify.geometry import (
    NOTHING,
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

_Pair = tuple[str, str]
"""A box and a gripper."""
_Grip = tuple[list[float], list[float]]
"""Poses of both."""


class _Site:
    """A scene, and what checks ask of it again and again: its hash takes longer than an answer."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.robot = scene, scene.robot.description
        self.kinematics = scene.robot.mounted
        self.bodies, self.given = box_bodies(scene), given_grasps(scene)
        self.certificate = KeyframeCertificate(scene)

    @cached_property
    def start(self) -> "_Reached":
        """Before the first action."""
        start = Keyframe(at_side(self.scene), poses_at_side(self.scene))
        return _reached(self, [start], [(self.scene.state, self.scene.state)])[0]


@lru_cache(maxsize=8)
def _site(scene: Scene) -> _Site:
    """It takes some milliseconds to make."""
    return _Site(scene)


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
    after = state if action is None else successor(state, action)
    site = _site(world.scene)
    (reached,) = _reached(site, [keyframe], [(state, after)])
    (clear,) = site.certificate.clear([reached])
    return _faults(site, reached, None if clear else world)


def _faults(
    site: _Site, reached: "_Reached", world: World | None, last: "_Reached | None" = None
) -> list[Violation]:
    """What is violated in a keyframe; without a world, it is certain that nothing collides.

    What is as it was in the last keyframe has been found good there.
    """
    if not reached.is_finite:
        return [Violation("finite pose", math.nan)]
    violations = joint_limit_faults(site.robot, reached.keyframe.q)
    violations += _grasp_faults(site, reached, {} if last is None else last.grips)
    good = NOTHING if last is None else last.stacks
    reached.stacks = stacks(reached.boxes, reached.support)
    changed = [box for box, stack in reached.stacks.items() if good.get(box) != stack]
    if changed:
        violations += placement_faults(site.scene, reached.boxes, reached.support, changed)
    violations += _effort_faults(site, reached)
    return violations if world is None else violations + _collisions(world, reached)


def _grasp_faults(site: _Site, reached: "_Reached", good: Mapping[_Pair, _Grip]) -> list[Violation]:
    """Hands that do not hold their boxes; some grips have been found good before."""
    reached.grips = {
        pair: (reached.boxes[pair[0]], reached.tools[pair[1]]) for pair in reached.held
    }
    changed = [pair for pair, grip in reached.grips.items() if good.get(pair) != grip]
    return [
        fault
        for box, gripper in changed
        for fault in grasp_faults(
            site.robot.arms[gripper],
            box,
            site.bodies[box],
            *reached.grips[box, gripper],
            site.given.get(box),
        )
    ]


def _collisions(world: World, reached: "_Reached") -> list[Violation]:
    """What PyBullet finds in something else in a keyframe, deepest first."""
    robot, bodies = world.scene.robot.description, body_names(world.scene)
    world.set(reached.keyframe.q, reached.boxes, reached.fingers)
    return [
        Violation(overlap_name(overlap.first, overlap.second, bodies), overlap.depth)
        for overlap in world.penetrations(touching=reached.support.items())
        if not declared(overlap, robot, reached.held, reached.support)
    ]


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
    site = _site(world.scene)
    last = _last_before(site, skeleton[:verified], after_action[:verified])
    states = list(accumulate(skeleton[verified:], successor, initial=last.after))
    frames = [f for pair in zip(at_switch, after_action, strict=True) for f in pair][2 * verified :]
    modes = [(state, after) for before, after in pairwise(states) for state in (before, after)]
    reached = _reached(site, frames, modes)
    clear = site.certificate.clear(reached)
    for number, (now, is_clear) in enumerate(zip(reached, clear, strict=True)):
        found = _faults(site, now, None if is_clear else world, last) or _slips(last, now)
        if found:
            return replace(found[0], action=verified + number // 2)
        last = now
        if number % 2:
            _REACHED[now.keyframe] = skeleton[: verified + number // 2 + 1], now
    return None


def _last_before(site: _Site, skeleton: Skeleton, after_action: Sequence[Keyframe]) -> "_Reached":
    """The last keyframe that was checked before, after some actions, or else the start."""
    if not after_action:
        return site.start
    actions, reached = _REACHED.get(after_action[-1], (None, None))
    if reached is not None and actions == skeleton:
        return reached
    state = progress(site.scene.state, skeleton)
    return _reached(site, after_action[-1:], [(state, state)])[0]


@lru_cache(maxsize=1024)
def _finger_value(fingers: Fingers, width: float, closed: bool) -> float:
    """Where the fingers of a hand are (rad or m) on a box of a width (m), or open around it."""
    return fingers.value(width) if closed else fingers.value_around(width)


def joint_limit_faults(robot: Robot, q: Array) -> list[Violation]:
    """Joints of a configuration (n,) outside their limits."""
    values, (lowest, highest) = q.tolist(), _limits(robot)
    if all(map(le, lowest, values)) and all(map(le, values, highest)):
        return []
    bounds = zip(lowest, values, highest, strict=True)
    excess = [max(low - value, value - high) for low, value, high in bounds]
    return [
        Violation(f"joint limit {robot.joint_names[index]}", beyond)
        for index, beyond in enumerate(excess)
        if not beyond <= LIMIT_TOLERANCE  # also if not a number
    ]


@lru_cache(maxsize=8)
def _limits(robot: Robot) -> list[list[float]]:
    """Lowest and highest, in plain numbers, which is many times faster for one configuration."""
    limits: list[list[float]] = robot.position_limits.T.tolist()
    return limits


def _effort_faults(site: _Site, reached: "_Reached") -> list[Violation]:
    """Joints whose motor is too weak to rest in a keyframe."""
    loads = (
        Load(gripper, name, np.array(relative(reached.boxes[name], reached.tools[gripper])[0]))
        for box, gripper in reached.held
        for name in whole_stack(box, reached.support)
    )
    return overloads(site.scene, reached.keyframe.q[None], loads)


class _Reached:
    """A keyframe at a switch from one state to another, or in one, in plain numbers."""

    def __init__(
        self,
        site: _Site,
        keyframe: Keyframe,
        tools: dict[str, list[float]],
        state: State,
        after: State,
    ) -> None:
        self.keyframe, self.tools, self.state, self.after = keyframe, tools, state, after
        self.boxes = {name: placement.tolist() for name, placement in keyframe.boxes.items()}
        self.is_finite = math.isfinite(sum(map(sum, self.boxes.values())))
        self.held = tuple(dict.fromkeys((*state.held, *after.held)))
        self.support = dict(state.support) | dict(after.support)
        self.stacks, self.grips = NOTHING, dict[_Pair, _Grip]()
        """Those that have been looked at."""
        self.relations: dict[_Pair, carried.Relative] = {}
        """Of boxes and what carries them, as far as they have been asked for."""
        self.fingers: dict[str, float] = {}
        """Of the hands at boxes: on them, or open around them."""
        for box, gripper in self.held:
            width = site.bodies[box].size[closing_axis(self.boxes[box], tools[gripper])]
            keeps = (box, gripper) in state.held and (box, gripper) in after.held
            self.fingers[gripper] = _finger_value(site.robot.arms[gripper].fingers, width, keeps)

    def carrier(self, name: str) -> list[float] | None:
        """The pose of a tool or box; of what never moves, none."""
        return self.tools.get(name) or self.boxes.get(name)

    def relation(self, box: str, carrier: str) -> carried.Relative:
        """Where a box is in what carries it."""
        found = self.relations.get((box, carrier))
        if found is None:
            found = self.relations[box, carrier] = relative(self.boxes[box], self.carrier(carrier))
        return found


def _reached(
    site: _Site, keyframes: Sequence[Keyframe], modes: Sequence[tuple[State, State]]
) -> list[_Reached]:
    """Of all keyframes at once, where the tools are."""
    poses = site.kinematics.tool_poses(np.array([keyframe.q for keyframe in keyframes]))
    tools = {gripper: rows.tolist() for gripper, rows in poses.items()}
    return [
        _Reached(
            site, keyframe, {gripper: rows[number] for gripper, rows in tools.items()}, *states
        )
        for number, (keyframe, states) in enumerate(zip(keyframes, modes, strict=True))
    ]


_REACHED: WeakKeyDictionary[Keyframe, tuple[Skeleton, _Reached]] = WeakKeyDictionary()
"""What has been found good after some actions and may be gone on from."""


def _slips(last: _Reached, reached: _Reached) -> list[Violation]:
    """Boxes that moved relative to what holds or supports them in this mode."""
    found = []
    for box, carrier in (*reached.state.held, *reached.state.support):
        before = last.boxes[box], last.carrier(carrier)
        if before == (reached.boxes[box], reached.carrier(carrier)):
            continue
        amount = carried.check(last.relation(box, carrier), reached.relation(box, carrier))
        if amount > 0:
            found.append(Violation(f"carried {box} {carrier}", amount))
    return found
