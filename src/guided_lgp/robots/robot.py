"""A robot as the planner sees it: arms with hands, their joints, limits and measures."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np

from guided_lgp.poses import IDENTITY, Array
from guided_lgp.robots.chain import turn
from guided_lgp.robots.description import Description
from guided_lgp.robots.document import FixedJoint
from guided_lgp.robots.kinematics import Kinematics

CLEARANCE = 0.01
"""How far (m) fingers open beyond either side of what they take: motions keep 3 mm from everything,
and a hand that is not quite where it should be touches nothing yet. Wider, they would need more
room beside it: two rows of boxes 4.5 cm apart leave 1.7 cm around fingertips that hold one."""


class Gap(Protocol):
    """How far two fingers are apart, over the value of their joints."""

    def gap(self, value: float) -> float:
        """Distance (m) at a value (rad or m)."""
        ...

    def value(self, gap: float) -> float:
        """Value at a distance (m)."""
        ...


@dataclass(frozen=True)
class TurningGap:
    """Distance of two fingertips that turn together: ``sine sin a + cosine cos a + offset`` (m)."""

    sine: float
    cosine: float
    offset: float

    def gap(self, value: float) -> float:
        """Distance (m) at a joint value (rad)."""
        return float(self.sine * np.sin(value) + self.cosine * np.cos(value) + self.offset)

    def value(self, gap: float) -> float:
        """Joint value (rad) at a distance (m)."""
        amplitude = np.hypot(self.sine, self.cosine)
        sine = np.clip((gap - self.offset) / amplitude, -1.0, 1.0)
        return float(np.arcsin(sine) - np.arctan2(self.cosine, self.sine))


@dataclass(frozen=True, eq=False)
class Fingers:
    """The joints that open a hand. All follow one value (rad or m)."""

    joints: tuple[str, ...]
    ratios: Array
    """(n,) what each joint makes of the value: a factor."""
    slice: slice
    """Where they stand in the moving joints of the robot."""
    lower: float
    upper: float
    velocity: float
    """Limit (rad/s or m/s)."""
    lever: float
    """How far (m) a fingertip moves at most per unit of the value."""
    grasp_width: float
    """Widest side (m) of an object that they close across."""
    force: float
    """Largest force (N) with which they press on an object from either side."""
    pad: float
    """Mean distance (m) of the points of a fingertip's pad from its middle."""
    gap: Gap

    def opening(self, value: float) -> float:
        """Distance (m) between the fingertips at a value."""
        return self.gap.gap(value)

    def value(self, opening: float) -> float:
        """The value, within the limits, that opens the fingers so far (m)."""
        return float(np.clip(self.gap.value(opening), self.lower, self.upper))

    def opening_for(self, width: float) -> float:
        """How far (m) they open around a side of a width (m), as far as they can."""
        return min(width + 2 * CLEARANCE, self.widest)

    def value_around(self, width: float) -> float:
        """The value at which they are open around a side of a width (m)."""
        return self.value(self.opening_for(width))

    @cached_property
    def opened(self) -> float:
        """The value at which they are widest open."""
        return max(self.lower, self.upper, key=self.opening)

    @cached_property
    def closed(self) -> float:
        """The value at which they are closed."""
        return min(self.lower, self.upper, key=self.opening)

    @cached_property
    def widest(self) -> float:
        """Widest distance (m) of the fingertips."""
        return self.opening(self.opened)


@dataclass(frozen=True)
class Sphere:
    """A sphere that covers part of a link: centre in the link's frame and radius (m)."""

    link: str
    centre: tuple[float, float, float]
    radius: float


@dataclass(frozen=True, eq=False)
class Arm:
    """One arm with its hand. Arrays have one row per joint, from shoulder to wrist."""

    gripper: str
    joints: tuple[str, ...]
    slice: slice
    """Where they stand in a configuration of the robot."""
    home: Array
    """(n,) rad: the posture at the arm's side, out of the other arms' way."""
    limits: Array
    """(n, 2) rad. A joint that turns without end has two turns, so that a configuration stays a
    vector of plain numbers."""
    velocity_limits: Array
    """(n,) rad/s."""
    acceleration_limits: Array
    """(n,) rad/s^2."""
    jerk_limits: Array
    """(n,) rad/s^3."""
    effort_limits: Array
    """(n,) Nm that the motors exert at most; infinite where nobody says."""
    redundant: int | None
    """Index of the joint that parametrises the inverse kinematics, if the arm has one too many."""
    mirror_of: str | None
    """The gripper of the arm of which this one is the mirror image, at the base's plane y = 0."""
    signs: Array
    """(n,) turn joint values of one arm into the mirror image with the other; ones if none."""
    tool_link: str
    tool_in_link: Array
    """(7,) of the tool frame in its link: x points out of the palm, the fingers close along y."""
    palm_front: float
    """x of the palm's front in the tool frame (m)."""
    links: tuple[str, ...]
    """Links with collision geometry that the arm moves, the hand left out."""
    hand_links: tuple[str, ...]
    """Palm, then fingers: the links that may touch the held object."""
    hand_radius: float
    """Reach (m) of the open hand beyond the tool frame's origin, sideways."""
    segment_ends: tuple[str, ...]
    """Links at the ends of the arm's segments; the hand's end is the tool frame."""
    segment_radius: float
    """Reach (m) of the segments beyond their axes."""
    lever_arms: Array
    """(n,) m. Longest distance from each joint's axis to the tool frame, over all configurations:
    a joint that turns by an angle moves the tool by at most its lever times the angle."""
    metric: Array
    """(n,) m per rad: how far a point of hand or held object moves; the metric of paths."""
    spheres: tuple[Sphere, ...]
    """Cover arm and open hand."""
    spheres_between_arms: tuple[int, ...]
    """Indices of those that stand for the arm against another arm."""
    fingers: Fingers

    @cached_property
    def tool_is_link(self) -> bool:
        """Whether the tool frame is the frame of its link."""
        return np.array_equal(self.tool_in_link, IDENTITY)


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot. Configurations ``q`` (n,) are the joints of all arms, in the order of the arms."""

    name: str
    description: Description
    base_link: str
    """The root of the URDF, which a scene places."""
    stand: tuple[float, float]
    """Half extents (m) of the column under the base link, where a scene raises it."""
    fixed_joints: Mapping[str, FixedJoint]
    """Joints that keep the value that the scene gives them, by their name in the scene."""
    arms: Mapping[str, Arm]
    """By gripper."""
    balanced: bool = False
    """Whether springs or counterweights carry the arms' own weight."""
    tilt: tuple[float, float] = (0.0, 0.0)
    """Roll and pitch (rad) of the base link where it is mounted."""

    @property
    def mounting(self) -> Array:
        """Rotation (3, 3) of the base link in the level frame of the base."""
        x, y, _ = np.eye(3)
        roll, pitch = map(np.array, self.tilt)
        return np.asarray(turn(y, pitch) @ turn(x, roll))

    @property
    def urdf(self) -> Path:
        """The description, ready for PyBullet and pinocchio."""
        return self.description.urdf

    @property
    def disabled_pairs(self) -> frozenset[frozenset[str]]:
        """Pairs of links that are not checked for self-collision."""
        return self.description.disabled_pairs

    @cached_property
    def grippers(self) -> tuple[str, ...]:
        """Names of the hands, which are the symbols of the logic."""
        return tuple(self.arms)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """The joints (n,) of a configuration q."""
        return tuple(joint for arm in self.arms.values() for joint in arm.joints)

    @cached_property
    def moving_joints(self) -> tuple[str, ...]:
        """Every joint that moves: the arms', then the fingers of all hands."""
        fingers = (joint for arm in self.arms.values() for joint in arm.fingers.joints)
        return (*self.joint_names, *fingers)

    @cached_property
    def moving_links(self) -> frozenset[str]:
        """The links of all arms and hands."""
        arms = self.arms.values()
        return frozenset(link for arm in arms for link in (*arm.links, *arm.hand_links))

    def finger_values(self, moving: Array) -> dict[str, float]:
        """The value of each hand's fingers in a row (m,) of all moving joints, by gripper."""
        hands = {gripper: arm.fingers for gripper, arm in self.arms.items() if arm.fingers.joints}
        return {
            gripper: float(moving[fingers.slice.start] / fingers.ratios[0])
            for gripper, fingers in hands.items()
        }

    @cached_property
    def home(self) -> Array:
        """(n,) rad: all arms at their side."""
        return np.concatenate([arm.home for arm in self.arms.values()])

    @cached_property
    def position_limits(self) -> Array:
        """(n, 2) rad."""
        return np.concatenate([arm.limits for arm in self.arms.values()])

    @cached_property
    def velocity_limits(self) -> Array:
        """(n,) rad/s."""
        return np.concatenate([arm.velocity_limits for arm in self.arms.values()])

    @cached_property
    def acceleration_limits(self) -> Array:
        """(n,) rad/s^2."""
        return np.concatenate([arm.acceleration_limits for arm in self.arms.values()])

    @cached_property
    def jerk_limits(self) -> Array:
        """(n,) rad/s^3."""
        return np.concatenate([arm.jerk_limits for arm in self.arms.values()])

    @cached_property
    def effort_limits(self) -> Array:
        """(n,) Nm."""
        return np.concatenate([arm.effort_limits for arm in self.arms.values()])

    @cached_property
    def continuous(self) -> tuple[int, ...]:
        """Indices into a configuration of the joints that turn without end."""
        joints = self.description.joints
        return tuple(i for i, name in enumerate(self.joint_names) if joints[name].limits is None)

    @cached_property
    def kinematics(self) -> Kinematics:
        """Forward kinematics of the whole robot."""
        return Kinematics(self.urdf, self.joint_names)
