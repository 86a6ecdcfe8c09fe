"""Boxes: carried along as the attachments say, and standing where nobody holds them."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from plan_checker.actions import Event, State, state_at_start, states_after
from plan_checker.document import (
    ROUNDING,
    SAME_ANGLE,
    SAME_POSITION,
    Fault,
    Motion,
    Plan,
    body_vertices,
    scene_pose,
)
from plan_checker.geometry import face_of, homogeneous, inverse_pose, placed_points, planar_pose

ON_SUPPORT = 0.005  # a corner of a standing box may be off the plane of its support by this much


def carried(plan: Plan, tools: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Poses (n, 4, 4) of the boxes: at rest, or rigid in the tool frame they are attached to."""
    rows = len(plan.times)
    poses = {name: np.tile(scene_pose(plan, name), (rows, 1, 1)) for name in plan.boxes}
    for gripper, name in state_at_start(plan).holds.items():
        grasp = np.eye(4)
        grasp[:3, 3] = plan.boxes[name]["grasp"][:3]
        grasp[:3, :3] = Rotation.from_quat(plan.boxes[name]["grasp"][3:]).as_matrix()
        poses[name][:] = tools[gripper][0] @ grasp
    for box, gripper, start, end in plan.attachments:
        tool, pose = tools[gripper], poses[box]
        pose[start : end + 1] = tool[start : end + 1] @ (inverse_pose(tool[start]) @ pose[start])
        pose[end + 1 :] = pose[end]
    return poses


def badly_standing(plan: Plan, events: Sequence[Event], motion: Motion) -> Iterator[Fault]:
    """Every box that is not held stands on its support, at the start and after every action.

    Level, at the support's height, and with the centre of mass of it and all that it carries over
    the support. A box that carries others is level all the way.
    """
    states = states_after(plan, events)
    rows = sorted({0, *(event.row for event in events), len(states) - 1})
    reported = set()
    for row in rows:
        for box, support in states[row].support.items():
            poses = {name: pose[row] for name, pose in motion.boxes.items()}
            why = _unstable(plan, states[row], box, support, poses)
            if why and (box, support) not in reported:
                reported.add((box, support))
                yield Fault("support", row, f"{box} on {support}: {why}")
    for box, pose in motion.boxes.items():
        base = face_of(body_vertices(plan.boxes[box]), -1)
        rise = np.ptp(placed_points(pose, base)[:, 2], axis=1)
        loaded = [state.carried(box) != [] for state in states]
        tilted = np.flatnonzero(np.array(loaded) & (rise > ON_SUPPORT))
        if tilted.size:
            row = int(tilted[0])
            text = f"{box} is tilted by {1e3 * rise[row]:.0f} mm under {states[row].carried(box)}"
            yield Fault("support", row, text)


def _unstable(
    plan: Plan, state: State, box: str, support: str, poses: Mapping[str, np.ndarray]
) -> str | None:
    bodies = plan.boxes | plan.tables
    top, base = face_of(body_vertices(bodies[support]), 1), face_of(body_vertices(bodies[box]), -1)
    below = poses[support] if support in plan.boxes else scene_pose(plan, support)
    into = inverse_pose(below @ planar_pose(0, 0, top[:, 2].max(), 0))
    gaps = (into @ poses[box] @ homogeneous(base).T)[2]
    if np.abs(gaps).max() > ON_SUPPORT:
        return f"the bottom is {1e3 * gaps.min():.0f} to {1e3 * gaps.max():.0f} mm above it"
    stack = [box, *state.carried(box)]
    masses = [ConvexHull(body_vertices(plan.boxes[name])).volume for name in stack]
    centre = np.average([poses[name][:, 3] for name in stack], axis=0, weights=masses)
    if not _over(into @ centre, top):
        return f"the centre of {' '.join(stack)} is not over it"
    if not _over(inverse_pose(poses[box]) @ centre, base):
        return f"the centre of {' '.join(stack)} is not over its base"
    return None


def _over(point: np.ndarray, face: np.ndarray) -> bool:
    """Whether a point (4,) is above the hull of a face (n, 3), both in the frame of the body."""
    edges = ConvexHull(face[:, :2]).equations
    return bool((edges @ (point[0], point[1], 1.0) <= 0).all())


def wrong_keyframes(plan: Plan, events: Sequence[Event], motion: Motion) -> Iterator[Fault]:
    """Keyframe k is the path where action k takes effect."""
    for number, (event, keyframe) in enumerate(zip(events, plan.keyframes, strict=True)):
        apart = np.abs(keyframe.q - plan.q[event.row])
        if apart.max() > ROUNDING:
            name = plan.joints[int(apart.argmax())]
            text = f"keyframe {number}: {name} is {apart.max():.3f} rad off the path"
            yield Fault("keyframe", event.row, text)
        for name, (position, yaw) in keyframe.boxes.items():
            pose = motion.boxes[name][event.row]
            off = np.linalg.norm(position - pose[:3, 3])
            turn = yaw - np.arctan2(pose[1, 0], pose[0, 0])
            upright = pose[2, 2] > np.cos(SAME_ANGLE)
            if off > SAME_POSITION or (upright and abs(np.sin(turn / 2)) > SAME_ANGLE / 2):
                text = f"keyframe {number}: {name} is not where the path has it ({off:.3f} m)"
                yield Fault("keyframe", event.row, text)
