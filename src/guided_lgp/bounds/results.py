"""What the two bounds of the NLP return.

Conventions, everywhere: configurations ``q`` (n,) are the joints of the robot's arms in the order
of ``Robot.joint_names`` (rad). Poses are arrays
``[x, y, z, qx, qy, qz, qw]`` of the box centre in the world (m). The world frame is the scene's:
its origin on the floor under the robot's base.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from guided_lgp.logic import Skeleton

if TYPE_CHECKING:
    from guided_lgp.bounds.path.situation import Step

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Keyframe:
    """A configuration x_k: arm joints (n,) in rad and the pose (7,) of every box."""

    q: Array
    boxes: Mapping[str, Array]


@dataclass(frozen=True)
class Failure:
    """Why a bound gave up: the constraint that stays violated, and at which action."""

    action: int
    """Index of the action in the skeleton, from 0."""
    constraint: str
    """What is violated, as a rule a term with its symbols: ``clear l_forearm_link tab2``."""
    violation: float
    """By how much, in m or rad; NaN where there is no amount (a sampling planner gave up)."""
    tried: str
    """What was tried, in words."""

    def __str__(self) -> str:
        amount = "" if np.isnan(self.violation) else f" by {self.violation:.3g}"
        return f"action {self.action + 1}: {self.constraint} violated{amount} ({self.tried})"


@dataclass(frozen=True)
class CoarseResult:
    """P_coarse(a_1:K): one verified configuration per action (paper, eq. 3)."""

    skeleton: Skeleton
    feasible: bool
    at_switch: tuple[Keyframe, ...] = ()
    """At each switch: the acting gripper is at the box (grasp) or still holds it (place)."""
    after_action: tuple[Keyframe, ...] = ()
    """After each action, when the acting arm has retreated: the configuration x_k of the policy."""
    failure: Failure | None = None
    restarts: int = 1
    """Starts of the solver that it took."""
    time_s: float = field(default=0.0, compare=False)


@dataclass(frozen=True)
class Attachment:
    """The box is rigid in the gripper's tool frame between two indices into ``times``."""

    box: str
    gripper: str
    start: int
    end: int


@dataclass(frozen=True)
class Trajectory:
    """A dense, time-parameterised motion (paper, eq. 4)."""

    joint_names: tuple[str, ...]
    """Every joint that moves (``Robot.moving_joints``), in any order."""
    times: Array
    """(T,) s, strictly increasing."""
    q: Array
    """(T, len(joint_names)) rad, m for prismatic joints."""
    attachments: tuple[Attachment, ...]

    def joints(self, names: Sequence[str]) -> Array:
        """The values (T, len(names)) of some joints, in the order of their names."""
        return self.q[:, [self.joint_names.index(name) for name in names]]


@dataclass(frozen=True)
class PathResult:
    """P(a_1:K): the verified motion for the whole skeleton, or why there is none."""

    skeleton: Skeleton
    feasible: bool
    trajectory: Trajectory | None = None
    at_switch: tuple[Keyframe, ...] = ()
    failure: Failure | None = None
    load: float = 0.0
    """Of firm bounds: with how many N the fingers would just hold what the motion carries."""
    verification: Mapping[str, object] = field(default_factory=dict)
    """Figures of the check in PyBullet: number of configurations, deepest penetration (m)."""
    steps: "tuple[Step, ...]" = field(default=(), compare=False, repr=False)
    """One after the other, as they were found: what the trajectory was made of."""
    time_s: float = field(default=0.0, compare=False)
