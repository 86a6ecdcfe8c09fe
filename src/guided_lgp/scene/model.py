"""The scene document: robot, tables and boxes (DESIGN §3)."""

import math
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from guided_lgp.documents import read_json
from guided_lgp.domains import load_domain
from guided_lgp.errors import InputError
from guided_lgp.logic import State, Symbols

GRIPPERS = ("pr2L", "pr2R")

Name = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_-]*$", max_length=32)]
# strict: neither true nor "0.4" is a number
Coordinate = Annotated[float, Field(strict=True, ge=-10, le=10, allow_inf_nan=False)]
Angle = Annotated[float, Field(strict=True, ge=-2 * math.pi, le=2 * math.pi, allow_inf_nan=False)]
Length = Annotated[float, Field(strict=True, ge=0.001, le=5, allow_inf_nan=False)]


class _Document(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Robot(_Document):
    """The PR2 with a fixed base (m, in the plane) and torso (m)."""

    model: Literal["pr2"] = "pr2"
    base: tuple[Coordinate, Coordinate, Coordinate] = (0.0, 0.0, 0.0)
    torso: Annotated[float, Field(strict=True, ge=0.0115, le=0.325)] = 0.28


class Table(_Document):
    """A fixed support; ``position`` is the centre of its top (m), ``yaw`` in rad."""

    name: Name
    position: tuple[Coordinate, Coordinate, Coordinate]
    half_extents: tuple[Length, Length]
    yaw: Angle = 0.0


class Box(_Document):
    """A movable box; ``position`` is its centre (m), ``size`` its full extents (m)."""

    name: Name
    size: tuple[Length, Length, Length]
    position: tuple[Coordinate, Coordinate, Coordinate]
    yaw: Angle = 0.0
    on: Name


class Scene(_Document):
    """An initial configuration x_0 with its symbols."""

    name: str = "scene"
    robot: Robot = Robot()
    tables: Annotated[tuple[Table, ...], Field(min_length=1)]
    boxes: Annotated[tuple[Box, ...], Field(min_length=1)]

    @property
    def symbols(self) -> Symbols:
        """The symbols of the scene by logic type, as declared."""
        return load_domain().symbols(
            gripper=GRIPPERS,
            box=(box.name for box in self.boxes),
            table=(table.name for table in self.tables),
        )

    @property
    def state(self) -> State:
        """The initial symbolic state."""
        return State.of({box.name: box.on for box in self.boxes})

    @model_validator(mode="after")
    def _names(self) -> "Scene":
        names = [*GRIPPERS, *(t.name for t in self.tables), *(b.name for b in self.boxes)]
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"name {name!r} is used twice")
        for box in self.boxes:
            if box.on not in names or box.on in GRIPPERS or box.on == box.name:
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
        first = error.errors()[0]
        field = ".".join(str(part) for part in first["loc"])
        raise InputError(f"{where}: {field}" if field else where, first["msg"]) from None


def load_scene(path: Path) -> Scene:
    """Read a scene from a JSON file.

    Raises:
        InputError: the file is missing, is not JSON, or is not a scene.
    """
    return parse_scene(read_json(path), str(path))
