"""Scenes and goals from the tasks of ``guided-tamp-benchmark``, and motions the way back.

A task is a JSON document, which ``shelf/tasks.py`` writes in the environment of that package. Poses
are ``[x, y, z, qx, qy, qz, qw]`` in the world, lengths in m:

- ``name``; ``robot``: ``base``, ``joints`` (those of the fingers last) and ``gripper``, the pose of
  its frame in the hand's,
- ``surfaces``: ``name`` and ``corners`` of the level rectangles on which bodies may stand,
- ``boxes``: ``name``, ``size`` and ``pose`` of all parts of furniture,
- ``bodies``: ``name``, ``vertices`` and the ``corners`` of what they stand on, in their own frames,
  ``handles`` (where the gripper's frame may be in these), ``start`` and ``goal``.

Surfaces become tables, all else obstacles. A body is the convex hull of its mesh. It keeps a
distance of 1 mm from what it stands on, so that its hull includes the corners 1 mm lower. Its frame
is turned about the vertical such that fingers close along an axis.
"""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from guided_lgp.bounds.results import Trajectory
from guided_lgp.poses import Array, apply, compose, inverse, pose, rotation_matrix, yaw_of
from guided_lgp.scene import Box, Scene, parse_scene
from guided_lgp.scene.bodies import TABLE_THICKNESS

Task = Mapping[str, Any]

ROBOT = "panda"
_ARM = 7
_CLEARANCE = 0.001
"""Distance (m) of bodies from what they stand on."""
_FLAT = 0.002
"""How far (m) the top of a part of furniture is from the surface that it carries, at most."""
_HULL = 0.003
"""How much (m) the hull of the robot's base may be lower than the base."""
_LEVEL = 0.01
"""Sine of the angle below the horizontal from which on a hand comes from below."""
_EXACT = "0.0005 0.0005"
"""Distance (m) and angle (rad) within which bodies end: half of what is asked for."""
_TOOL = np.array([0.0, 0.0, 0.1034, 0.0, -math.sqrt(0.5), 0.0, math.sqrt(0.5)])
"""Of the tool's frame in the hand's: between the fingertips, x out of the palm."""


def scene_of(task: Task) -> Scene:
    """The scene of a task."""
    x, y, z, *_ = base = np.array(task["robot"]["base"])
    joints = {
        f"panda_joint{n + 1}": value for n, value in enumerate(task["robot"]["joints"][:_ARM])
    }
    placed = {"model": ROBOT, "base": [x, y, yaw_of(base)], "height": z, "joints": joints}
    surfaces = [_table(surface) for surface in task["surfaces"]]
    document = {
        "name": task["name"],
        "robot": placed,
        "tables": surfaces,
        "boxes": [_box(task, body, surfaces) for body in task["bodies"]],
        "obstacles": [part for box in task["boxes"] for part in _obstacle(box, surfaces, base)],
    }
    return parse_scene(json.loads(json.dumps(document, default=_plain)), task["name"])


def objective_of(task: Task, scene: Scene) -> list[str]:
    """The goals of a task: where its bodies and the arm end."""
    goals = []
    for body, box in zip(task["bodies"], scene.movable, strict=True):
        there = compose(_level(body["goal"]), _offset(body, box))
        numbers = " ".join(repr(float(value)) for value in (*there[:3], yaw_of(there)))
        on = _below(body, body["goal"], [_table(surface) for surface in task["surfaces"]])
        goals.append(f"(at {box.name} {on} {numbers} {_EXACT})")
    ends = " ".join(repr(float(value)) for value in task["robot"]["joints"][:_ARM])
    return [*goals, f"(posture {ROBOT} {ends})"]


def _table(surface: Mapping[str, Any]) -> dict[str, Any]:
    corners = np.array(surface["corners"])
    along, across = corners[1] - corners[0], corners[2] - corners[1]
    return {
        "name": surface["name"],
        "position": corners.mean(axis=0),
        "half_extents": [np.linalg.norm(along) / 2, np.linalg.norm(across) / 2],
        "yaw": math.atan2(along[1], along[0]),
    }


def _box(
    task: Task, body: Mapping[str, Any], surfaces: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    turn, start = _turn(task, body), np.array(body["start"])
    foot = np.array(body["corners"])
    foot = foot[foot[:, 2] < foot[:, 2].min() + _CLEARANCE] - [0, 0, _CLEARANCE]
    return {
        "name": body["name"],
        "shape": "mesh",
        "vertices": apply(inverse(turn), np.concatenate([body["vertices"], foot])),
        "position": start[:3],
        "yaw": yaw_of(start) + yaw_of(turn),
        "on": _below(body, body["start"], surfaces),
        "grasps": [grasp for grasp in compose(inverse(turn), _tools(task, body)) if _usable(grasp)],
    }


def _tools(task: Task, body: Mapping[str, Any]) -> Array:
    """The tool's poses (n, 7) in a body's frame, one for each handle."""
    in_gripper = compose(inverse(np.array(task["robot"]["gripper"])), _TOOL)
    return compose(np.array(body["handles"]), in_gripper)


def _turn(task: Task, body: Mapping[str, Any]) -> Array:
    """How a body's frame is turned (7,) such that the fingers close along an axis of it."""
    x, y, _ = rotation_matrix(_tools(task, body)[0, 3:])[:, 1]
    return pose(np.zeros(3), math.remainder(math.atan2(y, x), math.pi / 2))


def _usable(grasp: Array) -> bool:
    """Whether a hand comes from above or level to a body that stands."""
    return bool(rotation_matrix(grasp[3:])[2, 0] < _LEVEL)


def _below(
    body: Mapping[str, Any], where: Sequence[float], surfaces: Sequence[Mapping[str, Any]]
) -> str:
    """The surface on which a body stands at a pose."""
    x, y, z = *where[:2], where[2] + np.array(body["corners"])[:, 2].min()
    for surface in surfaces:
        frame = pose(surface["position"], surface["yaw"])
        local = apply(inverse(frame), np.array([x, y, z]))
        if abs(local[2]) < 2 * _FLAT and np.all(np.abs(local[:2]) <= surface["half_extents"]):
            return str(surface["name"])
    raise ValueError(f"{body['name']} stands on nothing at {where}")


def _obstacle(
    box: Mapping[str, Any], surfaces: Sequence[Mapping[str, Any]], base: Array
) -> Iterator[dict[str, Any]]:
    """A part of furniture; of what carries a surface or the robot, the part below that."""
    (length, width, height), (x, y, z, *_) = box["size"], box["pose"]
    tables = any(_carries(box, surface["position"]) for surface in surfaces)
    cut = TABLE_THICKNESS if tables else _HULL if _carries(box, base[:3]) else 0.0
    height, z = height - cut, z - cut / 2
    if height > 0:
        yield {
            "name": box["name"],
            "size": [length, width, height],
            "position": [x, y, z],
            "yaw": yaw_of(np.array(box["pose"])),
        }


def _carries(box: Mapping[str, Any], place: Array) -> bool:
    local = apply(inverse(np.array(box["pose"])), place)
    beside = np.abs(local[:2]) - np.array(box["size"])[:2] / 2
    return bool(abs(local[2] - box["size"][2] / 2) < _FLAT and beside.max() < 0)


def _level(where: Sequence[float]) -> Array:
    """A pose (7,) without its tilt."""
    return pose(np.array(where[:3]), float(yaw_of(np.array(where))))


def _offset(body: Mapping[str, Any], box: Box) -> Array:
    """Pose (7,) of a box's frame in its body's."""
    return compose(inverse(_level(body["start"])), box.placement)


def _plain(value: Any) -> Any:
    return value.tolist()


# the way back

_STEP, _FINE = 0.004, 0.0008
"""How far (m, rad) a body moves between two samples at most. Of three, one that moves by more than
0.001 is taken for one that slides where it stands."""
_LEAST = 1001
"""Samples at least: the package's step is a thousandth of the way."""
_TURN = 0.02
"""How far (rad) a joint moves between two samples at most."""
_CLOSING = 20
"""Samples in which the fingers close at the end."""
_LOOSE, _WIDEST = 1.05, 0.04
"""The package holds bodies without touching them: fingers are wider by a factor, up to (m)."""


def samples(task: Task, scene: Scene, trajectory: Trajectory) -> tuple[Array, Array]:
    """Joints (n, 9) and poses (n, bodies, 7) of a motion, as the package has them.

    The fingers, about which its tasks say nothing on the way, are closed at start and end.
    """
    joints = trajectory.joints(_JOINTS)
    rows = _rows(scene, trajectory, joints)
    dense = _between(joints, rows)
    poses = _body_poses(task, scene, trajectory, rows, dense[:, :_ARM])
    dense[:, _ARM:] = np.minimum(_LOOSE * dense[:, _ARM:], _WIDEST)
    closing = np.repeat(dense[-1:], _CLOSING, axis=0)
    closing[:, _ARM:] *= np.linspace(1, 0, _CLOSING)[:, None]
    return np.concatenate([dense, closing]), np.concatenate(
        [poses, np.repeat(poses[-1:], _CLOSING, axis=0)]
    )


_JOINTS = (
    *(f"panda_joint{number}" for number in range(1, _ARM + 1)),
    *(f"panda_finger_joint{number}" for number in (1, 2)),
)


def _between(joints: Array, rows: Array) -> Array:
    """Joints (n, m) at rows with fractions."""
    return np.stack([np.interp(rows, np.arange(len(joints)), one) for one in joints.T], axis=1)


def _rows(scene: Scene, trajectory: Trajectory, joints: Array) -> Array:
    """Rows (n,) of a motion, with fractions, between which nothing moves far."""
    parts = np.linspace(0, len(joints) - 1, 1 + _PARTS * (len(joints) - 1))
    tools = scene.robot.tool_poses(_between(joints, parts)[:, :_ARM])[ROBOT]
    before, after = tools[:-1], tools[1:]
    turn = 2 * np.arccos(np.minimum(np.abs(np.sum(before[:, 3:] * after[:, 3:], axis=1)), 1.0))
    moved = np.abs(after[:, :3] - before[:, :3]).max(axis=1) + _REACH * turn
    fastest = np.maximum(moved, turn).reshape(-1, _PARTS).max(axis=1) * _PARTS
    steps = fastest / (_FINE if len(scene.movable) > 2 else _STEP)
    carried = np.zeros(len(steps), dtype=bool)
    for attachment in trajectory.attachments:
        carried[attachment.start : attachment.end] = True
    alone = np.abs(np.diff(joints, axis=0)).max(axis=1) / _TURN
    counts = np.ceil(np.where(carried, steps, alone)).astype(int).clip(_LEAST // len(steps) + 1)
    ends = [np.linspace(row, row + 1, count, endpoint=False) for row, count in enumerate(counts)]
    return np.append(np.concatenate(ends), len(joints) - 1.0)


_PARTS = 4
"""Of the way between two rows: the tool may turn back on it."""
_REACH = 0.15
"""Distance (m) of a body's middle from the tool at most."""


def _body_poses(task: Task, scene: Scene, trajectory: Trajectory, rows: Array, arm: Array) -> Array:
    """Poses (n, bodies, 7) of all bodies, in their own frames, at rows."""
    tools = scene.robot.tool_poses(arm)[ROBOT]
    found = []
    for body, box in zip(task["bodies"], scene.movable, strict=True):
        poses = np.tile(box.placement, (len(rows), 1))
        for attachment in sorted(trajectory.attachments, key=lambda one: one.start):
            if attachment.box == box.name:
                first, last = np.searchsorted(rows, [attachment.start, attachment.end])
                grasp = compose(inverse(tools[first]), poses[first])
                poses[first:] = compose(tools[first:], grasp)
                poses[last:] = poses[last]
        found.append(compose(poses, inverse(_offset(body, box))))
    return np.stack(found, axis=1)
