"""Whether hands that have held a body at top and bottom leave it level: a finger is below it."""

import math

import numpy as np

from guided_lgp.bounds.results import Failure, PathResult
from guided_lgp.logic import Skeleton
from guided_lgp.poses import Array, compose, inverse, rotation_matrix
from guided_lgp.scene import Box, Scene
from guided_lgp.scene.world import initial_poses

_FLAT = math.cos(math.pi / 4)
"""Of the angle between the fingers' closing direction and the vertical."""
_OPEN = 0.008
"""How far (m) up or down an open hand may be: its fingers are 1 cm off the body."""
_TIP = 0.019
"""How far (m) fingertips reach beyond the middle between them."""


def caught(scene: Scene, result: PathResult) -> Failure | None:
    """The first action after which a finger would have to go through what it has let go.

    Args:
        scene: the initial configuration.
        result: a motion.
    """
    if result.trajectory is None:
        return None
    boxes, poses = {box.name: box for box in scene.movable}, initial_poses(scene)
    motion, places = result.trajectory, _places(scene, result.skeleton)
    tools = scene.robot.tool_poses(motion.joints(scene.robot.description.joint_names))
    for held in sorted(motion.attachments, key=lambda one: one.end):
        tool = tools[held.gripper]
        grasp = compose(inverse(tool[held.start]), poses[held.box])
        poses[held.box] = compose(tool[held.end], grasp)
        if held.end < len(tool) - 1 and (held.gripper, held.box) in places:
            leaving = compose(inverse(poses[held.box]), tool[held.end :])
            if _goes_through(boxes[held.box], leaving):
                name = f"clear {held.gripper} {held.box}"
                return Failure(places[held.gripper, held.box], name, math.nan, "this motion alone")
    return None


def _places(scene: Scene, skeleton: Skeleton) -> dict[tuple[str, str], int]:
    """The last action by which a gripper puts a body down, by both."""
    grounds = [scene.symbols.domain.bind(action) for action in skeleton]
    return {
        (one.actor, one.body): number for number, one in enumerate(grounds) if not one.into_hand
    }


def _goes_through(box: Box, tools: Array) -> bool:
    """Whether poses (n, 7) of a tool in a body's frame, from its release on, lead through it."""
    approach, closing, _ = rotation_matrix(tools[0, 3:]).T
    if abs(closing[2]) < _FLAT:
        return False
    tips = tools[:, :2] + _TIP * approach[:2]
    half = np.array(box.convex.half[:2])
    within = np.hypot(*tips.T) < half[0] if box.shape == "cylinder" else (abs(tips) < half).all(1)
    until = len(within) if within.all() else int(np.argmin(within))
    return bool((np.abs(tools[:until, 2] - tools[0, 2]) > _OPEN).any())
