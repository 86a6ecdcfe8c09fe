"""How firmly a plan's grasps have to close, and how far."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from guided_lgp.bounds.checks import (
    GRAVITY,
    Violation,
    box_bodies,
    box_sizes,
    closing_axis,
    volumes,
)
from guided_lgp.bounds.results import Array, Attachment, Trajectory
from guided_lgp.bounds.terms.steady import FRICTION, RATIO, on_box
from guided_lgp.bounds.verify.attachments import spans, switches_of
from guided_lgp.bounds.verify.efforts import Carried, carried_boxes, derivatives
from guided_lgp.logic import Skeleton
from guided_lgp.poses import IDENTITY, compose, inverse, rotate
from guided_lgp.scene import Scene
from guided_lgp.scene.world import BOX_DENSITY

MOST = 0.6
"""The share of what the pads can carry that a load may take: at 0.62 boxes stayed still in the
hand, at 0.72 they turned."""
LEAST = 40.0
"""N: softer grips are not worth their risk."""
SQUEEZE = 0.004
"""How far (m) beyond the sides of a box fingers are told to close: they stop at the box."""


@dataclass(frozen=True)
class Grip:
    """How a gripper holds a box from its grasp on."""

    box: str
    gripper: str
    start: int
    """Row of its grasp; 0 where it is held at the start."""
    width: float
    """m of the side that the fingers close across."""
    closing: float
    """Value (rad or m) to which the fingers are told to close; they stop at the box."""
    force: float
    """N from either side."""
    ratio: float
    """Largest share of the pads' capacity that the load takes, riders included."""

    @property
    def need(self) -> float:
        """N from either side that would just hold the load."""
        return self.ratio * self.force

    @property
    def fault(self) -> Violation | None:
        """That the box would turn or slip, if it would."""
        excess = self.ratio - MOST
        return Violation(f"grip {self.gripper} {self.box}", excess) if excess > 0 else None


def grips_of(
    scene: Scene, skeleton: Skeleton, switches: Sequence[int], trajectory: Trajectory
) -> list[Grip]:
    """The grips of a plan, in their order.

    The pads carry a force of 2 mu N and a torque of 2 mu N r about the closing axis, with r the
    mean distance of a pad's points from its middle, less where pads reach over an edge. The force
    N is the least with which the load, its weight and what accelerates it, takes ``RATIO`` of that,
    within what the fingers can.

    Args:
        scene: the initial configuration.
        skeleton: the actions.
        switches: row of each action's switch.
        trajectory: the motion.
    """
    robot = scene.robot.description
    q = trajectory.joints(robot.moving_joints)
    loads = carried_boxes(scene, skeleton, switches, q)
    tools = scene.robot.tool_poses(q[:, : len(robot.joint_names)])
    held = spans(scene.state, skeleton, switches, len(q), lambda state: dict(state.held))
    return [
        _grip(scene, span, loads, tools[span.gripper], trajectory.times)
        for span in sorted(held, key=lambda span: (span.start, span.gripper))
    ]


def chosen_grips(scene: Scene, skeleton: Skeleton, trajectory: Trajectory) -> list[Grip]:
    """The grips that a verified motion chooses: what is held at the start has its grip there."""
    switches = switches_of(scene, skeleton, trajectory)
    assert isinstance(switches, list)
    grips = grips_of(scene, skeleton, switches, trajectory)
    return [grip for grip in grips if grip.start > 0]


def loosest(grips: Sequence[Grip]) -> Grip | None:
    """The grip whose pads have to carry most of what they can."""
    return max(grips, key=lambda grip: grip.ratio, default=None)


def _grip(
    scene: Scene, span: Attachment, loads: Sequence[Carried], tools: Array, times: Array
) -> Grip:
    """How a box is held for a span, by the loads of all hands and the poses (T, 7) of its tool."""
    fingers = scene.robot.description.arms[span.gripper].fingers
    own = next(load for load in loads if load.span.box == span.box and _during(load, span))
    across = closing_axis(IDENTITY.tolist(), inverse(own.grip).tolist())
    width = float(box_sizes(scene)[span.box][across])
    riders = [load for load in loads if load.span.gripper == span.gripper and _during(load, span)]
    body, middle = box_bodies(scene)[span.box], inverse(own.grip)[:3].tolist()
    radius = fingers.pad * on_box(body, middle, across, fingers.pad)
    need = _need(scene, tools, times, riders, radius)
    force = float(np.clip(need / RATIO, LEAST, max(fingers.force, LEAST)))
    closing = fingers.value(width - SQUEEZE)
    return Grip(span.box, span.gripper, span.start, width, closing, force, need / force)


def _during(load: Carried, span: Attachment) -> bool:
    """Whether a load is carried while a span lasts."""
    return load.span.start < span.end and load.span.end > span.start


def _need(
    scene: Scene, tools: Array, times: Array, loads: Sequence[Carried], radius: float
) -> float:
    """The force (N) at which pads just hold their loads, along a motion of the tool (T, 7)."""
    pulls, torques = np.zeros((2, len(tools), 3))
    for load in loads:
        rows = slice(load.span.start, load.span.end + 1)
        centres = compose(tools, load.grip)[:, :3]
        changes = np.pad(derivatives(centres, times)[1], ((1, 1), (0, 0)))
        mass = BOX_DENSITY * volumes(scene)[load.span.box]
        pull = mass * (changes[rows] + np.array([0.0, 0.0, GRAVITY]))
        pulls[rows] += pull
        torques[rows] += np.cross(centres[rows] - tools[rows, :3], pull)
    closing = rotate(tools[:, 3:], np.array([0.0, 1.0, 0.0]))
    along = np.sum(pulls * closing, axis=1)
    sideways = np.linalg.norm(pulls - along[:, None] * closing, axis=1)
    twist = np.abs(np.sum(torques * closing, axis=1)) / radius
    return float(np.maximum(sideways, twist).max(initial=0.0)) / (2 * FRICTION)
