"""Grippers at their boxes, and what collides."""

import itertools
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from typing import Literal

import numpy as np
import pybullet
from scipy.spatial.transform import Rotation

from plan_checker.actions import Event, attachments_taken
from plan_checker.document import (
    ROUNDING,
    SAME_ANGLE,
    Attachment,
    Fault,
    Motion,
    Plan,
    body_vertices,
    scene_pose,
)
from plan_checker.geometry import box_corners, inverse_pose, placed_points
from plan_checker.robot import Robot

COLUMN = "robot.column"
PENETRATION = 0.005  # allowed everywhere outside the declared contacts
IN_HAND = 0.015  # allowed within them: the hull of a finger fills the hollow of its inner side
STEP = 0.01  # of the fastest link point between two collision checks
HULL_MARGIN = 0.001  # by which PyBullet inflates a hull
APPROACH = 0.12  # length of the straight motion to or from a box on which fingers may touch it
AT_BOX = 0.005  # distance of a finger from the box that it holds
AWAY = 0.005  # a tool this far from where it grasped or released has left the box
OPENED = 0.002  # by which the fingers must be wider beside a box than on it, rad or m
SAME_GRASP = 1e-3  # distance of a tool from where a box's own grasp has it


def _leaves(tool: np.ndarray, row: int, distance: float, step: Literal[-1, 1]) -> int | None:
    """The first row from ``row`` on (step 1) or back at which the tool is that far away."""
    away = np.linalg.norm(tool[:, :3, 3] - tool[row, :3, 3], axis=1) > distance
    rows = np.flatnonzero(away[row:] if step > 0 else away[row::-1])
    return row + step * int(rows[0]) if rows.size else None


def wrong_fingers(plan: Plan, events: Sequence[Event], motion: Motion) -> Iterator[Fault]:
    """The fingers are open on the way to a box, closed while they hold it, open on the way off."""
    released = [event.released for event in events]
    for box, gripper, start, end in _held(plan, events):
        tool = motion.tools[gripper]
        opening = plan.q[:, plan.joints.index(plan.hands[gripper].fingers[0])]
        left = _leaves(tool, end, AWAY, 1)
        given = Attachment(box, gripper, start, end) in released
        if given and left is not None and opening[left] < opening[end] + OPENED:
            yield Fault("fingers", left, f"{gripper} leaves {box} without opening")
        came = _leaves(tool, start, AWAY, -1)
        if came is not None and opening[came] < opening[start] + OPENED:
            yield Fault("fingers", came, f"{gripper} comes to {box} without opening")
        moved = np.abs(opening[start : end + 1] - opening[start])
        if moved.max() > ROUNDING:
            yield Fault("fingers", start + int(moved.argmax()), f"{gripper} moves fingers on {box}")


def _held(plan: Plan, events: Sequence[Event]) -> Iterator[Attachment]:
    """Boxes in hands whose fingers move."""
    for taken in attachments_taken(plan, events):
        if plan.hands[taken.gripper].fingers:
            yield taken


def wrong_grasps(
    plan: Plan, robot: Robot, events: Sequence[Event], motion: Motion
) -> Iterator[Fault]:
    """When a gripper takes hold of a box, fingers are at it on opposite sides of it.

    Of a box that has grasps of its own, it is one of them.
    """
    with _World(plan, robot) as world:
        for taken in attachments_taken(plan, events):
            box, gripper, row, _ = taken
            hand = plan.hands[gripper]
            into = inverse_pose(motion.tools[gripper][row])
            sides = set()
            # the palm is the first link; where the jaws do not move, they may be one with it
            for hull in robot.hull_names(hand.links[1:] if hand.fingers else hand.links):
                poses = {hull: motion.links[hull][row], box: motion.boxes[box][row]}
                for on_box, _ in world.closest(hull, box, poses, AT_BOX):
                    sides.add(np.sign((into @ (*on_box, 1))[1]))
            if not {-1.0, 1.0} <= sides:
                text = f"{gripper} does not have {box} between its fingers"
                yield Fault("grasp", row, text)
            given = plan.boxes[box].get("grasps")
            now = inverse_pose(motion.boxes[box][row]) @ motion.tools[gripper][row]
            if given and not any(_near(np.array(grasp), now) for grasp in given):
                yield Fault("grasp", row, f"{gripper} holds {box} in none of its grasps")


def _near(grasp: np.ndarray, now: np.ndarray) -> bool:
    turn = Rotation.from_quat(grasp[3:]).inv() * Rotation.from_matrix(now[:3, :3])
    way = float(np.linalg.norm(grasp[:3] - now[:3, 3]))
    return way <= SAME_GRASP and turn.magnitude() <= SAME_ANGLE


class _World:
    """The hulls in a PyBullet client of its own."""

    def __init__(self, plan: Plan, robot: Robot) -> None:
        self.client = pybullet.connect(pybullet.DIRECT)
        self.vertices = dict(robot.hulls)
        for name, item in (plan.boxes | plan.tables | plan.obstacles).items():
            self.vertices[name] = body_vertices(item)
        height = plan.base[2]
        if plan.column:
            column = box_corners((2 * plan.stand[0], 2 * plan.stand[1], height))
            self.vertices[COLUMN] = column - (0, 0, height / 2)
        self.bodies = {}
        for name, vertices in self.vertices.items():
            shape = pybullet.createCollisionShape(
                pybullet.GEOM_MESH, vertices=vertices.tolist(), physicsClientId=self.client
            )
            self.bodies[name] = pybullet.createMultiBody(0, shape, physicsClientId=self.client)

    def __enter__(self) -> "_World":
        return self

    def __exit__(self, *_: object) -> None:
        pybullet.disconnect(self.client)

    def closest(
        self, first: str, second: str, poses: Mapping[str, np.ndarray], within: float
    ) -> list[tuple[tuple[float, ...], float]]:
        """Closest points on the second body, with distances (below zero: penetration)."""
        for name in (first, second):
            pybullet.resetBasePositionAndOrientation(
                self.bodies[name],
                poses[name][:3, 3],
                Rotation.from_matrix(poses[name][:3, :3]).as_quat(),
                physicsClientId=self.client,
            )
        points = pybullet.getClosestPoints(
            self.bodies[first], self.bodies[second], within, physicsClientId=self.client
        )
        return [(point[6], point[8] + 2 * HULL_MARGIN) for point in points]


def _samples(plan: Plan, robot: Robot, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    """Intervals (m,) and joint positions (m, joints) so close that no link point moves a step."""
    vertices = robot.hulls | {name: body_vertices(box) for name, box in plan.boxes.items()}
    reach = np.zeros(len(plan.times) - 1)
    for name, pose in (motion.links | motion.boxes).items():
        moves = np.linalg.norm(np.diff(placed_points(pose, vertices[name]), axis=0), axis=1)
        reach = np.maximum(reach, moves.max(axis=1))
    counts = np.maximum(1, np.ceil(1.1 * reach / STEP)).astype(int)  # an arc exceeds its chord
    intervals = np.repeat(np.arange(len(counts)), counts)
    fraction = np.concatenate([np.arange(count) / count for count in counts])[:, None]
    q = (1 - fraction) * plan.q[intervals] + fraction * plan.q[intervals + 1]
    return np.append(intervals, len(counts) - 1), np.vstack([q, plan.q[-1]])


def collisions(
    plan: Plan, robot: Robot, events: Sequence[Event], motion: Motion
) -> Iterator[Fault]:
    """Pairs of bodies that overlap by more than the tolerance, each where it is deepest.

    A box and its support touch without overlapping, so the tolerance is all they need.
    """
    intervals, q = _samples(plan, robot, motion)
    dense, grips = robot.forward(q)
    for name, pose in motion.boxes.items():
        dense[name] = pose[intervals]
    for box, gripper, start, end in plan.attachments:
        held = (intervals >= start) & (intervals < end)
        in_hand = inverse_pose(motion.tools[gripper][start]) @ motion.boxes[box][start]
        dense[box][held] = grips[gripper][held] @ in_hand
        dense[box][intervals >= end] = motion.boxes[box][end]
    for table in (*plan.tables, *plan.obstacles):
        dense[table] = np.tile(scene_pose(plan, table), (len(q), 1, 1))
    dense[COLUMN] = np.tile(robot.base, (len(q), 1, 1))
    declared = _declared_contacts(plan, robot, events, motion)
    with _World(plan, robot) as world:
        ranges = {}
        for name, vertices in world.vertices.items():
            points = placed_points(dense[name], vertices)
            ranges[name] = points.min(axis=2), points.max(axis=2)
        for first, second in _pairs(plan, robot):
            (low, high), (low2, high2) = ranges[first], ranges[second]
            allowed = np.full(len(q), PENETRATION)
            for begin, end in declared.get((first, second), []):
                allowed[(intervals >= begin) & (intervals < end)] = IN_HAND
            overlap = (np.minimum(high, high2) - np.maximum(low, low2)).min(axis=1)
            depths = np.zeros(len(q))
            for sample in np.flatnonzero(overlap > allowed):  # the depth is at most the overlap
                at = {name: dense[name][sample] for name in (first, second)}
                found = [-distance for _, distance in world.closest(first, second, at, 0.0)]
                depths[sample] = max(found, default=0.0)
            worst = int((depths - allowed).argmax())
            if depths[worst] > allowed[worst]:
                row = int(intervals[worst])
                one, other = (robot.link.get(name, name) for name in (first, second))
                text = f"{one} is {1e3 * depths[worst]:.0f} mm inside {other}"
                yield Fault("collision", row, f"{text} at {plan.times[row]:.2f} s")


def _pairs(plan: Plan, robot: Robot) -> Iterator[tuple[str, str]]:
    disabled = set()
    if plan.srdf is not None:
        pairs = ET.parse(plan.srdf).getroot().iter("disable_collisions")
        disabled = {frozenset((pair.get("link1"), pair.get("link2"))) for pair in pairs}
    column = [COLUMN] if plan.column else []
    bodies = [*plan.boxes, *plan.tables, *plan.obstacles, *column]
    still = {*robot.fixed, *plan.tables, *plan.obstacles, *column}  # what touches there always does
    for pair in itertools.combinations([*robot.hulls, *bodies], 2):
        links = frozenset(robot.link.get(name, name) for name in pair)
        if len(links) == 2 and links not in disabled and not set(pair) <= still:
            yield pair


def _declared_contacts(
    plan: Plan, robot: Robot, events: Sequence[Event], motion: Motion
) -> dict[tuple[str, str], list[tuple[int, int]]]:
    """Intervals, by link of a hand and box, from the approach to a box to the retreat from it."""
    contacts: dict[tuple[str, str], list[tuple[int, int]]] = {}
    for box, gripper, start, end in attachments_taken(plan, events):
        tool = motion.tools[gripper]
        begin = _leaves(tool, start, APPROACH, -1) or 0
        until = _leaves(tool, end, APPROACH, 1) or len(tool)
        for hull in robot.hull_names(plan.hands[gripper].links):
            contacts.setdefault((hull, box), []).append((begin, until))
    return contacts
