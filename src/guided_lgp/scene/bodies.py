"""Tables, boxes and obstacles of the scene document."""

import math
import re
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import (
    AfterValidator,
    Field,
    ValidationInfo,
    ValidatorFunctionWrapHandler,
    WrapValidator,
    model_validator,
)

from guided_lgp.faults import Document, brief
from guided_lgp.poses import Array, apply, compose, pose, quaternion, rotation_matrix
from guided_lgp.scene.shapes import Convex, Shape, Vector, hull, read_mesh
from guided_lgp.scene.tolerances import GRASP_ANGLE, GRASP_OFFSET, LEVEL_ANGLE


def _no_more_than(most: float, hint: str) -> WrapValidator:
    """Suspect another unit in numbers that are too large."""

    def check(value: Any, within: ValidatorFunctionWrapHandler) -> Any:
        if isinstance(value, int | float) and abs(value) > most:
            raise ValueError(f"{brief(value)} is too large: {hint}")
        return within(value)

    return WrapValidator(check)


METRES = "lengths are in m; is this in mm or cm?"
RADIANS = "angles are in rad; are these degrees?"
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]*")
_COLOUR = re.compile(r"#[0-9a-fA-F]{6}")


def _speakable(name: str) -> str:
    """Names stand in goals, between blanks and parentheses."""
    if not _NAME.fullmatch(name):
        raise ValueError(f"the name {brief(name)} has other characters than letters, digits, _ - .")
    return name


def _known_colour(colour: str) -> str:
    if colour not in COLOURS and not _COLOUR.fullmatch(colour):
        raise ValueError(f"unknown colour {brief(colour)} (#rrggbb, {', '.join(COLOURS)})")
    return colour


COLOURS: dict[str, Vector] = {
    "red": (0.80, 0.16, 0.14),
    "green": (0.20, 0.62, 0.24),
    "blue": (0.13, 0.34, 0.75),
    "yellow": (0.95, 0.78, 0.15),
    "purple": (0.53, 0.27, 0.66),
    "orange": (0.95, 0.52, 0.12),
    "white": (0.92, 0.92, 0.92),
    "black": (0.15, 0.15, 0.15),
    "pink": (0.95, 0.58, 0.72),
    "brown": (0.45, 0.28, 0.15),
    "tray": (0.45, 0.45, 0.47),
}
"""Named colours, RGB in 0..1; a body that is called so has the colour."""

Name = Annotated[
    str,
    Field(max_length=64, json_schema_extra={"pattern": f"^{_NAME.pattern}$"}),
    AfterValidator(_speakable),
]
# strict: neither true nor "0.4" is a number
Coordinate = Annotated[
    float,
    Field(strict=True, ge=-10, le=10, allow_inf_nan=False),
    _no_more_than(10, METRES),
]
Angle = Annotated[
    float,
    Field(strict=True, ge=-2 * math.pi, le=2 * math.pi, allow_inf_nan=False),
    _no_more_than(2 * math.pi, RADIANS),
]
Length = Annotated[
    float,
    Field(strict=True, ge=0.001, le=5, allow_inf_nan=False),
    _no_more_than(5, METRES),
]
Point = tuple[Coordinate, Coordinate, Coordinate]
Component = Annotated[float, Field(strict=True, ge=-1.001, le=1.001, allow_inf_nan=False)]
Pose = tuple[Coordinate, Coordinate, Coordinate, Component, Component, Component, Component]
Quaternion = tuple[Component, Component, Component, Component]
Colour = Annotated[str, AfterValidator(_known_colour)]

TABLE_THICKNESS = 0.04
"""Tables and trays are slabs (m) under their top; what holds them up is left out."""


def _is_default(value: object) -> bool:
    return value is None or value in ("box", "", (), False)


class Table(Document):
    """A fixed support; ``position`` is the centre of its top (m), ``yaw`` in rad."""

    name: Name
    position: Point
    half_extents: tuple[Length, Length]
    yaw: Angle = 0.0
    colour: Colour | None = Field(default=None, exclude_if=_is_default)

    @property
    def convex(self) -> Convex:
        """The slab."""
        return Convex("box", (*self.half_extents, TABLE_THICKNESS / 2))

    @property
    def top(self) -> Vector:
        """Centre of the top (m)."""
        return self.position

    @property
    def placement(self) -> Array:
        """Pose (7,) of the slab's centre."""
        x, y, top = self.position
        return pose((x, y, top - TABLE_THICKNESS / 2), self.yaw)


_NO_SIZE = (0.0, 0.0, 0.0)
_ROUNDED = 1e-2
"""How far rounding may put the length of a quaternion off one."""


class Solid(Document):
    """A convex body: a box, a cylinder on its base, or the hull of a mesh."""

    name: Name
    size: tuple[Length, Length, Length] = _NO_SIZE
    """Full extents (m) in the body's frame; those of a mesh follow from it."""
    position: Point
    """Of the centre (m); of a mesh, of the origin that its vertices are given from."""
    yaw: Angle = 0.0
    shape: Shape = Field(default="box", exclude_if=_is_default)
    vertices: tuple[Point, ...] = Field(default=(), exclude_if=_is_default)
    """Of a mesh (m)."""
    mesh: str | None = Field(default=None, exclude_if=_is_default)
    """Instead of ``vertices``: a file that has them, relative to the scene's."""
    quaternion: Quaternion | None = Field(default=None, exclude_if=_is_default)
    """Instead of ``yaw``: ``[x, y, z, w]`` of a body that lies on another face."""
    colour: Colour | None = Field(default=None, exclude_if=_is_default)

    @property
    def convex(self) -> Convex:
        """The body about its own frame."""
        x, y, z = self.size
        return Convex(self.shape, (x / 2, y / 2, z / 2), self.vertices)

    @property
    def top(self) -> Vector:
        """Centre of the top (m) of a body that stands."""
        x, y, z = self.position
        return x, y, z + self.size[2] / 2

    @property
    def placement(self) -> Array:
        """Pose (7,) of its frame."""
        if self.quaternion is None:
            return pose(self.position, self.yaw)
        return np.array([*self.position, *_unit(self.quaternion)])

    @model_validator(mode="after")
    def _known_form(self, info: ValidationInfo) -> "Solid":
        """Read the mesh, and put the frame of its hull where the centre of mass is."""
        if self.mesh is not None:
            folder = (info.context or {}).get("folder", Path())
            self.become(shape="mesh", mesh=None, vertices=_points(read_mesh(folder / self.mesh)))
        if (self.shape == "mesh") != bool(self.vertices):
            raise ValueError("a mesh has vertices, or the file of a mesh; nothing else has")
        if self.shape == "mesh":
            self._take_hull()
        elif self.size == _NO_SIZE:
            raise ValueError("size is missing")
        if self.shape == "cylinder" and self.size[0] != self.size[1]:
            raise ValueError(f"a cylinder is as long as wide, not {self.size[0]} by {self.size[1]}")
        return self

    def _take_hull(self) -> None:
        vertices, origin = hull(np.array(self.vertices))
        if origin.any():
            self.become(position=_rounded(apply(self.placement, origin)))
            self._move_frame(np.eye(3), origin)
        self.become(vertices=_points(vertices), size=_extents(vertices))

    def _move_frame(self, turn: Array, origin: Array) -> None:
        """The body's frame is turned (3, 3) back, and then moved to an origin (3,)."""

    def become(self, **changes: object) -> None:
        """While the document is read, bring it into the form that the rest of it is in."""
        self.__dict__.update(changes)


class Obstacle(Solid):
    """A body that is neither moved nor stood on, turned in any way."""


class Box(Solid):
    """A movable body, as a rule a box; it stands on ``on``, or is held by that gripper."""

    position: Point = (0.0, 0.0, 0.0)
    """Not of a body in a hand: its pose follows from the hand's."""
    on: Name = Field(default="", exclude_if=_is_default)
    grasp: Pose | None = Field(default=None, exclude_if=_is_default)
    """Of a body in a hand, whose gripper ``on`` names: pose ``[x, y, z, qx, qy, qz, qw]`` in the
    frame of the tool (x out of the palm, fingers close along y). By default, as deep as it goes."""
    grasps: tuple[Pose, ...] = Field(default=(), exclude_if=_is_default)
    """The ways in which hands may hold the body, and no others: poses of the tool's frame in the
    body's. By default all that close on two of its upright sides."""
    fixed: bool = Field(default=False, strict=True, exclude_if=_is_default)
    """A body that others may stand on, but that nobody moves; ``on`` may then be left out."""

    @property
    def grasp_poses(self) -> Array:
        """The given grasps (n, 7)."""
        return np.array([(*grasp[:3], *_unit(grasp[3:])) for grasp in self.grasps])

    @property
    def grasp_widths(self) -> tuple[float, ...]:
        """The sides (m) between the fingers: of each given grasp, or of those that there may be."""
        closing = (rotation_matrix(grasp[3:])[:, 1] for grasp in self.grasp_poses)
        given = tuple(self.size[int(np.argmax(np.abs(axis)))] for axis in closing)
        return given or self.size[:2]

    @model_validator(mode="after")
    def _on_a_face(self) -> "Box":
        """Turn a body that lies on another face into one that stands."""
        if not self.on and not self.fixed:
            raise ValueError("on is missing: the table or box that it stands on")
        if self.quaternion is not None:
            turn = rotation_matrix(_unit(self.quaternion))
            turned = self._turned_mesh(turn) if self.shape == "mesh" else self._turned(turn)
            self.become(quaternion=None, **turned)
        return self

    @model_validator(mode="after")
    def _known_grasps(self) -> "Box":
        if self.fixed and self.grasps:
            raise ValueError("grasps: nobody holds a fixed body")
        for number, grasp in enumerate(self.grasp_poses):
            fault = _grasp_fault(grasp, self.shape)
            if fault:
                raise ValueError(f"grasps.{number}: {fault}")
        return self

    def _move_frame(self, turn: Array, origin: Array) -> None:
        if self.grasps:
            frame = np.array([*-origin, *quaternion(turn)])
            moved = compose(frame, self.grasp_poses)
            self.become(grasps=tuple(tuple(grasp) for grasp in moved.tolist()))

    def _turned_mesh(self, turn: Array) -> dict[str, object]:
        vertices, origin = hull(np.array(self.vertices) @ turn.T)
        self._move_frame(turn, origin)
        centre = _rounded(np.array(self.position) + origin)
        points, size = _points(vertices), _extents(vertices)
        return {"vertices": points, "position": centre, "size": size, "yaw": 0.0}

    def _turned(self, turn: Array) -> dict[str, object]:
        """A body that lies on another face is one of other extents."""
        up = int(np.argmax(np.abs(turn[2])))
        tilted = abs(turn[2, up]) < math.cos(LEVEL_ANGLE)
        if tilted or (self.shape == "cylinder" and up != 2):
            raise ValueError("with this quaternion, the body has no flat face down")
        first, second = (axis for axis in range(3) if axis != up)
        size = self.size[first], self.size[second], self.size[up]
        yaw = math.atan2(turn[1, first], turn[0, first])
        self._move_frame(rotation_matrix(pose(np.zeros(3), -yaw)[3:]) @ turn, np.zeros(3))
        return {"size": size, "yaw": yaw}


Body = Table | Box | Obstacle


def colour_of(body: Body) -> Vector | None:
    """RGB in 0..1: as declared, or what its name says, if anything."""
    if body.colour is None or body.colour in COLOURS:
        return COLOURS.get(body.colour or body.name)
    red, green, blue = (int(body.colour[at : at + 2], 16) / 255 for at in (1, 3, 5))
    return red, green, blue


def _unit(quaternion: Quaternion) -> Array:
    """The quaternion, whose length rounding may have changed.

    Raises:
        ValueError: it is no rotation at all.
    """
    length = math.hypot(*quaternion)
    if abs(length - 1) > _ROUNDED:
        raise ValueError(f"a quaternion has length 1, not {length:.3g}")
    return np.array(quaternion) / length


def _grasp_fault(grasp: Array, shape: Shape) -> str:
    """Why no hand can hold a standing body so: at a pose (7,) of the tool in its frame."""
    approach, closing, _ = rotation_matrix(grasp[3:]).T
    across = np.hypot(*closing[:2]) if shape == "cylinder" else np.abs(closing[:2]).max()
    if across < math.cos(GRASP_ANGLE / 2):
        return "the fingers close along neither x nor y of the body"
    if abs(closing @ grasp[:3]) > GRASP_OFFSET / 2:
        middle = 1e3 * abs(closing @ grasp[:3])
        return f"the middle between the fingers is {middle:.1f} mm beside that of the body"
    return "the hand comes from below" if approach[2] > math.sin(GRASP_ANGLE / 2) else ""


def _points(points: Array) -> tuple[Vector, ...]:
    return tuple((float(x), float(y), float(z)) for x, y, z in points)


def _extents(vertices: Array) -> Vector:
    """Of the box around vertices (n, 3), centred at the origin (m)."""
    return _rounded(2 * np.abs(vertices).max(axis=0))


def _rounded(vector: Array) -> Vector:
    x, y, z = (round(float(value), 6) for value in vector)
    return x, y, z
