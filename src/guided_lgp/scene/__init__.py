"""Scenes, their generation and their PyBullet world."""

from guided_lgp.scene.bodies import Box, Obstacle, Table
from guided_lgp.scene.generate import GeneratedScenes, generate, load_scenes
from guided_lgp.scene.model import PlacedRobot, Scene, load_scene, parse_scene

__all__ = [
    "Box",
    "GeneratedScenes",
    "Obstacle",
    "PlacedRobot",
    "Scene",
    "Table",
    "generate",
    "load_scene",
    "load_scenes",
    "parse_scene",
]
