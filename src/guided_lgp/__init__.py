"""Guided sequential manipulation planning with a hierarchical policy.

The interface to plan one task::

    from guided_lgp import load_scene, plan

    result = plan(load_scene("examples/three_boxes.json"), ["(on red green)", "(held blue)"])
    print(result.skeleton if result.solved else result.explanation)
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from guided_lgp.logic import Goal, Objective, parse_objective
    from guided_lgp.planning import plan
    from guided_lgp.scene import Scene, load_scene

__version__ = "0.2.0"

__all__ = ["Goal", "Objective", "Scene", "load_scene", "parse_objective", "plan"]

_ORIGIN = {
    "Goal": "logic",
    "Objective": "logic",
    "Scene": "scene",
    "load_scene": "scene",
    "parse_objective": "logic",
    "plan": "planning",
}


def __getattr__(name: str) -> Any:
    """Import on first use, so that ``import guided_lgp`` costs nothing."""
    if name not in _ORIGIN:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_ORIGIN[name]}"), name)
