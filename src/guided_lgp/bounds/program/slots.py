"""Where poses and joints stand in the values of a program: variables first, then constants.

Slots of constants are negative until the number of variables is known.
"""

from dataclasses import dataclass
from typing import NamedTuple

from guided_lgp.bounds.program.geometry import GraspSide

ZERO = -1
"""Slot of the constant 0."""


class PlanarPose(NamedTuple):
    """Pose of a level body: slots of x, y, yaw and z in the values, and an offset of z (m)."""

    x: int
    y: int
    yaw: int
    z: int
    offset: float

    @property
    def plane(self) -> tuple[int, int, int]:
        """Slots of x, y and yaw."""
        return self.x, self.y, self.yaw

    @property
    def varies(self) -> bool:
        """Whether the place is not a constant."""
        return max(self.plane) >= 0

    def raised(self, height: float) -> "PlanarPose":
        """The same place, higher (m)."""
        return self._replace(offset=self.offset + height)


class StraightSegment(NamedTuple):
    """The far end of a straight way of the hand from a contact, the hand not turned."""

    joints: tuple[int, ...]
    back: float
    """How far the hand is back along its approach (m)."""
    up: float
    """How far it is up (m)."""


class ArmConfiguration(NamedTuple):
    """An arm that holds a level body: the slots of its joints and the body's pose."""

    held: "HeldBox"
    action: int
    joints: tuple[int, ...]
    pose: PlanarPose
    segments: tuple[StraightSegment, ...] = ()


@dataclass(frozen=True, eq=False)
class HeldBox:
    """A box in a gripper, from its grasp to the end of it: one way in which the hand holds it."""

    gripper: str
    box: str
    pitch: int
    offset: int
    depth: int
    side: GraspSide
    """On which the fingers close."""
    half_height: float
    closed: float
    """How far (m) each finger is from wide open while the hand comes and leaves."""
    given: tuple[float, float, float] | None = None
    """Pitch, offset and depth of a grasp that the scene gives, or begins with."""

    @property
    def grip(self) -> tuple[int, int, int]:
        """Slots of pitch, offset and depth."""
        return self.pitch, self.offset, self.depth


class KeyframeSlots(NamedTuple):
    """Where everything is at one configuration: joint slots by gripper, and boxes."""

    joints: dict[str, tuple[int, ...] | None]
    """None: at its side."""
    boxes: dict[str, PlanarPose | HeldBox]
    """A level pose, or how a box is held at the arm's side."""
