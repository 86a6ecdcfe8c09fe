"""What somebody sees of a scene while a plan is carried out, and the scene that it makes."""

import math
from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, field_validator

from guided_lgp.documents import read_json
from guided_lgp.errors import InputError
from guided_lgp.faults import Document, validated
from guided_lgp.poses import Array, compose, inverse, quaternion, rotation_matrix, yaw_of
from guided_lgp.scene import Box, PlacedRobot, Scene, Table
from guided_lgp.scene.footprints import footprint, inset

HEIGHT = 0.02
"""How far (m) an observed box may be above or in what it stands on."""
TILT = 0.1
"""How far (rad) an observed box may be tilted that stands on one of its faces."""

_ALONG = 0.1
"""Sine of the angle between a box's upright axis and the one along which fingers close on it."""

Number = Annotated[float, Field(allow_inf_nan=False, ge=-100, le=100)]


class ObservedBox(Document):
    """Where the middle of a box is (m), and how it is turned: ``[x, y, z, w]``."""

    position: tuple[Number, Number, Number]
    quaternion: tuple[Number, Number, Number, Number] = (0.0, 0.0, 0.0, 1.0)

    @field_validator("quaternion")
    @classmethod
    def _of_length_one(cls, quaternion: tuple[float, ...]) -> tuple[float, ...]:
        if not math.isclose(math.hypot(*quaternion), 1.0, abs_tol=0.01):
            raise ValueError("is not of length 1: [x, y, z, w]")
        return quaternion


class Observed(Document):
    """The whole file: what is not seen is gone."""

    joints: dict[str, Number] = Field(default_factory=dict)
    """Values (rad, or m) of joints of arms; the others are as at home."""
    boxes: dict[str, ObservedBox]
    """Poses of the boxes in the world, by name; those that are missing have been taken away."""
    held: dict[str, str] = Field(default_factory=dict)
    """The gripper of each box that is in a hand."""


def read_observed(path: Path) -> Observed:
    """Read an observation.

    Raises:
        InputError: the file is missing, is not JSON, or has a fault.
    """
    return validated(Observed.model_validate, read_json(path, "an observed state"), str(path))


def observed_scene(scene: Scene, observed: Observed, where: str = "observed") -> Scene:
    """The scene with arms and boxes where they have been seen.

    A box stands on the highest body below it; its height and a slight tilt follow from that.

    Args:
        scene: that the plan was made for.
        observed: what is seen now.
        where: the file, for messages.

    Raises:
        InputError: a joint or box is unknown, or a box is tilted, or stands on nothing.
    """
    known = {box.name: box for box in scene.movable}
    _require_known(observed, known, scene.robot.description.grippers, where)
    joints = scene.robot.model_dump() | {"joints": dict(observed.joints)}
    robot = validated(PlacedRobot.model_validate, joints, where)
    standing = [
        _level(known[name], seen, f"{where}: boxes.{name}")
        for name, seen in observed.boxes.items()
        if name not in observed.held
    ]
    boxes: dict[str, Box] = {}
    below: list[Table | Box] = [*scene.supports]
    for name, gripper in observed.held.items():
        tool = robot.tool_pose(robot.start, gripper)
        held = compose(inverse(tool), _pose(observed.boxes[name]))
        grasp = _centred(held, f"{where}: held.{name}")
        boxes[name] = known[name].model_copy(update={"on": gripper, "grasp": grasp})
        below.append(_placed(known[name], compose(tool, np.array(grasp))))
    for box in sorted(standing, key=lambda box: box.position[2]):
        boxes[box.name] = _put_down(box, below, f"{where}: boxes.{box.name}")
        below.append(boxes[box.name])
    changed = [boxes.get(box.name, box) for box in scene.boxes if box.fixed or box.name in boxes]
    document = scene.model_dump() | {
        "robot": robot.model_dump(),
        "boxes": [b.model_dump() for b in changed],
    }
    return validated(Scene.model_validate, document, where)


def _require_known(
    observed: Observed, boxes: Collection[str], grippers: Collection[str], where: str
) -> None:
    for name in observed.boxes:
        if name not in boxes:
            raise InputError(f"{where}: boxes", f"unknown box {name}", ", ".join(boxes))
    for name, gripper in observed.held.items():
        if name not in observed.boxes:
            raise InputError(f"{where}: held.{name}", "has no pose in boxes")
        if gripper not in grippers:
            raise InputError(f"{where}: held.{name}", f"unknown {gripper}", ", ".join(grippers))


def _pose(box: ObservedBox) -> Array:
    turn = np.array(box.quaternion)
    return np.array([*box.position, *(turn / np.linalg.norm(turn))])


def _centred(grasp: Array, where: str) -> tuple[float, ...]:
    """The pose (7,) of a box in the tool frame as planners know them: fingers across its sides."""
    turn = rotation_matrix(grasp[3:])
    if math.hypot(turn[0, 2], turn[2, 2]) < _ALONG:
        raise InputError(where, "is held from above and below", "fingers across its sides")
    across = int(np.argmax(np.abs(turn[1, :2])))
    turned = np.zeros((3, 3))
    turned[1, across] = math.copysign(1.0, turn[1, across])
    turned[:, 2] = turn[:, 2] * (1.0, 0.0, 1.0) / math.hypot(turn[0, 2], turn[2, 2])
    sign = 1.0 if across == 0 else -1.0
    turned[:, 1 - across] = sign * np.cross(turned[:, 2], turned[:, across])
    return (grasp[0], 0.0, grasp[2], *quaternion(turned).tolist())


def _placed(box: Box, where: Array) -> Box:
    """The box at a level pose (7,)."""
    x, y, z = where[:3].tolist()
    return box.model_copy(update={"position": (x, y, z), "yaw": float(yaw_of(where))})


def _level(box: Box, seen: ObservedBox, where: str) -> Box:
    """The box on the face that is nearest to being below; its height as seen."""
    turn = rotation_matrix(_pose(seen)[3:])
    up = int(np.argmax(np.abs(turn[2])))
    tilt = math.acos(min(1.0, abs(turn[2, up])))
    if tilt > TILT:
        raise InputError(f"{where}.quaternion", f"the box is tilted by {tilt:.2f} rad", f"{TILT}")
    upwards = np.array([0.0, 0.0, math.copysign(1.0, turn[2, up])])
    turn = _turn_between(turn[:, up], upwards) @ turn
    document = box.model_dump() | {"position": seen.position, "grasp": None}
    placed: dict[str, object] = {"yaw": math.atan2(turn[1, 0], turn[0, 0])}
    if up != 2 or turn[2, 2] < 0:
        placed = {"yaw": 0.0, "quaternion": tuple(quaternion(turn).tolist())}
    return validated(Box.model_validate, document | placed, where)


def _turn_between(first: Array, second: Array) -> Array:
    """The rotation (3, 3) of one direction to another near it."""
    v = np.cross(first, second)
    cross = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    return np.asarray(np.eye(3) + cross + cross @ cross / (1 + first @ second))


def _put_down(box: Box, bodies: Sequence[Table | Box], where: str) -> Box:
    """The box on the highest body below it."""
    x, y, z = box.position
    bottom = z - box.size[2] / 2
    below = [
        body
        for body in bodies
        if abs(body.top[2] - bottom) <= HEIGHT and inset(footprint(body), np.array((x, y))) > 0
    ]
    if not below:
        accepted = "the top of a table or a box that is seen"
        raise InputError(f"{where}.position", "the box stands on nothing", accepted)
    support = max(below, key=lambda body: body.top[2])
    height = support.top[2] + box.size[2] / 2
    return box.model_copy(update={"on": support.name, "position": (x, y, height)})
