"""Checks of a scene that a user wrote by hand, before any planning."""

import math
from itertools import combinations, product

import numpy as np

from guided_lgp.errors import InputError
from guided_lgp.poses import rotation_matrix, yaw_of
from guided_lgp.scene.bodies import TABLE_THICKNESS, Box, Table
from guided_lgp.scene.footprints import footprint, gap, inset, seat
from guided_lgp.scene.model import Scene
from guided_lgp.scene.tolerances import FLOAT, LEVEL_ANGLE, MARGIN, OVERLAP
from guided_lgp.scene.world import at_side, initial_poses, poses_at_side, world_of

_HUGE = 1.5
"""Of a box (m) that stands nowhere: its size may be in another unit."""


def validate_scene(scene: Scene, where: str = "scene") -> None:
    """Check that the scene is one the robot can work in.

    Args:
        scene: read by :func:`guided_lgp.scene.load_scene`.
        where: the file, for the message.

    Raises:
        InputError: the first fault found: a joint out of range, tables that overlap each other or
            the robot, boxes that overlap, float, sink in, stand in a circle, or would fall, and
            anything inside the robot.
    """
    _validate_robot(scene, where)
    _validate_tables(scene, where)
    _validate_robots_place(scene, where)
    fields = {box.name: f"{where}: boxes.{i} ({box.name})" for i, box in enumerate(scene.boxes)}
    for name in scene.loaded:
        _validate_level(scene, name, fields[name])
    standing = [box for box in scene.movable if box.name not in scene.held]
    for box in standing:
        _validate_height(scene, box, fields[box.name])
    for box in standing:
        _validate_balance(scene, box, fields[box.name])
    _validate_overlaps(scene, where)


def _validate_robot(scene: Scene, where: str) -> None:
    robot, values = scene.robot.description, scene.robot.fixed_values
    for name, fixed in robot.fixed_joints.items():
        value, (low, high) = values[fixed.joint], fixed.limits
        if not low <= value <= high:
            unit = robot.description.joints[fixed.joint].unit
            fault = f"{value} {unit} is out of range"
            raise InputError(f"{where}: robot.{name}", fault, f"{low} to {high}")
    for joint, value in scene.robot.joints.items():
        low, high = robot.position_limits[robot.joint_names.index(joint)].tolist()
        if not low <= value <= high:
            accepted = f"{low:.4g} to {high:.4g}"
            raise InputError(f"{where}: robot.joints.{joint}", f"{value} is out of range", accepted)


def _validate_tables(scene: Scene, where: str) -> None:
    for one, other in combinations(scene.tables, 2):
        apart = abs(one.position[2] - other.position[2]) >= TABLE_THICKNESS
        if not apart and gap(footprint(one), footprint(other)) < -OVERLAP:
            raise InputError(f"{where}: tables", f"{one.name} and {other.name} overlap")


def _validate_robots_place(scene: Scene, where: str) -> None:
    world = world_of(scene)
    for link, body in product(world.fixed_links, (*scene.supports, *scene.obstacles)):
        depth = -world.distance(link, body.name, 0.0)
        if depth > MARGIN:  # it may stand on one, and hulls are wider than the meshes in them
            field = {Table: "tables", Box: "boxes"}.get(type(body), "obstacles")
            fault = f"{body.name} is {depth:.3f} m inside the robot ({link})"
            raise InputError(f"{where}: {field}", fault)


def _validate_level(scene: Scene, name: str, where: str) -> None:
    """What carries others at the start is level in the hand there."""
    tilt = math.acos(min(1.0, float(rotation_matrix(initial_poses(scene)[name][3:])[2, 2])))
    if tilt > LEVEL_ANGLE:
        fault = f"{scene.held[name]} holds it tilted by {tilt:.2f} rad, with boxes on it"
        raise InputError(f"{where}.grasp", fault, f"at most {LEVEL_ANGLE} rad")


def _validate_height(scene: Scene, box: Box, where: str) -> None:
    seen, below = [box.name], box.on
    supports = {other.name: other.on for other in scene.movable}
    while below in supports:
        if below in seen:
            raise InputError(f"{where}.on", f"{' on '.join([*seen, below])}: boxes in a circle")
        seen.append(below)
        below = supports[below]
    top = _support(scene, box).top[2]
    height = box.position[2] - box.size[2] / 2 - top
    if abs(height) > FLOAT:
        fault = f"floats {height:.3f} m above" if height > 0 else f"is sunk {-height:.3f} m into"
        accepted = f"z = {top + box.size[2] / 2:.4f} m"
        if max(box.size) > _HUGE:
            accepted += "; is its size in m?"
        raise InputError(f"{where}.position", f"the box {fault} {box.on}", accepted)


def _validate_balance(scene: Scene, box: Box, where: str) -> None:
    """A stack falls where its common centre of mass is beside what carries it."""
    if not box.convex.stands:
        raise InputError(where, "the mesh has no flat base below its centre of mass")
    stack = [box]
    for lower in stack:  # grows while it is walked
        stack += [other for other in scene.movable if other.on == lower.name]
    weights = [other.convex.volume for other in stack]
    centre = np.average([other.position[:2] for other in stack], axis=0, weights=weights)
    beyond = -float(inset(seat(_support(scene, box)), centre))
    if beyond > 0:
        carried = " and what it carries" if len(stack) > 1 else ""
        fault = f"the centre of mass of {box.name}{carried} is {beyond:.3f} m beside {box.on}"
        raise InputError(f"{where}.position", f"the box cannot stand: {fault}")


def _support(scene: Scene, box: Box) -> Table | Box:
    body = next(body for body in (*scene.supports, *scene.movable) if body.name == box.on)
    if body.name not in scene.held:
        return body
    held = initial_poses(scene)[body.name]
    return body.model_copy(update={"position": tuple(held[:3]), "yaw": float(yaw_of(held))})


def _validate_overlaps(scene: Scene, where: str) -> None:
    """At the start, and with all arms at their side, where they go first."""
    world, robot = world_of(scene), scene.robot
    supports = {frozenset((box.name, box.on)) for box in scene.movable}
    for box, gripper in scene.held.items():
        links = robot.description.arms[gripper].hand_links
        supports |= {frozenset((box, link)) for link in links}
    sides = (at_side(scene), poses_at_side(scene), "boxes")
    for q, boxes, field in (sides, (robot.start, initial_poses(scene), "robot.joints")):
        world.set(q, boxes)
        for overlap in world.penetrations(OVERLAP):
            if overlap.bodies not in supports:
                fault = f"{overlap.first} and {overlap.second} overlap by {overlap.depth:.3f} m"
                raise InputError(f"{where}: {field}", fault)
