"""Pictures of scenes from PyBullet."""

from pathlib import Path

from matplotlib.image import imsave

from guided_lgp.scene import Scene
from guided_lgp.scene.world import World


def draw_scene(scene: Scene, path: Path) -> None:
    """Write a PNG picture of the scene's initial configuration; the same scene, the same bytes."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with World(scene) as world:
        imsave(path, world.render())
