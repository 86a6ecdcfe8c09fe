"""What a policy sees: world positions of all symbols (paper, Sec. II, state s_k)."""

import numpy as np

from guided_lgp.bounds.results import Array, Keyframe
from guided_lgp.poses import pose
from guided_lgp.scene import Scene


def start(scene: Scene) -> Keyframe:
    """The configuration x_0: all arms at their side, boxes where the scene puts them."""
    home = scene.robot.description.home
    return Keyframe(home, {box.name: pose(box.position, box.yaw) for box in scene.boxes})


def observe(scene: Scene, keyframe: Keyframe) -> dict[str, Array]:
    """The state s_k: position (3,) in m of every symbol, grippers, boxes, then surfaces."""
    symbols = scene.symbols
    grippers = {name: scene.robot.tool_pose(keyframe.q, name)[:3] for name in symbols.grippers}
    boxes = {name: np.asarray(keyframe.boxes[name])[:3] for name in symbols.boxes}
    surfaces = {table.name: np.array(table.position) for table in scene.tables}
    return grippers | boxes | surfaces
