"""The robot file: what a robot's description does not say by itself.

Lengths in m, angles in rad. ``<side>`` in a name stands for the arm's ``side``, so that an arm that
mirrors another one has the same names but for that.
"""

from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from guided_lgp.documents import read_yaml
from guided_lgp.faults import Document, validated

Number = Annotated[float, Field(allow_inf_nan=False)]
Length = Annotated[float, Field(gt=0, le=10, allow_inf_nan=False)]
Names = Annotated[tuple[str, ...], Field(min_length=1)]
SIDE = "<side>"
Axis = Literal["x", "y", "z", "-x", "-y", "-z"]


class DescriptionFiles(Document):
    """Where URDF and SRDF are."""

    urdf: str
    """In the package; without one, relative to the robot file."""
    srdf: str | None = None
    package: str | None = None
    """An installed Python package that ships the files."""
    packages: dict[str, str] = Field(default_factory=dict)
    """Folders for ``package://NAME`` in the URDF, where they are not above it."""
    limits: Literal["soft", "hard"] = "soft"
    """Whether joints keep inside the limits of the URDF's safety controllers, as real arms do."""


class FixedJoint(Document):
    """A joint that keeps the value that the scene gives it."""

    joint: str
    limits: tuple[Number, Number]
    default: Number


class ToolDocument(Document):
    """The frame between the fingertips, in which objects are held."""

    link: str
    offset: tuple[Number, Number, Number] = (0.0, 0.0, 0.0)
    """Of the frame's origin in the link."""
    approach: Axis
    """The link's axis that points out of the palm."""
    closing: Axis
    """The link's axis along which the fingers close."""
    palm_front: Number | None = None
    """Of the palm along the approach, from the frame's origin. Derived: of the palm's shape."""


class GapDocument(Document):
    """Distance of the fingertips at a joint value a: ``sine sin a + cosine cos a + offset``."""

    sine: Number
    cosine: Number
    offset: Number


class FingersDocument(Document):
    """The joints that open a hand; all follow the first one, by the URDF's mimic factors."""

    joints: tuple[str, ...] = ()
    """None for jaws that do not move."""
    ratios: tuple[Number, ...] = ()
    """What each joint makes of the first one's value. Derived: the URDF's mimic factors."""
    gap: GapDocument | None = None
    """Derived: of the fingers' shapes."""
    lever: Length | None = None
    """How far a fingertip moves per rad (or m) of the joints. Derived: of the fingers' shapes."""
    grasp_width: Length | None = None
    """Widest side of an object that the fingers close across. Derived: 5 mm less than the gap."""
    force: Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)] = 40.0
    """Largest force (N) with which they press on an object from either side."""
    pad: Length = 0.01
    """Mean distance of the points of a fingertip's pad from its middle."""


class SegmentsDocument(Document):
    """Links at the ends of the arm's segments, and how far those reach beyond their axes."""

    ends: Names
    radius: Length


class ArmDocument(Document):
    """One arm with its hand."""

    side: str = ""
    mirrors: str | None = None
    """The arm of which this one is the mirror image at the plane y = 0 of the base. All else is
    that arm's, its names with the own side; values are the mirrored arm's."""
    signs: tuple[Literal[-1, 1], ...] = ()
    """They turn joint values of one arm into the mirror image with the other. Derived."""
    joints: Names
    home: tuple[Number, ...]
    redundant: str | None = None
    """The joint that parametrises the inverse kinematics of an arm with seven."""
    tool: ToolDocument
    hand_links: Names
    """The palm first."""
    hand_radius: Length | None = None
    """Reach of the open hand beyond its tool frame, sideways. Derived: of its shapes."""
    segments: SegmentsDocument | None = None
    """Derived: the links between neighbouring joints."""
    fingers: FingersDocument = FingersDocument()
    lever_arms: tuple[Number, ...] | None = None
    """How far each joint moves the tool frame per rad, at most. Derived."""
    metric: tuple[Number, ...] | None = None
    """How far each joint moves a point of hand or held box per rad; the metric of paths. Derived:
    the lever arms and 15 cm."""
    spheres: dict[str, tuple[tuple[Number, Number, Number, Length], ...]] | None = None
    """By link: centre in the link's frame, and radius. Derived: around the links' shapes."""
    spheres_between_arms: tuple[int, ...] | None = None
    """Which of them stand for the arm against another arm. Derived: the largest of each link."""

    @model_validator(mode="before")
    @classmethod
    def _own_names(cls, data: Any) -> Any:
        side = data.get("side", "") if isinstance(data, dict) else ""
        return _replaced(data, SIDE, side) if isinstance(side, str) else data

    @model_validator(mode="after")
    def _one_value_per_joint(self) -> "ArmDocument":
        for field in ("home", "lever_arms", "metric", "signs"):
            values = getattr(self, field)
            if values and len(values) != len(self.joints):
                raise ValueError(f"{field} has {len(values)} values for {len(self.joints)} joints")
        if len(self.fingers.ratios) not in (0, len(self.fingers.joints)):
            raise ValueError(f"fingers have {len(self.fingers.ratios)} ratios for their joints")
        if len(self.joints) != 6 + (self.redundant is not None):
            fault = f"an arm of {len(self.joints)} joints, redundant: {self.redundant or 'none'}"
            raise ValueError(f"{fault} (six joints, or seven with a redundant one)")
        if self.redundant is not None and self.redundant not in self.joints:
            accepted = ", ".join(self.joints)
            raise ValueError(f"redundant {self.redundant} is no joint of the arm ({accepted})")
        return self


class RobotDocument(Document):
    """The whole file."""

    description: DescriptionFiles
    base_link: str
    """The link that a scene's ``robot.base`` places: the root of the URDF."""
    stand: tuple[Length, Length] = (0.1, 0.1)
    """Half extents of the column under the base link, where a scene raises it."""
    fixed_joints: dict[str, FixedJoint] = Field(default_factory=dict)
    acceleration: Length | None = None
    """Limits of acceleration over those of velocity (1/s); 2 where it is not stated."""
    jerk: Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)] = 20.0
    """Limits of jerk over those of acceleration (1/s)."""
    balanced: bool = False
    """Whether springs or counterweights carry the arms' own weight, so that motors need not."""
    arms: Annotated[dict[str, ArmDocument], Field(min_length=1)]
    """By name of the gripper, in the order of a configuration."""

    @model_validator(mode="before")
    @classmethod
    def _mirrored_arms(cls, data: Any) -> Any:
        arms = data.get("arms") if isinstance(data, dict) else None
        if not isinstance(arms, dict):
            return data
        return data | {"arms": {name: _whole(name, arm, arms) for name, arm in arms.items()}}


def read_document(file: Path) -> RobotDocument:
    """Read and validate a robot file.

    Raises:
        InputError: the first fault, with file and field.
    """
    data = read_yaml(file, "a robot file")
    return validated(RobotDocument.model_validate, data, str(file))


def _whole(name: str, arm: Any, arms: dict[str, Any]) -> Any:
    """An arm with what it takes over from the one that it mirrors."""
    if not isinstance(arm, dict) or "mirrors" not in arm:
        return arm
    if arm["mirrors"] not in arms or arm["mirrors"] == name:
        accepted = ", ".join(other for other in arms if other != name)
        raise ValueError(f"{name} mirrors unknown arm {arm['mirrors']} ({accepted})")
    own = arm.keys() - {"side", "mirrors", "signs"}
    if own:
        raise ValueError(f"{name} mirrors an arm and has {min(own)} (side, mirrors, signs)")
    original = arms[arm["mirrors"]]
    return original | arm if isinstance(original, dict) else arm


def _replaced(data: Any, old: str, new: str) -> Any:
    """The data with a text replaced in all strings."""
    if isinstance(data, str):
        return data.replace(old, new)
    if isinstance(data, dict):
        return {_replaced(k, old, new): _replaced(v, old, new) for k, v in data.items()}
    if isinstance(data, list):
        return [_replaced(item, old, new) for item in data]
    return data
