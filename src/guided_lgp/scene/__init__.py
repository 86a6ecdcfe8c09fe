"""Scenes, their generation, the PR2 and the PyBullet world."""

from guided_lgp.scene.model import GRIPPERS, Box, Robot, Scene, Table, load_scene, parse_scene

__all__ = ["GRIPPERS", "Box", "Robot", "Scene", "Table", "load_scene", "parse_scene"]
