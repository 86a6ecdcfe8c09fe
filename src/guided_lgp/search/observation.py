"""What a policy sees: world positions of all symbols (paper, Sec. II, state s_k)."""

from collections.abc import Sequence

import numpy as np

from guided_lgp.bounds.results import Array, Keyframe
from guided_lgp.poses import yaw_of
from guided_lgp.scene import Scene
from guided_lgp.scene.world import at_side, poses_at_side


def start(scene: Scene) -> Keyframe:
    """The configuration x_0: all arms at their side, boxes where the scene puts them."""
    return Keyframe(at_side(scene), poses_at_side(scene))


def observe(scene: Scene, keyframe: Keyframe) -> dict[str, Array]:
    """The state s_k: position (3,) in m of every symbol, grippers, boxes, then surfaces."""
    return observe_all(scene, [keyframe])[0]


def observe_all(scene: Scene, keyframes: Sequence[Keyframe]) -> list[dict[str, Array]]:
    """The states of many keyframes; the arms are mostly where they were before."""
    symbols = scene.symbols
    postures, which = np.unique([k.q for k in keyframes], axis=0, return_inverse=True)
    tools = scene.robot.tool_poses(postures, symbols.grippers)
    surfaces = {body.name: np.array(body.top) for body in scene.supports}
    return [
        {name: tools[name][posture, :3] for name in symbols.grippers}
        | {name: np.asarray(keyframe.boxes[name])[:3] for name in symbols.boxes}
        | surfaces
        for keyframe, posture in zip(keyframes, which, strict=True)
    ]


def shapes(scene: Scene, keyframe: Keyframe) -> dict[str, Array]:
    """Half extents (m) and yaw (rad), (4,), of every box and surface."""
    boxes = {
        box.name: np.array([*np.divide(box.size, 2), float(yaw_of(keyframe.boxes[box.name]))])
        for box in scene.movable
    }
    surfaces = {
        body.name: np.array([*body.convex.half[:2], 0.0, body.yaw]) for body in scene.supports
    }
    return boxes | surfaces
