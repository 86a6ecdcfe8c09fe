"""Plan one task: the Python interface behind ``guided-lgp plan``."""

import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

from guided_lgp.bounds.deadline import Deadline, OutOfTimeError
from guided_lgp.bounds.goals import GoalTerms
from guided_lgp.bounds.path.assembly import stay
from guided_lgp.bounds.results import PathResult
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.clearance import CLEARANCE, Clearance, check_clearance, clearance_of_path
from guided_lgp.domains import load_domain
from guided_lgp.errors import InputError
from guided_lgp.explanation import ObservedBounds, Obstacle, users_bounds
from guided_lgp.hands import faster
from guided_lgp.limits import limits_for
from guided_lgp.logic import (
    Goal,
    Objective,
    Skeleton,
    parse_objective,
    progress,
    satisfied,
)
from guided_lgp.logic.objectives import check_objective
from guided_lgp.params import BoundsParams, PlanningParams, load_planning
from guided_lgp.paths import MODELS
from guided_lgp.policy.registry import (
    DEFAULT_POLICY,
    POLICIES,
    load_policy,
    missing_instructions,
)
from guided_lgp.policy.uniform import Uniform
from guided_lgp.scene import Scene, load_scene
from guided_lgp.scene.contradictions import check_places
from guided_lgp.scene.goals import complete_objective, in_the_way
from guided_lgp.scene.validate import validate_scene
from guided_lgp.scene.world import initial_poses
from guided_lgp.search.facts import TaskFacts
from guided_lgp.search.finding import Finding
from guided_lgp.search.given import read_skeleton
from guided_lgp.search.planners import (
    DEFAULT_SEARCH,
    SEARCHES,
    WITHOUT_POLICY,
    Search,
    check_planners,
)
from guided_lgp.search.policy import Policy
from guided_lgp.search.problem import Problem
from guided_lgp.search.result import REASONS, Cause, Run, SearchResult, Times, joined
from guided_lgp.search.ways import widened_scene

PATIENCE = 3
"""How many times as many starts a second search has where no fact says why there is no plan."""

_NO_POSTURE = ("no motion found to the posture at the end", "another posture")
"""What is found, and what would help, where arms cannot go where goals want them."""

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
    finding: Finding | None = None
    """Without a plan: why, as far as facts tell, and what would help."""

    @cached_property
    def clearance(self) -> Clearance | None:
        """Where its motion comes nearest to what it does not touch; None without a motion."""
        return clearance_of_path(self.scene, self.path)

    @property
    def unexplained(self) -> bool:
        """Whether it says that there is no plan, and no fact does."""
        return self.reason in ("exhausted", "attempts") and self.finding is None

    @property
    def explanation(self) -> str:
        """One line: why there is no plan and what was tried; empty if there is one."""
        if self.reason is None:
            return ""
        if self.reason == "impossible" and self.finding is not None:
            return self.finding.text
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
        if self.finding is not None:
            return f"{self.finding.text}; {line}"
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
    skeleton: str | Skeleton = (),
    candidates: int = 1,
    coordinate: bool = True,
    clearance: float = CLEARANCE,
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
        skeleton: actions with which the plan begins, also as text; or a file with them: a plan, or
            one action a line. If the goals hold after them, or there are none, they are the plan.
        candidates: of so many plans at most the shortest, of several the fastest, is the result; up
            to three of four are the same actions by other hands, and the rest at other places.
        coordinate: whether all arms move at once where they can, with limited jerk and no way home
            that is not needed; actions of two arms may then change places, unless they are given.
            Otherwise one arm moves at a time.
        clearance: m that arms, hands and what they carry keep on their way from what they do not
            touch, where there is room; from 0.003, which all motions keep, to 0.05.
        where: the scene's file, for messages.

    Returns:
        The result: ``solved``, ``skeleton``, ``path``; or the ``explanation`` and ``obstacles``.

    Raises:
        InputError: a fault in the scene, the objective, the names or the models.
    """
    deadline = Deadline.after(timeout)
    check_planners(POLICIES)
    if planner not in SEARCHES:
        raise InputError("planner", f"unknown {planner!r}", ", ".join(SEARCHES))
    if not isinstance(scene, Scene):
        scene, where = load_scene(scene), str(scene)
    check_clearance(clearance)
    chosen = domain is not None or "domain" in scene.model_fields_set
    if domain is not None:
        scene = scene.model_copy(update={"domain": load_domain(domain).name})
    validate_scene(scene, where)
    texts = [objective] if isinstance(objective, str) else map(str, objective)
    goals = complete_objective(parse_objective(texts), scene)
    prefix = read_skeleton(skeleton, scene.symbols, scene.state)
    if goals or not prefix:
        check_objective(goals, scene.symbols)
        check_places(goals, scene)
    misplaced = _misplaced(scene, goals)
    params = params or load_planning()
    if not prefix and satisfied(scene.state, goals) and not misplaced:
        rest = _at_rest(scene, goals, params, deadline)
        if not rest.feasible:
            return _without_search(scene, goals, None, Finding("posture", *_NO_POSTURE))
        return _without_search(scene, goals, rest)
    if (prefix or misplaced) and not SEARCHES[planner].over_sequences:
        accepted = ", ".join(name for name, search in SEARCHES.items() if search.over_sequences)
        raise InputError("planner", f"{planner} knows neither sequences nor places", accepted)
    bounds_of = partial(
        users_bounds,
        deadline=deadline,
        objective=goals,
        coordinate=coordinate,
        in_order=bool(prefix),
        clearance=clearance,
    )
    scene_bounds = bounds_of(scene, params.bounds)
    if finding := TaskFacts(scene_bounds, goals, misplaced).before_search():
        return _without_search(scene, goals, None, finding)
    search, followed = _guidance(planner, policy, models, scene)
    by_hands = candidates * 3 // 4 if coordinate and not prefix else 0
    problem = Problem(
        scene,
        goals,
        limits_for(params.compare_scalability, scene, goals, prefix, max_nodes),
        _observing(scene_bounds),
        followed,
        parts=scene_bounds,
        misplaced=misplaced,
        prefix=prefix,
        candidates=candidates - by_hands,
        deadline=deadline,
    )
    attempts = _Attempts(problem, bounds_of)
    if prefix and satisfied(progress(scene.state, prefix), goals):
        return attempts.result(_only_timed(problem))
    if not chosen:
        problem = replace(problem, widened=partial(attempts.widened, params.bounds))
        if not search.widens and (wider := problem.widened()) is not None:
            search, problem = SEARCHES[WITHOUT_POLICY] if search.follows_policy else search, wider
    found = search.plan(problem)
    if not found.solved and not deadline.passed and attempts.take_up():
        found = joined(found, search.plan(problem))
    result = attempts.result(found)
    if result.unexplained and not deadline.passed:
        found = joined(found, search.plan(attempts.patient(params.bounds)))
        result = attempts.result(found)
    if result.solved and candidates > 1:
        result = attempts.result(faster(attempts.last, found, candidates, by_hands))
    return result


def _at_rest(
    scene: Scene, goals: Objective, params: PlanningParams, deadline: Deadline
) -> PathResult:
    """The plan of no actions, in which arms may still have to go where goals want them."""
    if not GoalTerms.of(goals, scene.symbols.domain).ends:
        return stay(scene)
    return users_bounds(scene, params.bounds, deadline, goals).rest()


def _only_timed(problem: Problem) -> SearchResult:
    """The geometry of a sequence that is given as a whole."""
    run = Run(problem)
    return run.result(1, None if run.solve(problem.prefix) else "given")


class _Attempts:
    """A problem, and the same with further instructions where a search has asked for them."""

    def __init__(
        self, problem: Problem, bounds_of: Callable[[Scene, BoundsParams], SceneBounds]
    ) -> None:
        self.first = self.last = problem
        self._starts = 0
        self._bounds_of = bounds_of

    def widened(self, params: BoundsParams) -> Problem | None:
        """The problem with further instructions, if a goal needs them and there is time to tell."""
        problem, scene = self.first, None
        if self.last is not problem:
            return self.last
        with suppress(OutOfTimeError):
            scene = widened_scene(problem.scene, problem.objective, params, problem.deadline)
        if scene is None:
            return None
        bounds = self._bounds_of(scene, params)
        knows = problem.policy and not missing_instructions(problem.policy, scene.symbols.domain)
        self.last = replace(
            problem,
            scene=scene,
            bounds=_observing(bounds),
            parts=bounds,
            policy=problem.policy if knows else Uniform(),
        )
        return self.last

    def patient(self, params: BoundsParams) -> Problem:
        """The problem with more starts for each verdict: facts have as many, and say nothing."""
        last = self.last
        self._starts += _observed(last).starts
        more = params.model_copy(update={"coarse_restarts": PATIENCE * params.coarse_restarts})
        bounds = self._bounds_of(last.scene, more)
        self.last = replace(last, bounds=_observing(bounds), parts=bounds, widened=lambda: None)
        return self.last

    def take_up(self) -> bool:
        """Whether sequences have been put off: another search may look at them."""
        put_off = [_observed(problem).take_up() for problem in (self.first, self.last)]
        return any(put_off)

    def result(self, found: SearchResult) -> PlanningResult:
        """What the searches have found, with what stopped the sequences of the last one."""
        problem, bounds = self.last, _observed(self.last)
        obstacles = bounds.obstacles(problem.scene.state, problem.objective)
        return PlanningResult(
            **vars(found),
            scene=problem.scene,
            objective=problem.objective,
            solver_starts=self._starts + bounds.starts,
            obstacles=() if found.solved else obstacles,
            finding=None if found.solved else _finding(problem, obstacles),
        )


def _observing(bounds: SceneBounds) -> ObservedBounds:
    return ObservedBounds(bounds, bounds.placed)


def _observed(problem: Problem) -> ObservedBounds:
    assert isinstance(problem.bounds, ObservedBounds)
    return problem.bounds


def _finding(problem: Problem, obstacles: Sequence[Obstacle]) -> Finding | None:
    """Why a search has found nothing, by facts of the scene; None if they tell nothing in time."""
    assert isinstance(problem.parts, SceneBounds)
    facts = TaskFacts(problem.parts, problem.objective, problem.misplaced, problem.deadline)
    judged = [obstacle.example for obstacle in obstacles if obstacle.bound == "coarse"]
    with suppress(OutOfTimeError):
        return facts.after_search() or (facts.about(judged[0]) if judged else None)
    return None


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


def _without_search(
    scene: Scene, goals: Objective, path: PathResult | None, finding: Finding | None = None
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
        failed_candidates=0,
        causes=(),
        reattempts={},
        times=Times(0.0, 0.0, 0.0, 0.0),
        reason=None if path else "impossible",
        solver_starts=0,
        finding=finding,
    )
