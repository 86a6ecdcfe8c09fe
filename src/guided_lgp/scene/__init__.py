"""Scenes, their generation, the PR2 and the PyBullet world."""

from guided_lgp.scene.generate import GeneratedScenes, generate, load_scenes
from guided_lgp.scene.model import GRIPPERS, Box, Robot, Scene, Table, load_scene, parse_scene

__all__ = [
    "GRIPPERS",
    "Box",
    "GeneratedScenes",
    "Robot",
    "Scene",
    "Table",
    "generate",
    "load_scene",
    "load_scenes",
    "parse_scene",
]
