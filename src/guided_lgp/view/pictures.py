"""Pictures of scenes from PyBullet."""

from pathlib import Path

from PIL import Image

from guided_lgp.documents import written_whole
from guided_lgp.scene import Scene
from guided_lgp.scene.world import World

_COLOURS = 128
"""As many look like all of them, in a third of the bytes."""


def draw_scene(scene: Scene, path: Path) -> None:
    """Write a PNG picture of the scene's initial configuration; the same scene, the same bytes."""
    with World(scene) as world:
        picture = world.render()
    with written_whole(path) as file:
        Image.fromarray(picture).quantize(_COLOURS).save(file, "PNG", optimize=True)
