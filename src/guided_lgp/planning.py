"""Plan one task: the Python interface behind ``guided-lgp plan``."""

import logging
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path

from guided_lgp.bounds.results import PathResult
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.errors import InputError
from guided_lgp.explanation import ObservedBounds, Obstacle
from guided_lgp.logic import (
    Goal,
    Objective,
    least_actions,
    parse_objective,
    satisfied,
    validate_objective,
)
from guided_lgp.params import PlanningParams, SearchLimits, load_planning
from guided_lgp.paths import MODELS
from guided_lgp.policy.registry import POLICIES, load_policy, missing_instructions
from guided_lgp.scene import Scene, load_scene
from guided_lgp.scene.validate import validate_scene
from guided_lgp.search.facts import out_of_reach
from guided_lgp.search.planners import (
    DEFAULT_SEARCH,
    SEARCHES,
    WITHOUT_POLICY,
    Search,
    check_planners,
)
from guided_lgp.search.policy import Policy, Uniform
from guided_lgp.search.problem import Problem
from guided_lgp.search.result import REASONS, Cause, SearchResult, Times

DEFAULT_POLICY = "relational"

SEQUENCES_PER_ACTION = 100
"""Sequences that a search may hand to the coarse bound, beyond the limit of the experiments, for
each action that a task needs at least."""

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
    fact: str | None = None
    """What was known before any search, if that rules a plan out."""

    @property
    def explanation(self) -> str:
        """One line: why there is no plan and what was tried; empty if there is one."""
        if self.reason is None:
            return ""
        if self.fact is not None:
            return self.fact
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
    scene: Scene | str | Path,
    objective: str | Iterable[Goal | str],
    planner: str = DEFAULT_SEARCH,
    *,
    policy: str | Policy = DEFAULT_POLICY,
    models: Path = MODELS,
    params: PlanningParams | None = None,
    max_nodes: int | None = None,
    timeout: float | None = None,
    where: str = "scene",
) -> PlanningResult:
    """Find a sequence of actions and its motion such that all goals hold at the end.

    Args:
        scene: robot, tables and boxes, as read by ``load_scene``; or the file.
        objective: goals, parsed or as text: ``["(on red green)", "(held blue)"]``.
        planner: one of :data:`~guided_lgp.search.planners.SEARCHES`.
        policy: the name of a trained policy, or any object with the method of
            :class:`~guided_lgp.search.policy.Policy`; some searches need none.
        models: folder with the trained weights; by default, those shipped with the package.
        params: limits of the bounds and of the search (sections ``bounds`` and
            ``compare_scalability``); the shipped ones by default.
        max_nodes: nodes of the search tree at which the search ends, instead of the limit in
            ``params``.
        timeout: seconds of wall clock after which the search ends.
        where: the scene's file, for messages.

    Returns:
        The result of the search: ``solved``, ``skeleton``, ``path``; or the ``explanation`` and
        the ``obstacles``.

    Raises:
        InputError: a fault in the scene, the objective, the names or the models.
    """
    check_planners(POLICIES)
    if planner not in SEARCHES:
        raise InputError("planner", f"unknown {planner!r}", ", ".join(SEARCHES))
    if not isinstance(scene, Scene):
        scene, where = load_scene(scene), str(scene)
    goals = parse_objective([objective] if isinstance(objective, str) else map(str, objective))
    validate_scene(scene, where)
    if goals and satisfied(scene.state, goals):
        return _without_search(PathResult((), feasible=True))
    validate_objective(goals, scene.symbols, scene.state)
    params = params or load_planning()
    limits = _limits(params.compare_scalability, scene, goals, max_nodes)
    scene_bounds = SceneBounds(scene, params.bounds)
    if fact := out_of_reach(scene, scene_bounds.facts, goals):
        return _without_search(None, fact)
    bounds = ObservedBounds(scene_bounds)
    search, followed = _guidance(planner, policy, models, scene)
    result = search.plan(Problem(scene, goals, limits, bounds, followed, max_seconds=timeout))
    return PlanningResult(
        **vars(result),
        solver_starts=bounds.starts,
        obstacles=() if result.solved else bounds.obstacles(scene.state, goals),
    )


def _guidance(
    planner: str, policy: str | Policy, models: Path, scene: Scene
) -> tuple[Search, Policy | None]:
    """The search, and the policy that it follows; a complete one where the policy falls short."""
    search = SEARCHES[planner]
    if not search.follows_policy:
        return search, None
    followed = load_policy(policy, models) if isinstance(policy, str) else policy
    missing = missing_instructions(followed, scene.symbols.domain)
    if not missing:
        return search, followed
    logger.warning(
        "the policy has no head for %s of the domain %s: %s search without it",
        ", ".join(missing),
        scene.symbols.domain.name,
        WITHOUT_POLICY,
    )
    return SEARCHES[WITHOUT_POLICY], Uniform()


def _limits(
    limits: SearchLimits,
    scene: Scene,
    goals: Objective,
    max_nodes: int | None,
) -> SearchLimits:
    """Limits that follow the task: those of the experiments, or more where it needs more."""
    lower_bound = least_actions(scene.state, goals, scene.symbols)
    least = 0 if math.isinf(lower_bound) else int(lower_bound)
    changed = {
        "max_depth": max(limits.max_depth, 2 * least),
        "max_sequences": limits.max_sequences + SEQUENCES_PER_ACTION * least,
        "max_tree_size": max_nodes or limits.max_tree_size,
    }
    return limits.model_copy(update=changed)


def _without_search(path: PathResult | None, fact: str | None = None) -> PlanningResult:
    """The result where nothing has to be done, or nothing can be."""
    return PlanningResult(
        coarse=None,
        path=path,
        tree_size=1,
        expansions=0,
        policy_calls=0,
        coarse_calls=0,
        path_calls=0,
        causes=(),
        reattempts={},
        times=Times(0.0, 0.0, 0.0, 0.0),
        reason=None if path else "impossible",
        solver_starts=0,
        fact=fact,
    )
