"""What a policy sees: world positions of all symbols (paper, Sec. II, state s_k)."""

from collections.abc import Sequence

import numpy as np

from guided_lgp.bounds.results import Array, Keyframe
from guided_lgp.poses import pose, yaw_of
from guided_lgp.scene import Scene


def start(scene: Scene) -> Keyframe:
    """The configuration x_0: all arms at their side, boxes where the scene puts them."""
    home = scene.robot.description.home
    return Keyframe(home, {box.name: pose(box.position, box.yaw) for box in scene.boxes})


def observe(scene: Scene, keyframe: Keyframe) -> dict[str, Array]:
    """The state s_k: position (3,) in m of every symbol, grippers, boxes, then surfaces."""
    return observe_all(scene, [keyframe])[0]


def observe_all(scene: Scene, keyframes: Sequence[Keyframe]) -> list[dict[str, Array]]:
    """The states of many keyframes; the arms are mostly where they were before."""
    symbols = scene.symbols
    postures, which = np.unique([k.q for k in keyframes], axis=0, return_inverse=True)
    tools = scene.robot.tool_poses(postures, symbols.grippers)
    surfaces = {table.name: np.array(table.position) for table in scene.tables}
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
        for box in scene.boxes
    }
    surfaces = {
        table.name: np.array([*table.half_extents, 0.0, table.yaw]) for table in scene.tables
    }
    return boxes | surfaces
