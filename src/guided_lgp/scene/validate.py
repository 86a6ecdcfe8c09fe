"""Checks of a scene that a user wrote by hand, before any planning."""

from itertools import combinations

import numpy as np

from guided_lgp.errors import InputError
from guided_lgp.scene.footprints import footprint, gap, inset
from guided_lgp.scene.model import Box, Scene, Table, grasp_axis
from guided_lgp.scene.reach import reachable_by_any
from guided_lgp.scene.world import TABLE_THICKNESS, initial_poses, world_of

FLOAT_TOLERANCE = 0.002
"""How far (m) the bottom of a box may be off its support's top."""
OVERLAP_TOLERANCE = 0.001
"""m."""
MIN_SIDE = 0.02
"""Thinnest side (m) of a box that the fingers can hold."""


def validate_scene(scene: Scene, where: str = "scene") -> None:
    """Check that the scene is one the robot can work in.

    Args:
        scene: read by :func:`guided_lgp.scene.load_scene`.
        where: the file, for the message.

    Raises:
        InputError: the first fault found: a joint out of range, tables that overlap each other or
            the robot, boxes that overlap, float, sink in, stand in a circle or beside their table,
            are too wide for the fingers, too flat, or out of all arms' reach.
    """
    _validate_robot(scene, where)
    _validate_tables(scene, where)
    for index, box in enumerate(scene.boxes):
        _validate_box(scene, box, f"{where}: boxes.{index} ({box.name})")
    _validate_overlaps(scene, where)
    for index, box in enumerate(scene.boxes):
        if not reachable_by_any(scene, box):
            raise InputError(
                f"{where}: boxes.{index} ({box.name})",
                f"out of {_all_arms(scene)} reach at {box.position}",
                "a position that a gripper can grasp at",
            )


def _all_arms(scene: Scene) -> str:
    names = {1: "the arm's", 2: "both arms'"}
    return names.get(len(scene.robot.description.arms), "all arms'")


def _validate_robot(scene: Scene, where: str) -> None:
    robot, values = scene.robot.description, scene.robot.fixed_values
    for name, fixed in robot.fixed_joints.items():
        value, (low, high) = values[fixed.joint], fixed.limits
        if not low <= value <= high:
            unit = robot.description.joints[fixed.joint].unit
            fault = f"{value} {unit} is out of range"
            raise InputError(f"{where}: robot.{name}", fault, f"{low} to {high}")


def _validate_tables(scene: Scene, where: str) -> None:
    for one, other in combinations(scene.tables, 2):
        apart = abs(one.position[2] - other.position[2]) >= TABLE_THICKNESS
        if not apart and gap(footprint(one), footprint(other)) < -OVERLAP_TOLERANCE:
            raise InputError(f"{where}: tables", f"{one.name} and {other.name} overlap")
    world = world_of(scene)
    for link in world.fixed_links:
        for table in scene.tables:
            depth = -world.distance(link, table.name, 0.0)
            if depth > OVERLAP_TOLERANCE:
                fault = f"{table.name} is {depth:.3f} m inside the robot ({link})"
                raise InputError(f"{where}: tables", fault)


def _validate_box(scene: Scene, box: Box, where: str) -> None:
    width = box.size[grasp_axis(box.size)]
    widest = max(arm.fingers.grasp_width for arm in scene.robot.description.arms.values())
    if not MIN_SIDE <= width <= widest:
        raise InputError(
            f"{where}.size",
            f"the gripper cannot close across {width} m, the narrower horizontal side",
            f"{MIN_SIDE} to {widest} m",
        )
    if box.size[2] < MIN_SIDE:
        fault = f"the box is too flat to grasp: {box.size[2]} m high"
        raise InputError(f"{where}.size", fault, f"at least {MIN_SIDE} m")
    seen, below = [box.name], box.on
    supports = {other.name: other.on for other in scene.boxes}
    while below in supports:
        if below in seen:
            raise InputError(f"{where}.on", f"{' on '.join([*seen, below])}: boxes in a circle")
        seen.append(below)
        below = supports[below]
    bodies: tuple[Table | Box, ...] = (*scene.tables, *scene.boxes)
    support = next(body for body in bodies if body.name == box.on)
    top = support.position[2] + (support.size[2] / 2 if isinstance(support, Box) else 0.0)
    height = box.position[2] - box.size[2] / 2 - top
    if abs(height) > FLOAT_TOLERANCE:
        fault = f"floats {height:.3f} m above" if height > 0 else f"is sunk {-height:.3f} m into"
        accepted = f"z = {top + box.size[2] / 2:.4f} m"
        raise InputError(f"{where}.position", f"the box {fault} {box.on}", accepted)
    if inset(footprint(support), np.array(box.position[:2])) < 0:
        raise InputError(f"{where}.position", f"the box's centre is not over {box.on}")


def _validate_overlaps(scene: Scene, where: str) -> None:
    world = world_of(scene)
    world.set(scene.robot.description.home, initial_poses(scene))
    supports = {frozenset((box.name, box.on)) for box in scene.boxes}
    for overlap in world.penetrations(OVERLAP_TOLERANCE):
        if overlap.bodies not in supports:
            fault = f"{overlap.first} and {overlap.second} overlap by {overlap.depth:.3f} m"
            raise InputError(f"{where}: boxes", fault)
