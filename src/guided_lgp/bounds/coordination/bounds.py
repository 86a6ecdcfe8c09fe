"""The bounds of a scene, with paths in which all arms move."""

from typing import Protocol

from guided_lgp.bounds.coordination.coordinate import Coordinator
from guided_lgp.bounds.deadline import Deadline
from guided_lgp.bounds.goals import GoalTerms
from guided_lgp.bounds.results import CoarseResult, PathResult
from guided_lgp.bounds.scene_bounds import SceneBounds
from guided_lgp.logic import Objective, Skeleton


class _Bounds(Protocol):
    def coarse(self, skeleton: Skeleton) -> CoarseResult: ...

    def path(self, skeleton: Skeleton) -> PathResult: ...


class CoordinatedBounds:
    """Bounds whose paths are shortened as soon as they are found."""

    def __init__(self, bounds: _Bounds, coordinator: Coordinator) -> None:
        self._bounds = bounds
        self._coordinator = coordinator
        self._paths: dict[Skeleton, PathResult] = {}

    @classmethod
    def of(
        cls, bounds: SceneBounds, deadline: Deadline, objective: Objective, in_order: bool
    ) -> "CoordinatedBounds":
        """Those of a scene; see :class:`Coordinator`."""
        goals = GoalTerms.of(objective, bounds.scene.symbols.domain)
        return cls(bounds, Coordinator(bounds.scene, deadline, goals, in_order))

    def coarse(self, skeleton: Skeleton) -> CoarseResult:
        """One verified configuration per action, or why there is none."""
        return self._bounds.coarse(skeleton)

    def path(self, skeleton: Skeleton) -> PathResult:
        """The verified motion of all arms for a skeleton, or why there is none."""
        result = self._paths.get(skeleton)
        if result is None:
            found = self._bounds.path(skeleton)
            result = self._coordinator.shorten(found) if found.feasible else found
            self._paths[skeleton] = result
        return result
