"""A sampling search for keyframes of a sequence, by other code than the coarse bound's.

Grips, places and postures are drawn at random, solved by the arms' own inverse kinematics, and
judged by the verification. Actions are carried out one after the other; where one fails, other ways
of the action before it are drawn. Keyframes and both ends of the straight ways have to be free.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import islice

import numpy as np

from guided_lgp.bounds.results import Array, Keyframe
from guided_lgp.bounds.verify import verify_keyframe
from guided_lgp.bounds.verify.geometry import declared
from guided_lgp.logic import Action, Skeleton, State, successor
from guided_lgp.logic.domain import GroundInstruction
from guided_lgp.poses import compose, inverse, multiply, pose, rotation_matrix
from guided_lgp.robots.placed_arm import PlacedArm
from guided_lgp.scene import Box, Scene
from guided_lgp.scene.world import initial_poses, world_of

SAMPLES, BATCHES = 400, 10
"""Tool poses drawn at once, and how many times, for every way to come to an action."""
_MANY = 8 * SAMPLES
"""Grips drawn, of which not all are on the side of the box."""
CHECKS = 10
"""Of a batch, how many of those within reach are judged."""
WAYS = (3, 8, 1)
"""Ways that are gone on from: of the actions before, of the last but one, and of the last."""
OFFERS = 12
"""Poses in which a box in a hand is held out."""
INSET = 0.003
"""Of fingertips and of centres from the edge (m): verification asks for the rest."""
GAP = 0.002
"""Of the palm from a box at least (m)."""
LIFT = 0.08
"""How far a box that carries others is lifted (m)."""


@dataclass(frozen=True)
class Situation:
    """What is where between two actions."""

    state: State
    boxes: dict[str, Array]
    """Pose (7,) of each in the world."""
    grips: dict[str, Array]
    """Pose (7,) of each held box in the tool frame."""
    standing: dict[str, Array]
    """Joints of arms that hold out a box, by gripper; the others are at their side."""


class Search:
    """Looks for keyframes of the sequences of one scene."""

    def __init__(self, scene: Scene, rng: np.random.Generator) -> None:
        self._scene, self._rng, self._world = scene, rng, world_of(scene)
        placed = scene.robot
        self._robot = placed.description
        self._arms = {
            gripper: PlacedArm(self._robot, gripper, placed.base_pose, placed.fixed_values)
            for gripper in self._robot.arms
        }
        self._bodies: dict[str, Box] = {box.name: box for box in scene.movable}

    def finds(self, skeleton: Skeleton) -> bool:
        """Whether there are keyframes of all actions."""
        start = Situation(self._scene.state, initial_poses(self._scene), {}, {})
        return self._search(skeleton, start)

    def _search(self, rest: Skeleton, situation: Situation) -> bool:
        if not rest:
            return True
        ways = islice(self._ways(rest[0], situation), WAYS[max(0, len(WAYS) - len(rest))])
        return any(self._search(rest[1:], way) for way in ways)

    def _ways(self, action: Action, situation: Situation) -> Iterator[Situation]:
        """Situations after an action."""
        ground = self._scene.symbols.domain.bind(action)
        needed = ground.body if ground.into_hand else ground.parent
        for shown in self._shown(needed, situation):
            yield from self._carried_out(ground, shown)

    def _shown(self, body: str, situation: Situation) -> Iterator[Situation]:
        """With what a body stands on in the end held out, if a hand at its side holds that."""
        root, state = body, situation.state
        while (below := state.support_of(root)) is not None:
            root = below
        gripper = state.holder(root)
        if gripper is None or gripper in situation.standing:
            yield situation
            return
        for _ in range(OFFERS):
            x, y, z = self._rng.uniform((0.35, -0.4, 0.75), (0.75, 0.4, 1.15))
            there = pose((x, y, z), self._rng.uniform(-np.pi, np.pi))
            tools = compose(there, inverse(situation.grips[root]))[None]
            for q, _ in self._reached(gripper, tools, np.zeros((1, 1, 3))):
                boxes = _moved(situation, root, there)
                yield replace(situation, boxes=boxes, standing=situation.standing | {gripper: q[0]})

    def _carried_out(self, ground: GroundInstruction, before: Situation) -> Iterator[Situation]:
        """Keyframes at the switch, at both ends of the straight ways, and afterwards."""
        gripper = ground.actor
        into, out = self._straight(ground)
        for _ in range(BATCHES):
            poses, grips = self._drawn(ground, before)
            tools = compose(poses, inverse(grips))
            approach = rotation_matrix(tools[:, 3:])[:, :, 0]
            shifts = np.stack([self._shift(approach, way) for way in (into, out)], axis=1)
            reached = islice(self._reached(gripper, tools, shifts), CHECKS)
            for q, row in reached:
                after = self._after(ground, before, poses[row], grips[row], q, shifts[row])
                if after is not None:
                    yield after

    def _straight(self, ground: GroundInstruction) -> tuple[tuple[float, float], ...]:
        """Back and up (m) of the ends of the straight ways in and out.

        Halfway up, the hand may turn.
        """
        steps = {step.name: step.options for step in ground.motion}
        ways = (steps["line_in"], steps["line_out"])
        return tuple(
            (
                float(way.get("back", 0.0)),
                float(way.get("down", 0.0)) + 0.5 * float(way.get("up", 0.0)),
            )
            for way in ways
        )

    @staticmethod
    def _shift(approach: Array, way: tuple[float, float]) -> Array:
        back, up = way
        return np.asarray(-back * approach + np.array([0.0, 0.0, up]))

    def _drawn(self, ground: GroundInstruction, before: Situation) -> tuple[Array, Array]:
        """Poses of the body at the switch and in the tool frame, both (SAMPLES, 7)."""
        if ground.into_hand:
            grips = self._some_grips(self._bodies[ground.body], self._arms[ground.actor])
            return np.tile(before.boxes[ground.body], (len(grips), 1)), grips
        grips = np.tile(before.grips[ground.body], (SAMPLES, 1))
        return self._some_places(before, ground.body, ground.parent), grips

    def _some_grips(self, box: Box, arm: PlacedArm) -> Array:
        """Poses (n, 7) of a box in the tool frame: fingers across a side, fingertips on it."""
        half, rng, palm = np.array(box.size) / 2, self._rng, arm.arm.palm_front
        axes = [axis for axis in (0, 1) if box.size[axis] <= arm.arm.fingers.grasp_width]
        if not axes:
            return np.empty((0, 7))
        across, pitch = rng.choice(axes, _MANY), rng.uniform(0.0, np.pi, _MANY)
        flipped, zero = rng.integers(2, size=_MANY), np.zeros(_MANY)
        yaw = np.where(across == 1, 0.0, np.pi / 2)
        turns = [(2, yaw), (1, pitch), (0, np.pi * flipped)]
        turn = np.stack([zero, zero, zero, zero + 1], axis=1)
        for axis, angle in turns:
            about = np.stack([zero, zero, zero, np.cos(angle / 2)], axis=1)
            about[:, axis] = np.sin(angle / 2)
            turn = multiply(turn, about)
        approach, _, third = np.moveaxis(rotation_matrix(turn), 2, 0)
        behind = np.abs(approach) @ half + palm + rng.uniform(GAP, max(GAP, -palm), _MANY)
        aside = rng.uniform(-1, 1, _MANY) * half.max()
        origin = -behind[:, None] * approach - aside[:, None] * third
        on_side = np.abs(origin) <= half - INSET
        on_side[np.arange(_MANY), across] = True
        tools = np.concatenate([origin, turn], axis=1)[on_side.all(axis=1)]
        return inverse(tools[:SAMPLES])

    def _some_places(self, before: Situation, body: str, support: str) -> Array:
        """Level poses (SAMPLES, 7) of a body on a support."""
        height = self._bodies[body].size[2] / 2
        if support in self._bodies:
            size = np.array(self._bodies[support].size)
            top, half = compose(before.boxes[support], pose((0, 0, size[2] / 2))), size[:2] / 2
        else:
            table = next(table for table in self._scene.tables if table.name == support)
            top, half = pose(table.position, table.yaw), np.array(table.half_extents)
        offsets = self._rng.uniform(-1, 1, (SAMPLES, 2)) * (half - INSET)
        yaws = self._rng.uniform(-np.pi, np.pi, SAMPLES)
        local = np.zeros((SAMPLES, 7))
        local[:, :2], local[:, 2] = offsets, height
        local[:, 5], local[:, 6] = np.sin(yaws / 2), np.cos(yaws / 2)
        return np.asarray(compose(top, local))

    def _reached(self, gripper: str, tools: Array, shifts: Array) -> Iterator[tuple[Array, int]]:
        """Joints (1 + ends, n) at tool poses (N, 7) and shifted (N, ends, 3), and which they are.

        All with one value of the redundant joint, drawn for each.
        """
        arm = self._arms[gripper]
        values = self._rng.choice(arm.redundancies, len(tools))
        if (redundant := arm.arm.redundant) is not None:
            low, high = arm.arm.limits[redundant].tolist()
            values = self._rng.uniform(low, high, len(tools))
        positions = tools[:, None, :3] + np.concatenate([np.zeros((len(tools), 1, 3)), shifts], 1)
        turns = rotation_matrix(tools[:, 3:])[:, None]
        q, valid = arm.inverse(
            np.broadcast_to(turns, (*positions.shape, 3)),
            positions,
            np.broadcast_to(values[:, None], positions.shape[:2]),
        )
        for row in np.flatnonzero(np.all(valid.any(axis=2), axis=1)):
            branches = [np.flatnonzero(found) for found in valid[row]]
            chosen = [int(self._rng.choice(found)) for found in branches]
            yield q[row, np.arange(len(chosen)), chosen], int(row)

    def _after(
        self,
        ground: GroundInstruction,
        before: Situation,
        placed: Array,
        grip: Array,
        q: Array,
        shifts: Array,
    ) -> Situation | None:
        """The situation after an action, if all that it goes through is free."""
        state = successor(before.state, ground.action)
        contact, into, out = q
        boxes = _moved(before, ground.body, placed)
        if self._is_bad(Keyframe(self._q(before, ground.actor, contact), boxes), before, ground):
            return None
        raised = [_shifted(boxes, before.state, ground.body, shift) for shift in shifts]
        coming, leaving = (boxes, raised[1]) if ground.into_hand else (raised[0], boxes)
        there = Keyframe(self._q(before, ground.actor, into), coming)
        gone = Keyframe(self._q(before, ground.actor, out), leaving)
        if self._collides(there, before.state, ground) or self._collides(gone, state, ground):
            return None
        grips = {**before.grips, ground.body: grip} if ground.into_hand else dict(before.grips)
        if not ground.into_hand:
            del grips[ground.body]
        standing = {g: joints for g, joints in before.standing.items() if g != ground.actor}
        if ground.into_hand and before.state.standing_on(ground.body):
            standing, boxes = {**standing, ground.actor: out}, leaving
        after = self._settled(Situation(state, boxes, grips, standing))
        return None if self._is_bad(self._keyframe(after), after) else after

    def _is_bad(
        self, keyframe: Keyframe, situation: Situation, ground: GroundInstruction | None = None
    ) -> bool:
        action = None if ground is None else ground.action
        return bool(verify_keyframe(self._world, keyframe, situation.state, action))

    def _collides(self, keyframe: Keyframe, state: State, ground: GroundInstruction) -> bool:
        """Whether an end of a straight way is not free, fingers around the body or on it."""
        tools = self._scene.robot.tool_poses(keyframe.q[None])
        fingers = {}
        for box, gripper in {*state.held, (ground.body, ground.actor)}:
            closing = rotation_matrix(tools[gripper][0, 3:])[:, 1]
            sides = rotation_matrix(keyframe.boxes[box][3:])
            width = self._bodies[box].size[int(np.argmax(np.abs(closing @ sides)))]
            hand = self._robot.arms[gripper].fingers
            holds = (box, gripper) in state.held
            fingers[gripper] = hand.value(width) if holds else hand.value_around(width)
        self._world.set(keyframe.q, keyframe.boxes, fingers)
        support = dict(state.support)
        return any(
            not declared(overlap, self._robot, state.held, support)
            for overlap in self._world.penetrations(touching=support.items())
        )

    def _settled(self, situation: Situation) -> Situation:
        """Arms whose box carries nothing go to their side."""
        state, boxes = situation.state, dict(situation.boxes)
        standing = {
            gripper: q
            for gripper, q in situation.standing.items()
            if (held := state.held_by(gripper)) is not None and state.standing_on(held)
        }
        for box, gripper in state.held:
            if gripper not in standing:
                tool = self._scene.robot.tool_pose(self._robot.home, gripper)
                boxes[box] = compose(tool, situation.grips[box])
        return replace(situation, boxes=boxes, standing=standing)

    def _keyframe(self, situation: Situation) -> Keyframe:
        return Keyframe(self._q(situation), situation.boxes)

    def _q(self, situation: Situation, gripper: str = "", joints: Array | None = None) -> Array:
        """A configuration in which one arm may be somewhere else."""
        q = self._robot.home.copy()
        posed = situation.standing if joints is None else {**situation.standing, gripper: joints}
        for name, values in posed.items():
            q[self._robot.arms[name].slice] = values
        return q


def _moved(situation: Situation, body: str, placed: Array) -> dict[str, Array]:
    """A body somewhere else, with all that it carries."""
    boxes = dict(situation.boxes)
    motion = compose(placed, inverse(boxes[body]))
    for name in situation.state.carried_by(body):
        boxes[name] = compose(motion, boxes[name])
    return boxes | {body: placed}


def _shifted(boxes: dict[str, Array], state: State, body: str, shift: Array) -> dict[str, Array]:
    """The same, moved (3,) from where they are."""
    found = dict(boxes)
    for name in (body, *state.carried_by(body)):
        found[name] = np.array([*(boxes[name][:3] + shift), *boxes[name][3:]])
    return found
