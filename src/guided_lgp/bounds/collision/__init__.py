"""Collisions of the robot, boxes and tables: exact ones, and what is surely free of them."""

from guided_lgp.bounds.collision.checker import (
    LEAST,
    PADDING,
    CollisionChecker,
    PlanningScene,
    checker_of,
)

__all__ = ["LEAST", "PADDING", "CollisionChecker", "PlanningScene", "checker_of"]
