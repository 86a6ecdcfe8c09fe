"""What the policy sees: order, shapes and values of the positions."""

import numpy as np

from guided_lgp.bounds.results import Keyframe
from guided_lgp.scene.model import Scene
from guided_lgp.search.observation import observe, start


def test_start_of_the_scene(tray_scene: Scene) -> None:
    seen = observe(tray_scene, start(tray_scene))
    symbols = tray_scene.symbols
    assert list(seen) == [*symbols.grippers, *symbols.boxes, *symbols.surfaces]
    assert all(position.shape == (3,) for position in seen.values())
    for box in tray_scene.boxes:
        np.testing.assert_array_equal(seen[box.name], box.position)
    np.testing.assert_array_equal(seen["tray"], (0.52, 0.0, 0.63))
    left, right = seen["pr2L"], seen["pr2R"]
    np.testing.assert_allclose(left, right * (1, -1, 1), atol=1e-6)  # mirrored postures
    assert left[1] > 0


def test_follows_the_configuration(scene: Scene) -> None:
    frame = start(scene)
    moved = Keyframe(
        frame.q + 0.1, {**frame.boxes, "red": np.array([0.1, 0.2, 0.9, 0.0, 0.0, 0.0, 1.0])}
    )
    seen = observe(scene, moved)
    np.testing.assert_array_equal(seen["red"], (0.1, 0.2, 0.9))
    np.testing.assert_allclose(seen["pr2R"], scene.robot.tool_pose(moved.q, "pr2R")[:3])
