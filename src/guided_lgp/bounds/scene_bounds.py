"""Both bounds of the NLP for one scene, each verdict computed once."""

from collections.abc import Iterator
from functools import cached_property

from guided_lgp.bounds.coarse import CoarseBound
from guided_lgp.bounds.coarse.facts import Facts
from guided_lgp.bounds.coarse.pairs import Pairs
from guided_lgp.bounds.coarse.parts import Boxes, Parts
from guided_lgp.bounds.deadline import NEVER, Deadline
from guided_lgp.bounds.goals import GoalTerms
from guided_lgp.bounds.path import PAPER, PathBound, Style, check_motions
from guided_lgp.bounds.results import CoarseResult, PathResult
from guided_lgp.bounds.vocabulary import check_terms
from guided_lgp.logic import Objective, Skeleton
from guided_lgp.params import BoundsParams
from guided_lgp.scene import Scene

_PATIENCE = 3
"""How many times the starts a part of a scene gets: its "no" holds for all else that is tried."""


class SceneBounds:
    """P_coarse and P of the skeletons of one scene (paper, eqs. 3 and 4).

    The coarse bound of a skeleton starts from its prefix, and a skeleton with an infeasible prefix
    is infeasible: its constraints contain those of the prefix. So a verdict depends only on the
    scene, the objective and the skeleton, whoever asks first, and planners of one objective may
    share one instance; goals of symbols alone change nothing. After the deadline there are no more
    verdicts, but an ``OutOfTimeError``.
    """

    def __init__(
        self,
        scene: Scene,
        params: BoundsParams,
        deadline: Deadline = NEVER,
        objective: Objective = (),
        style: Style = PAPER,
    ) -> None:
        """Prepare a scene.

        Args:
            scene: the initial configuration.
            params: limits of both bounds.
            deadline: after which there are no more verdicts.
            objective: goals, which may say more than symbols.
            style: how motions are made.
        """
        check_terms(scene.symbols.domain)
        check_motions(scene.symbols.domain)
        self.scene = scene
        self._goals = GoalTerms.of(objective, scene.symbols.domain)
        self._coarse_bound = CoarseBound(
            scene, params.coarse_restarts, deadline=deadline, goals=self._goals, firm=style.firm
        )
        self._path_solutions, self._style = params.path_solutions, style
        self._deadline = deadline
        self._parts = Parts(scene, _PATIENCE * params.coarse_restarts, self.facts, deadline)
        self._pairs = Pairs(scene, self._coarse_bound.solve, self._parts.solve)
        self._coarse: dict[Skeleton, CoarseResult] = {}
        self._path: dict[Skeleton, PathResult] = {}

    @property
    def placed(self) -> frozenset[str]:
        """The bodies whose place at the end goals ask for."""
        return frozenset(term.symbols[0] for term in self._goals.final)

    @property
    def facts(self) -> Facts:
        """What single arms cannot do in the scene."""
        return self._coarse_bound.facts

    def coarse(self, skeleton: Skeleton) -> CoarseResult:
        """One verified configuration per action, or why there is none."""
        result = self._coarse.get(skeleton)
        if result is None:
            prefix = self.coarse(skeleton[:-1]) if len(skeleton) > 1 else None
            result = self._coarse[skeleton] = self._verdict(skeleton, prefix)
        return result

    def _verdict(self, skeleton: Skeleton, prefix: CoarseResult | None) -> CoarseResult:
        if prefix is None:
            failure = None
        elif prefix.feasible:
            failure = self._pairs.impossible(skeleton)
        else:
            failure = prefix.failure
        if failure is not None:
            return CoarseResult(skeleton, feasible=False, failure=failure, restarts=0)
        return self._coarse_bound.solve(skeleton, prefix)

    def part(self, boxes: Boxes, skeleton: Skeleton) -> CoarseResult:
        """The coarse bound with some boxes alone; see :class:`Parts`."""
        return self._parts.solve(boxes, skeleton)

    def out_of_reach(self, skeleton: Skeleton) -> bool:
        """Whether it is proved that an arm cannot reach what the last action asks of it."""
        return self.facts.impossible(skeleton) is not None

    def path(self, skeleton: Skeleton) -> PathResult:
        """The verified motion for the whole skeleton, or why there is none."""
        result = self._path.get(skeleton)
        if result is None:
            coarse = self._coarse_bound.finish(self.coarse(skeleton))
            if coarse.feasible:
                result = self._path_bound.solve(coarse)
            else:
                result = PathResult(skeleton, feasible=False, failure=coarse.failure)
            self._path[skeleton] = result
        return result

    def other_paths(self, skeleton: Skeleton, count: int) -> Iterator[PathResult]:
        """Further verified motions for a skeleton that has one: other places, other grips.

        Args:
            skeleton: the actions.
            count: how many further coarse solutions to look at.
        """
        yield from self._path_bound.others(skeleton, count)

    def rest(self) -> PathResult:
        """The motion of a plan without actions."""
        return self._path_bound.rest()

    @cached_property
    def _path_bound(self) -> PathBound:
        """Built when first asked: most skeletons never get so far."""
        return PathBound(
            self.scene,
            self._coarse_bound,
            self._path_solutions,
            self._deadline,
            self._goals,
            self._style,
        )
