"""The scene document: robot, tables, boxes and obstacles."""

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    field_validator,
    model_serializer,
    model_validator,
)

from guided_lgp.documents import read_json
from guided_lgp.domains import PAPER, domain_names, load_domain
from guided_lgp.faults import Document, brief, refuse_unknown, validated
from guided_lgp.logic import State, Symbols
from guided_lgp.poses import Array, compose, pose, quaternion
from guided_lgp.robots import Robot, load_robot, tilted_robot
from guided_lgp.robots.mounted import Mounted
from guided_lgp.scene.bodies import Angle, Body, Box, Coordinate, Obstacle, Table
from guided_lgp.scene.grasps import grasp_at_start, is_given
from guided_lgp.scene.shapes import Convex

_LEVEL = 1e-9
"""Sine of a roll that leaves the plane between the arms where it is."""


@dataclass(frozen=True)
class Column:
    """What a raised robot stands on: an obstacle at a pose (7,)."""

    convex: Convex
    placement: Array
    yaw: float
    """Of that pose (rad)."""
    name: str = "robot.column"
    """No body of a scene can be called so."""


class PlacedRobot(BaseModel):
    """A robot whose base stands still.

    Beside ``model`` and ``base`` the document has one number for each joint that the robot keeps
    fixed, by the name that the robot file gives it: ``torso`` (m) for the PR2.
    """

    model_config = ConfigDict(extra="allow", frozen=True)
    __pydantic_extra__: dict[str, Coordinate] = Field(init=False)  # for type checkers only

    model: str = "pr2"
    """A robot by its name, or the path of a robot file."""
    base: tuple[Coordinate, Coordinate, Coordinate] = (0.0, 0.0, 0.0)
    """x and y (m) and yaw (rad) of the base link."""
    height: Annotated[float, Field(strict=True, ge=0, le=5, allow_inf_nan=False)] = 0.0
    """Of the base link above the floor (m); above it, a level robot stands on a column."""
    tilt: tuple[Angle, Angle] = (0.0, 0.0)
    """Roll and pitch (rad) of the base link, before its yaw: for an arm on a wall or a ceiling."""
    joints: dict[str, Angle] = Field(default_factory=dict)
    """Where joints of arms are at the start (rad, or m); the others are as at home."""

    @property
    def description(self) -> Robot:
        """The robot itself, mounted as it is."""
        return tilted_robot(self.model, *self.tilt) if any(self.tilt) else load_robot(self.model)

    @property
    def level_pose(self) -> Array:
        """Pose (7,) of a level frame at the base link in the world."""
        x, y, yaw = self.base
        return pose((x, y, self.height), yaw)

    @property
    def base_pose(self) -> Array:
        """Pose (7,) of the base link in the world."""
        if not any(self.tilt):
            return self.level_pose
        mounting = np.array([0.0, 0.0, 0.0, *quaternion(self.description.mounting)])
        return compose(self.level_pose, mounting)

    @property
    def fixed_values(self) -> dict[str, float]:
        """Values (rad, or m) of the joints that stay as they are, by the joint's name."""
        joints = self.description.fixed_joints
        return {fixed.joint: self.__pydantic_extra__[name] for name, fixed in joints.items()}

    @property
    def start(self) -> Array:
        """Configuration (n,) at the start."""
        robot, q = self.description, self.description.home.copy()
        for joint, value in self.joints.items():
            q[robot.joint_names.index(joint)] = value
        return q

    @property
    def columns(self) -> tuple[Column, ...]:
        """What the robot stands on, where that is not the floor: an obstacle."""
        if not self.height or any(self.tilt):
            return ()
        convex = Convex("box", (*self.description.stand, self.height / 2))
        x, y, yaw = self.base
        return (Column(convex, pose((x, y, self.height / 2), yaw), yaw),)

    def link_poses(self, q: Array, links: Sequence[str]) -> Array:
        """Poses (T, len(links), 7) of links' frames in the world (forward kinematics by pinocchio).

        Args:
            q: motion (T, n) in rad.
            links: names in the URDF; the fingers are at zero.
        """
        return self.mounted.link_poses(q, links)

    def tool_pose(self, q: Array, gripper: str) -> Array:
        """Pose (7,) of a gripper's tool frame in the world at a configuration q (n,)."""
        return np.asarray(self.tool_poses(np.asarray(q)[None], (gripper,))[gripper][0])

    def tool_poses(self, q: Array, grippers: Sequence[str] | None = None) -> dict[str, Array]:
        """Poses (T, 7) of tool frames, by default of all, along a motion q (T, n), by gripper."""
        return self.mounted.tool_poses(q, grippers)

    @property
    def mounted(self) -> Mounted:
        """The same, to be kept by who asks often."""
        return Mounted(self.description, self.base_pose, self.fixed_values)

    @model_validator(mode="before")
    @classmethod
    def _all_fixed_joints(cls, data: Any) -> Any:
        """Fill in the joints that the document leaves out; refuse fields that are none."""
        if not isinstance(data, dict) or not isinstance(data.get("model", "pr2"), str):
            return data
        defaults = {
            name: fixed.default
            for name, fixed in load_robot(data.get("model", "pr2")).fixed_joints.items()
        }
        refuse_unknown(data, (*cls.model_fields, *defaults))
        return data | {name: data.get(name, value) for name, value in defaults.items()}

    @model_validator(mode="after")
    def _known_joints(self) -> "PlacedRobot":
        for joint in self.joints:
            if joint not in self.description.joint_names:
                near = ", ".join(get_close_matches(joint, self.description.joint_names, 3, 0.0))
                raise ValueError(f"joints: no arm has a joint {brief(joint)} ({near}, ...)")
        return self

    @model_validator(mode="after")
    def _mirror_images(self) -> "PlacedRobot":
        mirrored = any(arm.mirror_of for arm in self.description.arms.values())
        if mirrored and abs(math.sin(self.tilt[0])) > _LEVEL:
            raise ValueError("tilt: a robot whose arms are mirror images can pitch, not roll")
        return self

    @model_serializer(mode="wrap")
    def _without_floor(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Version 1 of the document has neither height nor tilt nor joints."""
        document: dict[str, Any] = serialize(self)
        if not self.height:
            del document["height"]
        if not any(self.tilt):
            del document["tilt"]
        if not self.joints:
            del document["joints"]
        return document


class Scene(Document):
    """An initial configuration x_0 with its symbols, and the domain whose actions may be used."""

    version: Literal[1, 2] = Field(default=1, exclude_if=lambda version: version == 1)
    """Of the format; nothing depends on it."""
    name: str = "scene"
    """Of the configuration, in messages and titles."""
    domain: str = Field(default=PAPER, exclude_if=lambda name: name == PAPER)
    """Whose instructions may be used: a file of declarations, by its name."""
    robot: PlacedRobot = Field(default_factory=PlacedRobot)
    tables: Annotated[tuple[Table, ...], Field(min_length=1)]
    """Fixed supports."""
    boxes: Annotated[tuple[Box, ...], Field(min_length=1)]
    """Movable bodies, and such that others may stand on."""
    obstacles: tuple[Obstacle, ...] = Field(default=(), exclude_if=lambda obstacles: not obstacles)
    """Bodies that are neither moved nor stood on."""

    def __hash__(self) -> int:
        """Cheap, since measures of scenes are cached; parts of a scene share its name."""
        return hash((self.name, *(box.name for box in self.boxes)))

    @property
    def movable(self) -> tuple[Box, ...]:
        """The boxes that may be moved."""
        return tuple(box for box in self.boxes if not box.fixed)

    @property
    def held(self) -> dict[str, str]:
        """The gripper of each box that is in a hand at the start."""
        hands = self.robot.description.grippers
        return {box.name: box.on for box in self.movable if box.on in hands}

    @property
    def loaded(self) -> dict[str, str]:
        """The gripper of each box that is in a hand at the start and carries others."""
        below = {box.on for box in self.movable}
        return {name: gripper for name, gripper in self.held.items() if name in below}

    @property
    def supports(self) -> tuple[Table | Box, ...]:
        """What stays where it is and may be stood on: tables and fixed boxes."""
        return (*self.tables, *(box for box in self.boxes if box.fixed))

    @property
    def in_the_way(self) -> tuple[Obstacle | Column, ...]:
        """What is neither moved nor stood on."""
        return (*self.robot.columns, *self.obstacles)

    @property
    def bodies(self) -> tuple[Body, ...]:
        """All bodies."""
        return (*self.tables, *self.boxes, *self.obstacles)

    @property
    def symbols(self) -> Symbols:
        """The symbols of the scene by logic type, as declared."""
        return load_domain(self.domain).symbols(
            gripper=self.robot.description.grippers,
            box=(box.name for box in self.movable),
            table=(support.name for support in self.supports),
        )

    @property
    def state(self) -> State:
        """The initial symbolic state."""
        hands = self.robot.description.grippers
        support = {box.name: box.on for box in self.movable if box.on not in hands}
        return load_domain(self.domain).state(support, self.held)

    @field_validator("domain")
    @classmethod
    def _known(cls, domain: str) -> str:
        if domain not in domain_names():
            raise ValueError(f"unknown domain {domain!r} ({', '.join(domain_names())})")
        return domain

    @model_validator(mode="after")
    def _names(self) -> "Scene":
        robot = self.robot.description
        names = [body.name for body in self.bodies]
        parts = {*robot.description.links, Column.name}
        taken = set(robot.grippers)
        for name in names:
            if name in taken:
                raise ValueError(f"name {name!r} is used twice")
            if name in parts:
                raise ValueError(f"name {name!r} is that of a part of the robot")
            taken.add(name)
        supports = {body.name for body in (*self.supports, *self.movable)}
        for box in self.movable:
            if box.name in self.held:
                continue
            if box.on not in supports or box.on == box.name:
                known = ", ".join(sorted(supports - {box.name}))
                raise ValueError(f"box {box.name!r} stands on unknown table {box.on!r} ({known})")
            if "position" not in box.model_fields_set:
                raise ValueError(f"box {box.name!r} has no position")
        return self

    @model_validator(mode="after")
    def _hands(self) -> "Scene":
        """A hand holds one body; how, is filled in where the document leaves it out."""
        for gripper, count in Counter(self.held.values()).items():
            if count > 1:
                raise ValueError(f"{gripper} holds {count} boxes at the start")
        boxes = {box.name: box for box in self.movable}
        for name, gripper in self.held.items():
            if boxes[name].grasp is None:
                grasp = grasp_at_start(boxes[name], self.robot.description.arms[gripper])
                boxes[name].become(grasp=grasp)
            elif boxes[name].grasps and not is_given(boxes[name]):
                raise ValueError(f"box {name!r}: grasp is none of its grasps")
        return self


def parse_scene(document: object, where: str, folder: Path = Path()) -> Scene:
    """Validate a scene document.

    Args:
        document: what ``json.load`` returned.
        where: the file, for the message.
        folder: where the files of meshes are.

    Raises:
        InputError: the first fault found, with file and field.
    """
    return validated(partial(Scene.model_validate, context={"folder": folder}), document, where)


def load_scene(path: str | Path) -> Scene:
    """Read a scene from a JSON file; meshes lie relative to it.

    Raises:
        InputError: the file is missing, is not JSON, or is not a scene.
    """
    return parse_scene(read_json(Path(path)), str(path), Path(path).parent)
