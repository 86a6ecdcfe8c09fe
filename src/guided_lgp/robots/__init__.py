"""Robots: one file each, and what is derived from their descriptions."""

from guided_lgp.robots.placed_arm import PlacedArm
from guided_lgp.robots.registry import load_robot, robot_names, tilted_robot
from guided_lgp.robots.robot import Arm, Fingers, Robot

__all__ = ["Arm", "Fingers", "PlacedArm", "Robot", "load_robot", "robot_names", "tilted_robot"]
