"""The scene document: robot, tables and boxes."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    ValidationError,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    field_validator,
    model_serializer,
    model_validator,
)

from guided_lgp.documents import read_json
from guided_lgp.domains import PAPER, domain_names, load_domain
from guided_lgp.faults import Document, brief, first_fault, refuse_unknown
from guided_lgp.logic import State, Symbols
from guided_lgp.poses import Array, compose, pose
from guided_lgp.robots import Robot, load_robot


def _no_more_than(most: float, hint: str) -> WrapValidator:
    """Suspect another unit in numbers that are too large."""

    def check(value: Any, within: ValidatorFunctionWrapHandler) -> Any:
        if isinstance(value, int | float) and abs(value) > most:
            raise ValueError(f"{brief(value)} is too large: {hint}")
        return within(value)

    return WrapValidator(check)


_METRES = "lengths are in m; is this in mm or cm?"
_RADIANS = "angles are in rad; are these degrees?"
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")


def _speakable(name: str) -> str:
    """Names stand in goals, between blanks and parentheses."""
    if not _NAME.fullmatch(name):
        raise ValueError(f"the name {brief(name)} has other characters than letters, digits, _ - .")
    return name


Name = Annotated[
    str,
    Field(max_length=64, json_schema_extra={"pattern": f"^{_NAME.pattern}$"}),
    AfterValidator(_speakable),
]
# strict: neither true nor "0.4" is a number
Coordinate = Annotated[
    float,
    Field(strict=True, ge=-10, le=10, allow_inf_nan=False),
    _no_more_than(10, _METRES),
]
Angle = Annotated[
    float,
    Field(strict=True, ge=-2 * math.pi, le=2 * math.pi, allow_inf_nan=False),
    _no_more_than(2 * math.pi, _RADIANS),
]
Length = Annotated[
    float,
    Field(strict=True, ge=0.001, le=5, allow_inf_nan=False),
    _no_more_than(5, _METRES),
]


@dataclass(frozen=True)
class Column:
    """A body that is neither moved nor stood on: half extents (3,) in m, and pose (7,)."""

    half: tuple[float, float, float]
    placement: Array
    name: str = "robot.column"
    """No box or table can be called so."""


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
    """Of the base link above the floor (m); above it, the robot stands on a column."""

    @property
    def description(self) -> Robot:
        """The robot itself."""
        return load_robot(self.model)

    @property
    def base_pose(self) -> Array:
        """Pose (7,) of the base link in the world."""
        x, y, yaw = self.base
        return pose((x, y, self.height), yaw)

    @property
    def fixed_values(self) -> dict[str, float]:
        """Values (rad, or m) of the joints that stay as they are, by the joint's name."""
        joints = self.description.fixed_joints
        return {fixed.joint: self.__pydantic_extra__[name] for name, fixed in joints.items()}

    @property
    def columns(self) -> tuple[Column, ...]:
        """What the robot stands on, where that is not the floor: an obstacle."""
        if not self.height:
            return ()
        half = (*self.description.stand, self.height / 2)
        return (Column(half, pose((*self.base[:2], self.height / 2), self.base[2])),)

    def link_poses(self, q: Array, links: Sequence[str]) -> Array:
        """Poses (T, len(links), 7) of links' frames in the world (forward kinematics by pinocchio).

        Args:
            q: motion (T, n) in rad.
            links: names in the URDF; the fingers are at zero.
        """
        kinematics = self.description.kinematics
        return compose(self.base_pose, kinematics.link_poses(q, self.fixed_values, links))

    def tool_pose(self, q: Array, gripper: str) -> Array:
        """Pose (7,) of a gripper's tool frame in the world at a configuration q (n,)."""
        return np.asarray(self.tool_poses(np.asarray(q)[None], (gripper,))[gripper][0])

    def tool_poses(self, q: Array, grippers: Sequence[str] | None = None) -> dict[str, Array]:
        """Poses (T, 7) of tool frames, by default of all, along a motion q (T, n), by gripper."""
        arms = self.description.arms
        wanted = tuple(arms) if grippers is None else grippers
        poses = self.link_poses(q, [arms[gripper].tool_link for gripper in wanted])
        return {
            gripper: compose(poses[:, column], arms[gripper].tool_in_link)
            for column, gripper in enumerate(wanted)
        }

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

    @model_serializer(mode="wrap")
    def _without_floor(self, serialize: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Version 1 of the document has no height."""
        document: dict[str, Any] = serialize(self)
        if not self.height:
            del document["height"]
        return document


def grasp_axes(size: tuple[float, float, float], widest: float) -> tuple[int, ...]:
    """The box axes that fingers can close along, the narrower one first (0: x, 1: y).

    Args:
        size: extents (m) of the box.
        widest: side (m) that the hand can take.
    """
    order = (0, 1) if size[0] < size[1] else (1, 0)
    return tuple(axis for axis in order if size[axis] <= widest)


class Table(Document):
    """A fixed support; ``position`` is the centre of its top (m), ``yaw`` in rad."""

    name: Name
    position: tuple[Coordinate, Coordinate, Coordinate]
    half_extents: tuple[Length, Length]
    yaw: Angle = 0.0


class Box(Document):
    """A movable box; ``position`` is its centre (m), ``size`` its full extents (m)."""

    name: Name
    size: tuple[Length, Length, Length]
    position: tuple[Coordinate, Coordinate, Coordinate]
    yaw: Angle = 0.0
    on: Name


class Scene(Document):
    """An initial configuration x_0 with its symbols, and the domain whose actions may be used."""

    name: str = "scene"
    domain: str = Field(default=PAPER, exclude_if=lambda name: name == PAPER)
    robot: PlacedRobot = Field(default_factory=PlacedRobot)
    tables: Annotated[tuple[Table, ...], Field(min_length=1)]
    boxes: Annotated[tuple[Box, ...], Field(min_length=1)]

    @property
    def symbols(self) -> Symbols:
        """The symbols of the scene by logic type, as declared."""
        return load_domain(self.domain).symbols(
            gripper=self.robot.description.grippers,
            box=(box.name for box in self.boxes),
            table=(table.name for table in self.tables),
        )

    @property
    def state(self) -> State:
        """The initial symbolic state."""
        return load_domain(self.domain).state({box.name: box.on for box in self.boxes})

    @field_validator("domain")
    @classmethod
    def _known(cls, domain: str) -> str:
        if domain not in domain_names():
            raise ValueError(f"unknown domain {domain!r} ({', '.join(domain_names())})")
        return domain

    @model_validator(mode="after")
    def _names(self) -> "Scene":
        robot = self.robot.description
        names = [*(table.name for table in self.tables), *(box.name for box in self.boxes)]
        parts = {*robot.description.links, Column.name}
        taken = set(robot.grippers)
        for name in names:
            if name in taken:
                raise ValueError(f"name {name!r} is used twice")
            if name in parts:
                raise ValueError(f"name {name!r} is that of a part of the robot")
            taken.add(name)
        for box in self.boxes:
            if box.on not in names or box.on == box.name:
                raise ValueError(f"box {box.name!r} stands on unknown table {box.on!r}")
        return self


def parse_scene(document: object, where: str) -> Scene:
    """Validate a scene document.

    Args:
        document: what ``json.load`` returned.
        where: the file, for the message.

    Raises:
        InputError: the first fault found, with file and field.
    """
    try:
        return Scene.model_validate(document)
    except ValidationError as error:
        raise first_fault(error, where) from None


def load_scene(path: str | Path) -> Scene:
    """Read a scene from a JSON file.

    Raises:
        InputError: the file is missing, is not JSON, or is not a scene.
    """
    return parse_scene(read_json(Path(path)), str(path))
