"""Pictures of scenes from PyBullet."""

from pathlib import Path

from matplotlib.image import imsave

from guided_lgp.documents import written_whole
from guided_lgp.scene import Scene
from guided_lgp.scene.world import World


def draw_scene(scene: Scene, path: Path) -> None:
    """Write a PNG picture of the scene's initial configuration; the same scene, the same bytes."""
    with World(scene) as world:
        picture = world.render()
    with written_whole(path) as file:
        imsave(file, picture)
