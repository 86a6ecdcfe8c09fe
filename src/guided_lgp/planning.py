"""Plan one task: the Python interface behind ``guided-lgp plan``."""

import logging
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.errors import InputError
from guided_lgp.explanation import ObservedBounds, Obstacle
from guided_lgp.logic import Goal, parse_objective, validate_objective
from guided_lgp.params import PlanningParams, load_planning
from guided_lgp.paths import MODELS
from guided_lgp.policy.registry import POLICIES, load_policy, missing_instructions
from guided_lgp.scene import Scene
from guided_lgp.scene.validate import validate_scene
from guided_lgp.search.planners import SEARCHES, check_policies
from guided_lgp.search.policy import Policy, Uniform
from guided_lgp.search.problem import Problem
from guided_lgp.search.result import REASONS, Cause, SearchResult

DEFAULT_PLANNER, DEFAULT_POLICY = "guided", "relational"
_WITHOUT_POLICY = "best-first"
"""The search where the policy cannot score all actions: complete, whatever guides it."""

logger = logging.getLogger(__name__)

_OUTCOMES: Mapping[Cause, str] = {
    "infeasible": "infeasible",
    "max_depth": "without the goals at the maximum depth",
}
"""How attempts end, in words."""


@dataclass(frozen=True, kw_only=True)
class PlanningResult(SearchResult):
    """The plan found, or why there is none, and what the search cost."""

    solver_starts: int
    """Starts of the coarse bound's solver, over all sequences."""
    obstacles: tuple[Obstacle, ...] = ()
    """Without a plan: what stopped the sequences, first what is nearest to the objective."""

    @property
    def explanation(self) -> str:
        """One line: why there is no plan and what was tried; empty if there is one."""
        if self.reason is None:
            return ""
        outcomes = ", ".join(
            f"{self.causes.count(cause)} {outcome}"
            for cause, outcome in _OUTCOMES.items()
            if cause in self.causes
        )
        attempts = f"attempts: {outcomes}; " if outcomes else ""
        line = (
            f"{REASONS[self.reason]} ({self.tree_size} nodes; {attempts}{self.coarse_calls} "
            f"sequences with {self.solver_starts} starts of the coarse bound, {self.path_calls} of "
            "them on to the path bound)"
        )
        return f"{line}; nearest to the goals: {self.obstacles[0]}" if self.obstacles else line


def plan(
    scene: Scene,
    objective: str | Iterable[Goal | str],
    planner: str = DEFAULT_PLANNER,
    *,
    policy: str | Policy = DEFAULT_POLICY,
    models: Path = MODELS,
    params: PlanningParams | None = None,
    max_nodes: int | None = None,
    where: str = "scene",
) -> PlanningResult:
    """Find a sequence of actions and its motion such that all goals hold at the end.

    Args:
        scene: robot, tables and boxes, as read by ``load_scene``.
        objective: goals, parsed or as text: ``["(on red green)", "(held blue)"]``.
        planner: one of :data:`~guided_lgp.search.planners.SEARCHES`.
        policy: the name of a trained policy, or any object with the method of
            :class:`~guided_lgp.search.policy.Policy`; some searches need none.
        models: folder with the trained weights; by default, those shipped with the package.
        params: limits of the bounds and of the search (sections ``bounds`` and
            ``compare_scalability``); the shipped ones by default.
        max_nodes: nodes of the search tree at which the search ends, instead of the limit in
            ``params``.
        where: the scene's file, for messages.

    Returns:
        The result of the search: ``solved``, ``skeleton``, ``path``; or the ``explanation`` and
        the ``obstacles``.

    Raises:
        InputError: a fault in the scene, the objective, the names or the models.
    """
    check_policies(POLICIES)
    if planner not in SEARCHES:
        raise InputError("planner", f"unknown {planner!r}", ", ".join(SEARCHES))
    search = SEARCHES[planner]
    goals = parse_objective([objective] if isinstance(objective, str) else map(str, objective))
    validate_scene(scene, where)
    validate_objective(goals, scene.symbols, scene.state)
    params = params or load_planning()
    limits = params.compare_scalability
    if max_nodes is not None:
        limits = limits.model_copy(update={"max_tree_size": max_nodes})
    bounds = ObservedBounds(SceneBounds(scene, params.bounds))
    followed = None
    if search.follows_policy:
        followed = load_policy(policy, models) if isinstance(policy, str) else policy
        if missing := missing_instructions(followed, scene.symbols.domain):
            logger.warning(
                "the policy has no head for %s of the domain %s: %s search without it",
                ", ".join(missing),
                scene.symbols.domain.name,
                _WITHOUT_POLICY,
            )
            search, followed = SEARCHES[_WITHOUT_POLICY], Uniform()
    result = search.plan(Problem(scene, goals, limits, bounds, followed))
    return PlanningResult(
        **vars(result),
        solver_starts=bounds.starts,
        obstacles=() if result.solved else bounds.obstacles(scene.state, goals),
    )
