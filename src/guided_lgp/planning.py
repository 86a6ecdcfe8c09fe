"""Plan one task: the Python interface behind ``guided-lgp plan``."""

import logging
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from guided_lgp.bounds.deadline import Deadline
from guided_lgp.bounds.goals import GoalTerms
from guided_lgp.bounds.path.assembly import stay
from guided_lgp.bounds.results import PathResult
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.domains import load_domain
from guided_lgp.errors import InputError
from guided_lgp.explanation import ObservedBounds, Obstacle
from guided_lgp.logic import (
    Goal,
    Objective,
    least_actions,
    parse_objective,
    satisfied,
)
from guided_lgp.logic.objectives import asks_for_places, check_objective
from guided_lgp.params import BoundsParams, PlanningParams, SearchLimits, load_planning
from guided_lgp.paths import MODELS
from guided_lgp.policy.registry import (
    DEFAULT_POLICY,
    POLICIES,
    load_policy,
    missing_instructions,
)
from guided_lgp.policy.uniform import Uniform
from guided_lgp.scene import Scene, load_scene
from guided_lgp.scene.goals import complete_objective, in_the_way
from guided_lgp.scene.validate import validate_scene
from guided_lgp.scene.world import initial_poses
from guided_lgp.search.facts import out_of_reach
from guided_lgp.search.planners import (
    DEFAULT_SEARCH,
    SEARCHES,
    WITHOUT_POLICY,
    Search,
    check_planners,
)
from guided_lgp.search.policy import Policy
from guided_lgp.search.problem import Problem
from guided_lgp.search.result import REASONS, Cause, SearchResult, Times
from guided_lgp.search.ways import widened_scene

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

    scene: Scene
    """As planned in: with the domain whose instructions were used."""
    objective: Objective
    """The goals with what their texts left out."""
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
    domain: str | None = None,
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
        domain: whose instructions the plan may have. By default that of the scene; where the scene
            names none, the paper's, or one that extends it if facts show that a goal needs it.
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
    chosen = domain is not None or "domain" in scene.model_fields_set
    if domain is not None:
        scene = scene.model_copy(update={"domain": load_domain(domain).name})
    goals = parse_objective([objective] if isinstance(objective, str) else map(str, objective))
    validate_scene(scene, where)
    goals = complete_objective(goals, scene)
    check_objective(goals, scene.symbols)
    misplaced = _misplaced(scene, goals)
    if goals and satisfied(scene.state, goals) and not misplaced:
        return _without_search(scene, goals, stay(scene))
    params = params or load_planning()
    deadline = Deadline.after(timeout)
    scene_bounds = SceneBounds(scene, params.bounds, deadline, goals)
    if fact := out_of_reach(scene, scene_bounds.facts, goals):
        return _without_search(scene, goals, None, fact)
    limits = _limits(params.compare_scalability, scene, goals, max_nodes)
    search, followed = _guidance(planner, policy, models, scene)
    observed = ObservedBounds(scene_bounds)
    problem = Problem(
        scene,
        goals,
        limits,
        observed,
        followed,
        misplaced=misplaced,
        parts=scene_bounds,
        deadline=deadline,
    )
    attempts = _Attempts(problem)
    if chosen:
        return attempts.result(search.plan(attempts.first))
    widened = partial(attempts.widened, params.bounds)
    return attempts.result(search.plan(replace(attempts.first, widened=widened)))


class _Attempts:
    """A problem, and the same with further instructions where a search has asked for them."""

    def __init__(self, problem: Problem) -> None:
        self.first = self._last = problem

    def widened(self, params: BoundsParams) -> Problem | None:
        """The problem with further instructions, if a goal needs them; no policy knows these."""
        problem = self.first
        scene = widened_scene(problem.scene, problem.objective, params, problem.deadline)
        if scene is None:
            return None
        bounds = SceneBounds(scene, params, problem.deadline, problem.objective)
        observed = ObservedBounds(bounds)
        self._last = replace(problem, scene=scene, bounds=observed, parts=bounds, policy=Uniform())
        return self._last

    def result(self, found: SearchResult) -> PlanningResult:
        """What the searches have found, with what stopped the sequences of the last one."""
        problem, bounds = self._last, self._last.bounds
        assert isinstance(bounds, ObservedBounds)
        return PlanningResult(
            **vars(found),
            scene=problem.scene,
            objective=problem.objective,
            solver_starts=bounds.starts,
            obstacles=()
            if found.solved
            else bounds.obstacles(problem.scene.state, problem.objective),
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


def _misplaced(scene: Scene, goals: Objective) -> dict[str, frozenset[str]]:
    """Bodies that are not where goals want them, and for each what stands there."""
    terms = GoalTerms.of(goals, scene.symbols.domain)
    faults = terms.faults(scene, initial_poses(scene))
    bodies = sorted({fault.constraint.split()[1] for fault in faults})
    return {body: in_the_way(body, goals, scene) for body in bodies}


def _limits(
    limits: SearchLimits,
    scene: Scene,
    goals: Objective,
    max_nodes: int | None,
) -> SearchLimits:
    """Limits that follow the task: those of the experiments, or more where it needs more."""
    lower_bound = least_actions(scene.state, goals, scene.symbols)
    least = 0 if math.isinf(lower_bound) else int(lower_bound)
    least = max(least, 2) if asks_for_places(goals, scene.symbols) else least
    changed = {
        "max_depth": max(limits.max_depth, 2 * least),
        "max_sequences": limits.max_sequences + SEQUENCES_PER_ACTION * least,
        "max_tree_size": max_nodes or limits.max_tree_size,
    }
    return limits.model_copy(update=changed)


def _without_search(
    scene: Scene, goals: Objective, path: PathResult | None, fact: str | None = None
) -> PlanningResult:
    """The result where nothing has to be done, or nothing can be."""
    return PlanningResult(
        scene=scene,
        objective=goals,
        coarse=None,
        path=path,
        tree_size=1,
        expansions=0,
        policy_calls=0,
        coarse_calls=0,
        infeasible_calls=0,
        part_calls=0,
        path_calls=0,
        causes=(),
        reattempts={},
        times=Times(0.0, 0.0, 0.0, 0.0),
        reason=None if path else "impossible",
        solver_starts=0,
        fact=fact,
    )
