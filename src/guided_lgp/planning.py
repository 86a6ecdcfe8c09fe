"""Plan one task: the Python interface behind ``guided-lgp plan``."""

from collections.abc import Iterable
from pathlib import Path
from typing import Literal, get_args

from guided_lgp.errors import InputError
from guided_lgp.logic import Goal, parse_objective, validate_objective
from guided_lgp.nlp.bounds import SceneBounds
from guided_lgp.params import Params, load_params
from guided_lgp.paths import MODELS, PARAMS, SOURCES
from guided_lgp.policy.inference import load_policy
from guided_lgp.scene import Scene
from guided_lgp.scene.validate import validate_scene
from guided_lgp.search import best_first, breadth_first, guided
from guided_lgp.search.result import SearchResult

Planner = Literal["guided", "best-first", "breadth-first"]
"""Guided LGP of the paper, its complete variant, and the breadth-first baseline."""


def plan(
    scene: Scene,
    objective: str | Iterable[Goal | str],
    planner: Planner = "guided",
    *,
    models: Path = MODELS,
    params: Params | None = None,
    where: str = "scene",
) -> SearchResult:
    """Find a sequence of actions and its motion such that all goals hold at the end.

    Args:
        scene: robot, tables and boxes, as read by ``load_scene``.
        objective: goals, parsed or as text: ``["(on red green)", "(held blue)"]``.
        planner: ``guided``, ``best-first`` or ``breadth-first``.
        models: folder with the trained weights; breadth-first needs none.
        params: limits of the bounds and of the search (sections ``bounds`` and
            ``compare_scalability``); the ones of the clone by default.
        where: the scene's file, for messages.

    Returns:
        The result of the search: ``solved``, ``skeleton``, ``path``, or the ``explanation``.

    Raises:
        InputError: a fault in the scene, the objective, the planner's name or the models.
    """
    if planner not in get_args(Planner):
        raise InputError("planner", f"unknown {planner!r}", ", ".join(get_args(Planner)))
    goals = parse_objective([objective] if isinstance(objective, str) else map(str, objective))
    validate_scene(scene, where)
    validate_objective(goals, scene.symbols, scene.state)
    params = params or load_params(SOURCES / PARAMS)
    limits = params.compare_scalability
    bounds = SceneBounds(scene, params.bounds)
    if planner == "breadth-first":
        return breadth_first.plan(scene, goals, scene.symbols, bounds, limits)
    search = guided.plan if planner == "guided" else best_first.plan
    return search(scene, goals, scene.symbols, bounds, load_policy(models), limits)
