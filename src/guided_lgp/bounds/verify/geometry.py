"""Grasps, placements and touches, checked for one configuration.

Poses are plain sequences of seven floats here, ``[x, y, z, qx, qy, qz, qw]``: for single poses
that is many times faster than arrays.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from guided_lgp.robots import Robot
from guided_lgp.scene import Scene
from guided_lgp.scene.model import grasp_axis
from guided_lgp.scene.world import MARGIN, Penetration

GRASP_OFFSET = 0.003
"""How far (m) a grasped box may be off the middle between the fingers."""
GRASP_ANGLE = 0.03
"""How far (rad) its side may be off the fingers' closing direction."""
GRASP_INSET = 0.005
"""How far inside the box's side the fingertips' centre lies at least (m)."""
HAND_DEPTH = 0.02
"""How deep (m) a hull of the hand may reach into the box it holds, approaches or leaves. The
hulls bridge the hollow of the fingers: on a box that fills the hand they overlap it by 15 mm."""
LEVEL_ANGLE = 0.02
"""Tilt (rad) up to which a box at rest is level."""
CARRY_ANGLE = 0.05
"""Tilt (rad) up to which a box that carries others is level while it moves."""
HEIGHT = 0.002
"""How far (m) the bottom of a box may be off its support's top."""
BALANCE_INSET = 0.005
"""How far (m) inside the support's top a centre of mass lies at least."""

Pose = Sequence[float]
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Violation:
    """A constraint that does not hold."""

    constraint: str
    amount: float
    """By how much, in m, rad, or units of the limit; 0 where there is no amount."""
    action: int = -1
    """Index of the action in the skeleton, where there is one."""
    time: float = math.nan
    """Where on a path (s)."""

    def __str__(self) -> str:
        return f"{self.constraint} by {self.amount:.3g}"


def box_sizes(scene: Scene) -> dict[str, tuple[float, float, float]]:
    """Extents (m) of every box."""
    return {box.name: box.size for box in scene.boxes}


def axes_of(pose: Pose) -> tuple[Vector, Vector, Vector]:
    """The body's x, y and z axis in the world."""
    _, _, _, x, y, z, w = pose
    return (
        (1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)),
        (2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)),
        (2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)),
    )


def dot(first: Sequence[float], second: Sequence[float]) -> float:
    """Scalar product of two vectors (3,)."""
    return first[0] * second[0] + first[1] * second[1] + first[2] * second[2]


def offset_of(origin: Sequence[float], target: Sequence[float]) -> Vector:
    """From one position to another, in the world."""
    return (target[0] - origin[0], target[1] - origin[1], target[2] - origin[2])


def angle_of(cosine: float) -> float:
    """The angle (rad) of a cosine that rounding may have put beyond one."""
    return math.acos(max(-1.0, min(1.0, cosine)))


def grasp_faults(
    box: str, size: Vector, placement: Pose, tool: Pose, palm_front: float
) -> list[Violation]:
    """Whether the gripper is at the box: closing across it, fingertips on it, palm outside.

    Args:
        box: its name.
        size: its extents (m).
        placement: its pose.
        tool: pose of the gripper's tool frame.
        palm_front: x of the palm's front in the tool frame (m).
    """
    approach, closing, _ = axes_of(tool)
    sides = axes_of(placement)
    offset = offset_of(tool, placement)
    across = grasp_axis(size)
    excess = [
        angle_of(abs(dot(closing, sides[across]))) - GRASP_ANGLE,
        abs(dot(offset, closing)) - GRASP_OFFSET,
    ]
    reach = dot(offset, approach)
    for axis in range(3):
        reach -= size[axis] / 2 * abs(dot(approach, sides[axis]))
        if axis != across:
            excess.append(abs(dot(offset, sides[axis])) - (size[axis] / 2 - GRASP_INSET))
    excess.append(palm_front - MARGIN - reach)
    worst = max(excess)
    return [Violation(f"grasp {box}", worst)] if worst > 0 else []


def placement_faults(
    scene: Scene, boxes: Mapping[str, Pose], support: Mapping[str, str]
) -> list[Violation]:
    """Whether boxes stand level on their supports and do not fall."""
    sizes = box_sizes(scene)
    found = []
    for box, below in support.items():
        x, y, _ = _centre_of_mass(box, boxes, sizes, support)
        if below in sizes:
            placement, half = boxes[below], [side / 2 for side in sizes[below]]
            top, yaw_axes = placement[2] + half[2], axes_of(placement)
            tilted = max(angle_of(axes_of(boxes[box])[2][2]), angle_of(yaw_axes[2][2]))
        else:
            table = next(t for t in scene.tables if t.name == below)
            placement, half, top = table.position, list(table.half_extents), table.position[2]
            cosine, sine = math.cos(table.yaw), math.sin(table.yaw)
            yaw_axes = ((cosine, sine, 0.0), (-sine, cosine, 0.0), (0.0, 0.0, 1.0))
            tilted = angle_of(axes_of(boxes[box])[2][2])
        if tilted > LEVEL_ANGLE:
            found.append(Violation(f"level {box}", tilted))
            continue
        gap = abs(boxes[box][2] - sizes[box][2] / 2 - top)
        if gap > HEIGHT:
            found.append(Violation(f"height {box}", gap))
        offset = (x - placement[0], y - placement[1], 0.0)
        overhang = max(
            abs(dot(offset, yaw_axes[axis])) - half[axis] + BALANCE_INSET for axis in (0, 1)
        )
        if overhang > 0:
            found.append(Violation(f"balance {box}", overhang))
    return found


def _centre_of_mass(
    box: str,
    boxes: Mapping[str, Pose],
    sizes: Mapping[str, Vector],
    support: Mapping[str, str],
) -> Vector:
    """Of the box and everything it carries; boxes are equally dense."""
    if box not in support.values():
        x, y, z = boxes[box][:3]
        return x, y, z
    group = [box]
    for base in group:  # grows while it is walked
        group += [above for above, below in support.items() if below == base]
    weights = [math.prod(sizes[name]) for name in group]
    x, y, z = (
        sum(w * boxes[name][axis] for w, name in zip(weights, group, strict=True)) / sum(weights)
        for axis in range(3)
    )
    return x, y, z


def declared(
    overlap: Penetration,
    robot: Robot,
    held: Collection[tuple[str, str]],
    support: Mapping[str, str],
) -> bool:
    """Whether two bodies may touch: hand and held box, box and its support.

    Args:
        overlap: of the two bodies.
        robot: whose hands they may be.
        held: pairs of a box and a gripper that may touch it.
        support: what each box stands on.
    """
    for one, other in ((overlap.first, overlap.second), (overlap.second, overlap.first)):
        if support.get(one) == other:
            return True
        if any(one == box and other in robot.arms[g].hand_links for box, g in held):
            return overlap.depth <= HAND_DEPTH
    return False
